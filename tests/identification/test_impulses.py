"""What realization and scans ask of an impulse response: samples, orders, noise, filters."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, DelayRangeError, OptionError, OrderError
from ctrl_realize.identification.impulses import (
    check_order,
    check_samples,
    settled_samples,
)


def decay(pole: float, n: int = 2000) -> np.ndarray:
    return (1 - pole) * pole ** np.arange(n)


def impulse(markov: np.ndarray, **beside: object) -> cr.ImpulseResponse:
    return cr.ImpulseResponse(markov, 0.1, **beside)


def test_three_times_the_settling_time_is_used():
    # 1 - S_k = 0.98^(k+1) falls below 2 % of its range at k = 193
    assert settled_samples(impulse(decay(0.98)), 3, 0) == pytest.approx(3 * 193, abs=6)


def test_more_delays_than_can_be_scanned_are_refused_with_what_to_do():
    slow = impulse(decay(0.9998, 60_000))
    with pytest.raises(DataError, match="sampled far more finely than it moves; take every so"):
        settled_samples(slow, 3, 5000)
    # who asks for it gets it
    assert check_samples(slow, 20_000, 3, 5000, padded=False, what="max_delay") == 20_000


def test_samples_and_orders_that_do_not_fit_are_refused():
    short = impulse(decay(0.5, 20))
    assert check_samples(short, 2, 1, 0, padded=False, what="delay") == 2
    assert check_samples(short, None, 1, 5, padded=False, what="delay") == 14
    assert check_samples(short, 14, 1, 5, padded=False, what="delay") == 14
    with pytest.raises(OptionError, match="samples=1"):
        check_samples(short, 1, 1, 0, padded=False, what="delay")
    with pytest.raises(DelayRangeError, match="samples=15 and delay=5 need 21"):
        check_samples(short, 15, 1, 5, padded=False, what="delay")
    with pytest.raises(DelayRangeError, match="delay=19 needs more than 20 samples"):
        check_samples(short, None, 1, 19, padded=False, what="delay")
    check_order(short, 7, 14, padded=False)
    for order in (0, 8):
        with pytest.raises(OrderError, match="1 <= order <= 7"):
            check_order(short, order, 14, padded=False)
    square = impulse(np.ones((2, 2, 20)))
    check_order(square, 14, 14, padded=False)
    with pytest.raises(OrderError, match="1 <= order <= 14"):
        check_order(square, 15, 14, padded=False)
