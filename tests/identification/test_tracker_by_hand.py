"""What a tracker does between its samples, with solutions that are written by hand."""

from __future__ import annotations

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification import tracker as module
from ctrl_realize.identification.tracker import LEAP, MOMENTS, MOVED
from ctrl_realize.identification.tracker_solution import Solution
from ctrl_realize.numerics.time_axis import EXTREME

DT = 0.01
POLE = 0.9
CORE = ct.ss([[POLE]], [[1.0]], [[0.1]], [[0.0]], DT)
U = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
FOUND = Solution(
    delay=7,
    place=7.25,
    interval=(6, 9),
    theta=np.array([2.0, 0.0]),
    offset=0.5,
    gain_std=0.01,
    move_std=np.array([0.001]),
    speed_ratios=(1.0,),
    variance=0.04,
    sees_reply=True,
    reason="",
)


def tracker(**options):
    # 300 samples of memory: an estimate every six
    return cr.DelayTracker(CORE, **{"max_delay": 20, "memory": 3.0, **options})


def feed(one, samples, value=1.0):
    for _ in range(samples):
        one.update(value, 0.0)


@pytest.fixture
def by_hand(monkeypatch):
    """Solutions in turn, the last one from then on; what was asked stands in `asked`."""
    script = [FOUND]
    script_of = type("Script", (), {"turn": script, "asked": []})()

    def solve(now, variance, inflation):
        script_of.asked.append((now, variance, inflation))
        return script_of.turn.pop(0) if len(script_of.turn) > 1 else script_of.turn[0]

    monkeypatch.setattr(module, "solve", solve)
    return script_of


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


def test_an_estimate_is_made_fifty_times_in_a_memory(by_hand):
    one = tracker()
    feed(one, 60)
    # from 42 samples on: at 42, 48, 54 and 60
    assert len(by_hand.asked) == 4
    one.estimate()
    assert len(by_hand.asked) == 4  # known
    feed(one, 1)
    one.estimate()
    assert len(by_hand.asked) == 5
    quick = tracker(memory=0.25, max_delay=10)  # less than a sample
    feed(quick, 40)
    assert len(by_hand.asked) == 5 + 40 - 29


def test_what_was_solved_is_told_in_seconds(by_hand):
    one = tracker()
    feed(one, 48)
    now = one.estimate()
    assert (now.delay, now.interval, now.gain_ratio, now.gain_std) == (7, (6, 9), 2.0, 0.01)
    assert now.dead_time == pytest.approx(7.25 * DT)
    assert now.time == pytest.approx(47 * DT)
    assert (now.noise_std, now.tells, now.reason) == (pytest.approx(0.2), True, "")
    by_hand.turn = [replace(FOUND, reason="it rests")]
    feed(one, 6)
    assert (one.estimate().tells, one.estimate().reason) == (False, "it rests")


def test_the_noise_weighs_the_next_prior(by_hand):
    one = tracker()
    by_hand.turn = [FOUND, replace(FOUND, variance=0.09), FOUND]
    feed(one, 60)
    assert [variance for _, variance, _ in by_hand.asked] == [0.0, 0.04, 0.09, 0.04]


def test_the_residual_of_what_was_solved_says_how_many_samples_count_as_one(by_hand):
    one = tracker()
    feed(one, 42)
    u, y = np.random.default_rng(0).standard_normal((2, 12))
    for sample in zip(u, y, strict=True):
        one.update(*sample)
    # gain 2 behind 7 samples, of an input that has left its rest of 1; 0.5 is the offset
    reply = 2 * cr.DelayedStateSpace(CORE, 7).simulate(np.r_[np.zeros(42), u - 1])[42:]
    e = y - 0.5 - reply
    weight = np.exp(-np.arange(11, -1, -1) / 300)
    sums = e[:6].sum() ** 2 * np.exp(-6 / 300) + e[6:].sum() ** 2
    # sums of six samples each, a sum with the weight of its last one
    assert sums > weight @ e**2
    assert by_hand.asked[-1][2] == pytest.approx(sums / (weight @ e**2), rel=1e-9)


def test_an_interval_is_widened_by_the_way_of_one_memory(by_hand):
    one = tracker()
    places = 5 + 0.11 * np.arange(MOMENTS + 1)
    by_hand.turn = [replace(FOUND, place=p, interval=(int(p), int(p) + 1)) for p in places]
    feed(one, 36 + 6 * MOMENTS)  # the first six moments do not tell
    assert one.estimate().interval == (10, 11)
    feed(one, 6)
    # 50 moments ago it was 5.5 samples less
    assert one.estimate().interval == (10, 11 + 6)


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


def test_moments_that_do_not_tell_leave_no_trail(by_hand):
    one = tracker()
    by_hand.turn = [FOUND, replace(FOUND, reason="it rests"), replace(FOUND, place=8.0)]
    feed(one, 60)
    places = np.array(one._places)
    assert np.isnan(places[:6]).all()  # before anything was solved
    assert_allclose(places[6:], [7.25, np.nan, 8.0, 8.0])


def moved(by, std=0.001, **other):
    return replace(FOUND, theta=np.array([2.0, 2.0 * by]), move_std=np.array([std]), **other)


@pytest.mark.parametrize(
    ("found", "renewed"),
    [
        (moved(1.01 * MOVED), True),
        (moved(-1.01 * MOVED), True),
        (moved(0.99 * MOVED), False),
        (moved(0.2, std=0.0499), True),  # four deviations
        (moved(0.2, std=0.0501), False),
        (moved(0.2, sees_reply=False), False),
    ],
)
def test_a_pole_that_has_clearly_moved_starts_another_bank(by_hand, found, renewed):
    one = tracker()
    by_hand.turn = [found]
    feed(one, 42)
    assert (one._next is not None) == renewed


