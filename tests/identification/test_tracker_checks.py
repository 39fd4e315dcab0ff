"""Where the choices of a tracker end."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

from ctrl_realize.errors import DelayRangeError, OptionError, UnsuitableSystemError
from ctrl_realize.identification.tracker_checks import (
    LONGEST,
    check_memory,
    check_start,
)

DT = 0.1


def core(pole=0.5, C=1.0, D=0.0, dt=DT):
    return ct.ss([[pole]], [[1.0]], [[C]], [[D]], dt)


def test_a_memory_is_longer_than_the_largest_candidate_and_not_without_end():
    assert check_memory(2.5, 0.5, 4) == 5.0
    with pytest.raises(DelayRangeError, match="5 samples, and delays up to 5"):
        check_memory(2.5, 0.5, 5)
    assert check_memory(LONGEST, 1.0, 5) == LONGEST
    with pytest.raises(OptionError, match="at most 1e"):
        check_memory(1.001 * LONGEST, 1.0, 5)
    with pytest.raises(OptionError, match=r"memory=0.*time in s"):
        check_memory(0.0, 1.0, 5)


def test_a_model_needs_an_answer_of_either_kind():
    check_start(core(C=0.0, D=2.0))
    check_start(core(C=2.0, D=0.0))
    check_start(ct.ss([], [], [], [[2.0]], DT))
    with pytest.raises(OptionError, match="zero"):
        check_start(core(C=0.0))
    with pytest.raises(OptionError, match="zero"):
        check_start(ct.ss([], [], [], [[0.0]], DT))


@pytest.mark.parametrize(
    ("model", "match"),
    [
        (core(dt=None), "discrete"),
        (core(dt=0), "discrete"),
        (core(dt=True), "with its sample time"),
        (ct.ss([[0.5]], [[1.0]], np.ones((2, 1)), np.zeros((2, 1)), DT), "one channel"),
        (ct.ss([[0.5]], [[1.0, 1.0]], [[1.0]], np.zeros((1, 2)), DT), "one channel"),
        (ct.tf([1.0], [1.0, 0.5], DT), "a system of one channel"),
        ("model", "a system of one channel"),
    ],
)
def test_what_cannot_be_followed_is_refused(model, match):
    with pytest.raises(UnsuitableSystemError, match=match):
        check_start(model)
