"""Interval of a gain that a record which ends early extrapolates."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.numerics.constants import Z_95
from ctrl_realize.numerics.engine.static_gain import StaticGain, gain_ends


def _gain(gain: float, reached_std: float, share_std: float) -> StaticGain:
    """A gain of which a record shows 60 %, with independent errors of both."""
    both = float(np.hypot(reached_std, share_std))
    return StaticGain(
        gain=gain,
        gain_std=abs(gain) * both,
        total=1.0,
        total_std=0.1,
        slowest=2.0,
        integrates=False,
        reached=0.6 * gain,
        reached_std=reached_std,
        share_std=share_std,
    )


@pytest.mark.parametrize("gain", [2.0, -3.0])
def test_the_interval_is_that_of_fieller(gain: float) -> None:
    a, b = 0.05, 0.3
    ends = gain_ends([(_gain(gain, a, b), 1.0)], 0.0)
    # Ratio of two normal variables with relative errors a and b (Fieller 1954).
    root = Z_95 * np.sqrt(a**2 + b**2 - (Z_95 * a * b) ** 2)
    closed = sorted(gain * (1 + sign * root) / (1 - (Z_95 * b) ** 2) for sign in (-1, 1))
    assert ends == pytest.approx(closed, rel=1e-4)  # 1.96 is rounded


def test_a_response_of_which_any_part_may_be_seen_has_no_upper_end() -> None:
    low, high = gain_ends([(_gain(2.0, 0.01, 0.9), 1.0)], 0.0)
    # rel: the error of the height, of 1 %, is left out
    assert low == pytest.approx(2 / (1 + Z_95 * 0.9), rel=1e-2)
    assert high == np.inf
    assert gain_ends([(_gain(-2.0, 0.01, 0.9), 1.0)], 0.0) == pytest.approx((-high, -low))


def test_small_errors_are_those_of_a_normal_distribution() -> None:
    low, high = gain_ends([(_gain(2.0, 1e-4, 2e-4), 1.0)], 0.0)
    reach = 2 * Z_95 * np.hypot(1e-4, 2e-4)
    # abs: a ratio is skewed by the square of the error of its denominator
    assert (low, high) == pytest.approx((2 - reach, 2 + reach), abs=1e-3 * reach)


def test_a_response_that_may_be_noise_leaves_the_sign_open() -> None:
    low, high = gain_ends([(_gain(2.0, 0.8, 0.3), 1.0)], 0.0)
    assert low < 0 < high


@pytest.mark.parametrize("seed", range(5))
def test_a_record_that_rises_to_its_end_tells_the_sign(seed: int) -> None:
    """Simulated: 20 s and 17 s behind 12 s, noise of 1 %, recorded until 47 % of the response."""
    rng = np.random.default_rng(seed)
    since = np.clip(np.arange(-60.0, 42.0) - 12, 0, None)
    y = 1 - (20 * np.exp(-since / 20) - 17 * np.exp(-since / 17)) / 3
    record = cr.Record(
        np.arange(since.size) * 1.0,
        np.where(np.arange(since.size) < 60, 0.0, 1.0),
        -3 * (y + 0.01 * rng.standard_normal(y.size)),
    )
    low, high = cr.identify(record).fit.gain_interval
    assert low <= -3 <= high < 0
