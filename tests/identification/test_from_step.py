"""What becomes of a step response and of the rest before it, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from ctrl_realize.numerics.signals.filters import low_pass

DT = 0.01


def step(before=60, after=240, seed=0):
    """A lag of 0.1 s behind 5 samples after a noisy rest."""
    rng = np.random.default_rng(seed)
    k = np.arange(before + after)
    u = 1.0 * (k >= before)
    y = np.where(k >= before + 5, -np.expm1(-(k - before - 4) * DT / 0.1), 0.0)
    return cr.unit_step(
        cr.Record(DT * k, u, y + 0.01 * rng.standard_normal(k.size)), remove_drift=False
    )


def test_noise_is_the_rest_treated_as_the_response():
    one = step()
    plain = cr.impulse_from_step(one, cutoff_hz=None)
    differences = np.r_[0.0, np.diff(one.pre)]  # the first has none before it
    assert_allclose(plain.noise, differences, rtol=0, atol=1e-15)
    assert_allclose(plain.markov, np.diff(np.r_[one.pre[-1], one.output]), rtol=0, atol=1e-15)
    smooth = cr.impulse_from_step(one, cutoff_hz=10.0, filter_order=3, zero_phase=False)
    expected = low_pass(differences, 3, 10.0, DT, zero_phase=False)
    assert_allclose(smooth.noise, expected, rtol=0, atol=1e-15)


def test_the_central_difference_of_the_rest_is_that_of_four_neighbours():
    one = step()
    noise = cr.impulse_from_step(one, cutoff_hz=None, difference="central").noise
    pre = one.pre
    five = (pre[:-4] - 8 * pre[1:-3] + 8 * pre[3:-1] - pre[4:]) / 12
    assert_allclose(noise[2:-2], five, rtol=0, atol=1e-15)


def test_what_is_no_step_response_is_named():
    with pytest.raises(DataError, match="step is a list; needed is a StepResponse, see unit_step"):
        cr.impulse_from_step([1.0, 2.0])
    for order in (1, 10):
        assert (
            cr.impulse_from_step(step(), cutoff_hz=10.0, filter_order=order).filter.order == order
        )
    for order in (0, 11):
        with pytest.raises(OptionError, match="filter_order"):
            cr.impulse_from_step(step(), cutoff_hz=10.0, filter_order=order)
