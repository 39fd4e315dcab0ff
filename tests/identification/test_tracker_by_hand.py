"""What a tracker does between its samples, with solutions that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.numerics.time_axis import EXTREME

DT = 0.01
POLE = 0.9
CORE = ct.ss([[POLE]], [[1.0]], [[0.1]], [[0.0]], DT)
U = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)


def tracker(**options):
    # 300 samples of memory: an estimate every six
    return cr.DelayTracker(CORE, **{"max_delay": 20, "memory": 3.0, **options})


def feed(one, samples, value=1.0):
    for _ in range(samples):
        one.update(value, 0.0)


@pytest.mark.parametrize(("dynamics", "needed"), [(True, 40), (False, 30)])
def test_ten_samples_for_each_parameter_behind_the_largest_delay_are_needed(dynamics, needed):
    one = tracker(dynamics=dynamics)
    for u in U[: needed - 1]:
        one.update(u, u)
    assert one.estimate().reason == f"only {needed - 1} samples yet"
    one.update(1.0, 1.0)
    assert "samples yet" not in one.estimate().reason


def test_before_anything_is_known_all_candidates_are_open():
    one = tracker(min_delay=3)
    for samples in (0, 12):
        now = one.estimate()
        assert (now.delay, now.dead_time, now.interval) == (3, 3 * DT, (3, 20))
        assert (now.gain_ratio, now.gain_std, now.noise_std) == (1.0, np.inf, np.inf)
        assert (now.speed_ratios, now.tells) == ((), False)
        assert now.time == pytest.approx(max(samples - 1, 0) * DT)
        feed(one, 12)
    assert one.estimate().reason == "only 24 samples yet"
    assert "delays 3...20, 24 samples" in repr(one)
    # the model is then the starting one
    assert one.model.delay == 3
    assert_allclose(one.model.markov(9)[4:], 0.1 * POLE ** np.arange(5), rtol=1e-12)


@pytest.mark.parametrize(
    ("before", "place", "interval"),
    [
        (7.0, 9.5, (8, 13)),  # 2.5 samples up: the delay may be three more by now
        (9.5, 7.0, (5, 10)),
        (7.0, 7.0, (8, 10)),
        (np.nan, 9.5, (8, 10)),  # nothing was told
        (None, 9.5, (8, 10)),
        (0.0, 15.0, (8, 20)),  # not beyond the candidates
        (20.0, 9.0, (2, 10)),
    ],
)
def test_a_trail_lies_on_the_side_to_which_the_delay_goes(before, place, interval):
    one = tracker(min_delay=2)
    if before is not None:
        one._places.append(before)
        one._places.append(99.0)
    assert one._with_trail((8, 10), place) == interval


def test_the_first_sample_is_rest():
    plain, raised = tracker(), tracker()
    y = cr.DelayedStateSpace(CORE, 7).simulate(U - U[0])
    for u, v in zip(U[:200], y[:200], strict=True):
        plain.update(u - U[0], v)
        # whose squares would leave nothing of the response in double precision
        raised.update(u + 3.0, v + 1e8)
    assert plain.estimate().delay == 7
    # a response of about 1 in steps of 1.5e-8
    assert raised.estimate().dead_time == pytest.approx(plain.estimate().dead_time, abs=1e-6)


def test_samples_up_to_the_largest_measurement_are_taken():
    one = tracker()
    one.update(EXTREME, -EXTREME)
    one.update(np.array(3.5), np.float32(2.0))
    for u, y in ((1.001 * EXTREME, 0.0), (0.0, -1.001 * EXTREME)):
        with pytest.raises(DataError, match=r"sample 2 is .*beyond 1e"):
            one.update(u, y)
    for u, y in ((np.inf, 0.0), (0.0, np.nan)):
        with pytest.raises(DataError, match=r"sample 2 is .*finite numbers"):
            one.update(u, y)
    single = np.array([1.0])  # which float() takes with NumPy before 2.4
    for u, y in ((single, 0.0), (0.0, single), ([1.0], 0.0), ("one", 0.0), (0.0, None)):
        with pytest.raises(DataError, match=r"sample 2 is .*one number each"):
            one.update(u, y)
