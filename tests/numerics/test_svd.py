"""The decomposition agrees with NumPy's, also where NumPy's does not end."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from ctrl_realize.numerics.svd import thin_svd


def check(matrix):
    U, values, Vt = thin_svd(matrix)
    assert (np.diff(values) <= 0).all()
    # rounding of a decomposition of some fifty rows
    assert_allclose(U @ (values[:, None] * Vt), matrix, atol=1e-13 * values[0])
    assert_allclose(U.T @ U, np.eye(values.size), atol=1e-13)
    assert_allclose(Vt @ Vt.T, np.eye(values.size), atol=1e-13)


@pytest.mark.parametrize("shape", [(5, 5), (7, 3), (3, 7)])
def test_the_factors_make_the_matrix(shape):
    check(np.random.default_rng(1).standard_normal(shape))


def test_a_matrix_on_which_divide_and_conquer_does_not_end_is_decomposed(monkeypatch):
    # the fuzz lane met such a Hankel matrix, which the tests do not keep: it fails with some
    # versions of LAPACK alone
    def no_end(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge")

    drivers = []
    slow = scipy.linalg.svd
    monkeypatch.setattr(np.linalg, "svd", no_end)
    monkeypatch.setattr(
        scipy.linalg, "svd", lambda *a, **k: drivers.append(k["lapack_driver"]) or slow(*a, **k)
    )
    check(np.random.default_rng(2).standard_normal((6, 4)))
    assert drivers == ["gesvd"]


def test_the_quick_method_is_the_first(monkeypatch):
    monkeypatch.setattr(scipy.linalg, "svd", None)
    check(np.random.default_rng(2).standard_normal((6, 4)))
