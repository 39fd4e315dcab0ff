"""Long records condensed to the sums that the likelihood needs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.output_error.condensed import MOST_LAGS, condensed
from ctrl_realize.numerics.regression.normal_equations import normal_equations
from ctrl_realize.numerics.separable.responses import SampledInput

DT = 0.01
LAGS = 40


def record(samples, seed=0, pulse=None, noise=0.1):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 3 + 1), 3)[:samples]
    g = 0.9 ** np.arange(LAGS) if pulse is None else pulse
    return lfilter(g, [1.0], u) + noise * rng.standard_normal(samples), u


def test_the_condensed_misfit_differs_from_that_of_all_samples_by_a_constant():
    # two records, one of them longer than what is summed at a time
    both = [record(3000), record(140_000, seed=1)]
    rng = np.random.default_rng(5)
    y = [output + 0.0 for output, _ in both]
    found = condensed(y, [u for _, u in both], DT, LAGS, huber=False)
    models = [0.9 ** np.arange(LAGS) + 0.01 * rng.standard_normal(LAGS) for _ in range(4)]
    short = [float(np.sum((found.data - found.drive.factor @ g) ** 2)) for g in models]
    assert found.noise_lags == 0  # white noise is left as it is
    whole = []
    for g in models:
        total = 0.0
        for output, u in zip(y, (u for _, u in both), strict=True):
            error = (output - lfilter(g, [1.0], u))[LAGS - 1 :]
            pieces = np.array_split(error, -(-error.size // 2**17))
            total += sum(float(np.sum((piece - piece.mean()) ** 2)) for piece in pieces)
        whole.append(total)
    # the pieces with a level of their own begin elsewhere, by a sample or so
    assert_allclose(np.diff(short), np.diff(whole), rtol=1e-4)
    assert abs(found.noise / 0.1 - 1) < 0.01


def test_the_drive_is_the_response_to_a_pulse_times_the_factor():
    y, u = record(3000)
    found = condensed([y], [u], DT, LAGS, huber=False)
    tau, poles = np.array([0.023, 0.1]), np.array([[-3.0, -8 + 5j], [-20.0, -1.0 + 0j]])
    pulse = np.zeros(LAGS)
    pulse[0] = 1.0
    exact = SampledInput(pulse, DT).modes(tau, poles)
    for one, other in zip(found.drive.modes(tau, poles), exact, strict=True):
        assert_allclose(one, np.einsum("ml,bl...->bm...", found.drive.factor, other), atol=1e-9)


def test_coloured_noise_is_made_white_and_leaves_the_response_as_it_is():
    y, u = record(60_000, noise=0.0)
    noise = lfilter([1.0], [1.0, -0.95], 0.1 * np.random.default_rng(3).standard_normal(y.size))
    found = condensed([y + noise], [u], DT, LAGS, huber=False)
    assert found.noise_lags >= 1
    assert abs(found.noise / 0.1 - 1) < 0.02
    left = found.data - found.drive.factor @ 0.9 ** np.arange(LAGS)
    # chi-square of as many rows as there are
    assert abs(np.mean(left**2) / found.noise**2 - 1) < 5 * np.sqrt(2 / left.size)


def test_outliers_count_for_little_with_hubers_loss():
    y, u = record(30_000)
    spikes = np.random.default_rng(4).integers(0, y.size, 300)
    y[spikes] += 50.0
    size = {}
    for huber in (False, True):
        found = condensed([y], [u], DT, LAGS, huber=huber)
        size[huber] = found.noise
    assert size[False] > 10 * 0.1
    assert size[True] < 1.2 * 0.1


def test_levels_that_differ_from_record_to_record_do_not_matter():
    y, u = record(5000)
    one = condensed([y], [u], DT, LAGS, huber=False)
    other = condensed([y + 1e3], [u - 50.0], DT, LAGS, huber=False)
    g = 0.5 ** np.arange(LAGS)
    costs = [np.sum((c.data - c.drive.factor @ g) ** 2) for c in (one, other)]
    assert costs[1] == pytest.approx(costs[0], rel=1e-6)


def test_directions_that_are_not_excited_have_no_row():
    # two lines: four directions
    k = np.arange(20_000)
    u = np.sin(0.3 * k) + np.sin(0.8 * k)
    y = lfilter(0.9 ** np.arange(LAGS), [1.0], u) + 0.1 * np.random.default_rng(0).standard_normal(
        k.size
    )
    found = condensed([y], [u], DT, LAGS, huber=False)
    assert found.data.size == 4
    sums = normal_equations(u[None], y[None], LAGS)
    assert_allclose(found.drive.factor.T @ found.drive.factor, sums.gram, atol=1e-6 * sums.rows)


@pytest.mark.parametrize(("samples", "lags"), [(500, LAGS), (30_000, MOST_LAGS + 1), (3000, 1)])
def test_what_cannot_be_condensed_is_left(samples, lags):
    y, u = record(samples)
    assert condensed([y], [u], DT, lags, huber=True) is None