@pytest.mark.parametrize("by", [0.1, -0.1, 0.9, -0.9])
def test_the_other_bank_is_about_the_moved_pole_and_takes_over_after_two_memories(by_hand, by):
    step = np.clip(by, -LEAP, LEAP)
    one = tracker()
    first = one._now
    by_hand.turn = [moved(by)]
    feed(one, 42)
    fresh = one._next
    pole = fresh.core[0][0, 0]
    assert pole == pytest.approx(POLE ** np.exp(step), rel=1e-12)
    assert_allclose(fresh.moved, [step], rtol=1e-12)
    # settled to 1e-6, and the largest delay behind that
    settled = int(np.ceil(np.log(1e-6) / np.log(pole)))
    assert fresh.begin == 42 + settled + 20 + 1
    feed(one, fresh.begin - 43)
    assert fresh.bank.weight > 30
    feed(one, 1)
    assert fresh.bank.weight == 0.0  # counts from the next sample on
    assert (one._now, one._next) == (first, fresh)
    by_hand.turn = [FOUND]
    feed(one, 599)
    assert (one._now, one._next) == (first, fresh)
    feed(one, 1)
    assert (one._now, one._next) == (fresh, None)
    # the next move counts from there
    by_hand.turn = [moved(0.3)]
    feed(one, 6)
    assert_allclose(one._next.moved, [step + 0.3], rtol=1e-12)
    assert by_hand.asked[-1][0] is fresh


def test_what_was_solved_about_other_poles_is_no_longer_used(by_hand):
    one = tracker()
    by_hand.turn = [moved(0.1)]
    feed(one, 42)
    by_hand.turn = [FOUND]
    over = one._next.begin + 600
    assert over % 6  # between two estimates
    feed(one, over - 43)
    assert one._solution is FOUND
    feed(one, 1)
    assert one._solution is None


def test_the_model_has_gain_pole_and_delay_of_the_estimate(by_hand):
    one = tracker()
    by_hand.turn = [moved(0.03)]
    feed(one, 42)
    model = one.model
    assert model.delay == 7
    assert model.fit.dead_time == pytest.approx(7.25 * DT)
    assert model.dt == DT
    assert_allclose(model.delay_free.poles(), [POLE ** np.exp(0.03)], rtol=1e-12)
    # the starting model has the gain 0.1 / (1 - 0.9) = 1
    assert ct.dcgain(model) == pytest.approx(2.0, rel=1e-9)
    by_hand.turn = [replace(FOUND, theta=np.zeros(2))]
    feed(one, 6)
    assert not np.any(one.model.markov(30))


def test_the_model_of_an_integrating_plant_has_the_moved_lag_too(by_hand):
    core = ct.ss([[1.0, 0.1], [0.0, POLE]], [[0.0], [0.1]], [[1.0, 0.0]], [[0.0]], DT)
    one = cr.DelayTracker(core, max_delay=20, memory=3.0)
    by_hand.turn = [moved(0.03)]
    feed(one, 60)
    poles = np.sort(one.model.delay_free.poles().real)
    assert_allclose(poles, [POLE ** np.exp(0.03), 1.0], rtol=1e-12)


def test_a_direct_term_is_scaled_with_the_gain(by_hand):
    core = ct.ss([[POLE]], [[1.0]], [[0.1]], [[0.3]], DT)
    one = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, memory=3.0)
    feed(one, 42)
    assert_allclose(one.model.markov(9)[7:], [2 * 0.3, 2 * 0.1], rtol=1e-9)


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


def test_a_record_of_one_channel_and_the_model_s_sample_time_is_taken(by_hand):
    one = cr.Record(DT * (1 + 0.9e-3) * np.arange(50), U[:50], U[:50])
    track = tracker().run(one)
    # a moment every six samples
    assert_allclose(track.time, DT * (np.arange(6, 51, 6) - 1), rtol=0, atol=1e-12)
    assert_array_equal(track.tells, [False] * 6 + [True] * 2)
    rows = cr.Record(one.time, one.input[None], one.output[None])
    assert_array_equal(tracker().run(rows).dead_time, track.dead_time)
    with pytest.raises(DataError, match=r"the record has the sample time 0\.010011 s, the model"):
        tracker().run(cr.Record(DT * (1 + 1.1e-3) * np.arange(50), U[:50], U[:50]))
    fast = cr.DelayTracker(ct.ss(CORE.A, CORE.B, CORE.C, CORE.D, 1e-9), max_delay=9, memory=1e-6)
    with pytest.raises(DataError, match="sample time 2e-09 s, the model 1e-09 s"):
        fast.run(cr.Record(2e-9 * np.arange(50), U[:50], U[:50]))
    with pytest.raises(DataError, match="several channels"):
        tracker().run(cr.Record(one.time, np.stack([U[:50], U[:50]]), U[:50]))
    with pytest.raises(DataError, match="5 samples, fewer than the 6 between"):
        tracker().run(cr.Record(DT * np.arange(5), U[:5], U[:5]))
    holes = cr.Record(DT * np.arange(9), U[:9], np.r_[np.nan, U[:8]], missing="keep")
    with pytest.raises(DataError, match=r"DelayTracker\.run needs every sample"):
        tracker().run(holes)


def test_without_dynamics_no_pole_moves(by_hand):
    one = tracker(dynamics=False)
    by_hand.turn = [replace(FOUND, theta=np.array([2.0]), move_std=np.array([]))]
    feed(one, 60)
    assert one._next is None
    assert_allclose(one.model.delay_free.poles(), [POLE])
