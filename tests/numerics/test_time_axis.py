"""What is wrong with a time axis, and its step."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.time_axis import axis_fault, sample_time


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
def test_the_step_is_freed_of_rounding_in_any_unit(unit):
    assert sample_time(0.1 * unit * np.arange(7.0)) == pytest.approx(0.1 * unit, rel=1e-15, abs=0)
    # thirteen digits are no rounding
    odd = 0.1000000000001 * unit
    assert sample_time(np.array([0.0, odd])) == odd


def test_one_missing_sample_is_a_gap():
    time = np.array([0.0, 1.0, 2.0, 4.0, 5.0, 6.0])
    fault = axis_fault(time)
    assert fault == ("time has a gap at row 3: 2 s where 1 s is usual (about 1 sample(s) missing)")
    assert axis_fault(np.arange(5.0)) is None
