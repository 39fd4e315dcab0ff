from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.regression.normal_equations import normal_equations


def by_rows(z, y, lags, offset):
    """The regression matrix itself, row by row: the oracle."""
    rows, targets = [], []
    for k in range(lags - 1, z.shape[1]):
        row = np.concatenate([signal[k - lags + 1 : k + 1][::-1] for signal in z])
        if np.isfinite(row).all() and np.isfinite(y[:, k]).all():
            rows.append(row)
            targets.append(y[:, k])
    phi, target = np.array(rows), np.array(targets)
    if offset:
        phi, target = phi - phi.mean(axis=0), target - target.mean(axis=0)
    return phi, target


@pytest.mark.parametrize("missing", [0, 4, 30, 60])  # the last: more rows are lost than kept
@pytest.mark.parametrize("offset", [True, False])
@pytest.mark.parametrize(("signals", "targets", "lags"), [(1, 1, 1), (2, 2, 5), (3, 1, 12)])
def test_sums_by_fft_equal_those_of_the_regression_matrix(
    rng, missing, offset, signals, targets, lags
):
    z, y = rng.normal(size=(signals, 80)), rng.normal(size=(targets, 80))
    if offset:
        z, y = z + 3, y - 100
    y[0, rng.permutation(80)[:missing]] = np.nan
    if missing:
        z[0, 40] = np.nan
    equations = normal_equations(z, y, lags, offset=offset)
    phi, target = by_rows(z, y, lags, offset)
    assert equations.rows == len(phi) > 0
    # sums of 80 products of numbers of size one
    assert_allclose(equations.gram, phi.T @ phi, rtol=0, atol=1e-11)
    assert_allclose(equations.cross, phi.T @ target, rtol=0, atol=1e-11)
    assert_allclose(equations.power, target.T @ target, rtol=0, atol=1e-11)


def test_equations_of_two_records_add_up(rng):
    z, y = rng.normal(size=(1, 50)), rng.normal(size=(1, 50))
    total = normal_equations(z, y, 4) + normal_equations(2 * z, y + 7, 4)
    first, second = by_rows(z, y, 4, True), by_rows(2 * z, y + 7, 4, True)
    phi = np.concatenate([first[0], second[0]])
    assert total.rows == 94
    assert total.freedom == 92  # one offset each
    assert_allclose(total.gram, phi.T @ phi, rtol=0, atol=1e-11)


@pytest.fixture
def rng():
    return np.random.default_rng(5)
