"""Long records as sums of products: whatever part has which frequency, nothing is lost."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.output_error.any_input.condensed import condensed

LAGS, NOISE, POLE = 100, 0.05, np.exp(-0.2)
PULSE = np.r_[np.zeros(2), (1 - POLE) * POLE ** np.arange(LAGS - 2)]  # at the lags 1 ... 100


def slow(size):
    """Input whose response is that of its level: the pulse response is not excited."""
    return np.sin(2 * np.pi * np.arange(size) / size)


def lively(size, rng):
    return np.repeat(rng.choice([-1.0, 1.0], size // 5), 5)


def output(u, rng):
    return lfilter([0, 0, 0, 1 - POLE], [1, -POLE], u) + NOISE * rng.standard_normal(u.size)


@pytest.mark.parametrize("huber", [False, True])
def test_the_noise_is_that_of_all_records_though_the_longest_hardly_excites(huber):
    rng = np.random.default_rng(0)
    inputs = [slow(8000), lively(6000, rng)]
    outputs = [output(u, rng) for u in inputs]
    sums = condensed(outputs, inputs, 1.0, LAGS, huber=huber)
    # 12 600 degrees of freedom: 0.6 %; Huber's pseudo-values have 5 % more variance than the noise
    most = 0.045 if huber else 0.02
    assert sums.noise == pytest.approx(NOISE, rel=most)
    left = sums.data - sums.drive.factor @ PULSE
    # a chi-square of as many degrees of freedom as there are rows
    assert np.mean((left / sums.noise) ** 2) == pytest.approx(1, abs=5 * np.sqrt(2 / left.size))


def test_a_record_at_rest_adds_nothing():
    rng = np.random.default_rng(1)
    u = lively(6000, rng)
    y = output(u, rng)
    rest = 2.0 + NOISE * rng.standard_normal(4000)
    alone = condensed([y], [u], 1.0, LAGS, huber=True)
    beside = condensed([y, rest], [u, np.ones(4000)], 1.0, LAGS, huber=True)
    assert beside.noise == pytest.approx(alone.noise, rel=0.02)
    assert_allclose(
        beside.drive.factor.T @ beside.drive.factor, alone.drive.factor.T @ alone.drive.factor,
        rtol=1e-9, atol=1e-6,
    )  # fmt: skip


@pytest.mark.parametrize("huber", [False, True])
@pytest.mark.parametrize("slow", [0.0, 0.9])
def test_a_proportional_controller_does_not_explain_the_noise(slow, huber):
    """u = K (r - y) gives every sample of the output by the input of the same sample."""
    rng = np.random.default_rng(2)
    target = np.repeat(rng.choice([-1.0, 1.0], 24), 1000)
    u = np.zeros(target.size)
    y = lfilter([1.0], [1.0, -slow], NOISE * rng.standard_normal(target.size))
    state = 0.0
    for k in range(target.size):
        state = POLE * state + (1 - POLE) * (u[k - 3] if k >= 3 else 0.0)
        y[k] += state
        u[k] = 0.5 * (target[k] - y[k])
    sums = condensed([y], [u], 1.0, LAGS, huber=huber)
    # that of the innovations: 23 900 degrees of freedom, and Huber's pseudo-values, as above
    assert sums.noise == pytest.approx(NOISE, rel=0.045 if huber else 0.02)
    assert sums.noise_lags == (1 if slow else 0)
    left = sums.data - sums.drive.factor @ PULSE
    assert np.mean((left / sums.noise) ** 2) == pytest.approx(1, abs=5 * np.sqrt(2 / left.size))
