"""Low-pass filters: where they cut, what they delay, how they start."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import sosfreqz

from ctrl_realize.numerics.signals.filters import butterworth, butterworth_group_delay, low_pass

DT = 1 / 1280


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_the_group_delay_is_the_slope_of_the_phase_at_zero(order):
    frequency = 1e-3
    response = sosfreqz(butterworth(order, 50.0, DT), [frequency], fs=1 / DT)[1]
    expected = -np.angle(response[0]) / (2 * np.pi * frequency * DT)
    # (w / wc)^2 of the slope's own change
    assert butterworth_group_delay(order, 50.0, DT) == pytest.approx(expected, rel=1e-6)


def test_the_causal_filter_looks_only_back_and_starts_at_rest():
    values = 3.0 + (np.arange(2000) >= 500)
    filtered = low_pass(values, 5, 50.0, DT, zero_phase=False)
    assert_allclose(filtered[:500], 3.0, atol=1e-12)
    assert filtered[500] != 3.0
    delay = np.sum(4.0 - filtered[500:])  # area above a unit step: its delay in samples
    assert delay == pytest.approx(butterworth_group_delay(5, 50.0, DT), rel=1e-9)


def test_forward_and_backward_is_symmetric_and_halves_the_power():
    pulse = np.zeros(4001)
    pulse[2000] = 1.0
    response = low_pass(pulse, 5, 50.0, DT, zero_phase=True)
    assert_allclose(response, response[::-1], atol=1e-12)
    k = np.arange(-2000, 2001)
    at_cutoff = np.sum(response * np.cos(2 * np.pi * 50.0 * DT * k))
    # twice through the filter: half the amplitude
    assert [response.sum(), at_cutoff] == pytest.approx([1, 0.5], abs=1e-9)
