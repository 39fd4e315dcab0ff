import pickle

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import OptionError, UnsuitableSystemError
from tests import measured
from tests.rigs import R3, TS, lag, pair


def worn_valve(*, seconds=40.0, noise=0.005, seed=0, gain=1.0, last=60.0):
    """Simulate a valve whose dead time wears from 37 samples to `last`; return record and truth.

    Input: a new level every 0.4 s. Noise: part of the 16 mA span.
    """
    rng = np.random.default_rng(seed)
    k = np.arange(int(seconds / TS))
    u = 4 + 4 * np.repeat(rng.integers(0, 5, k.size // 512 + 1), 512)[: k.size]
    worn = np.clip((k / k.size - 0.3) / 0.4, 0, 1)
    delay = 37 + (last - 37) * worn
    free = cr.delayed_ss(R3, delay=0, dt=TS).simulate(u - u[0])
    y = np.interp(k - delay, k, free, left=0.0) * (1 + (gain - 1) * worn)
    return cr.Record(k * TS, u, 0.3 + y + noise * 16 * rng.standard_normal(k.size)), delay


def tracker(model=R3, **options):
    settings = {"max_delay": 90, "forgetting_time": 2.5, **options}
    return cr.DelayTracker(cr.delayed_ss(model, delay=37, dt=TS), **settings)


def test_a_dead_time_that_wears_from_37_to_60_samples_is_followed():
    record, truth = worn_valve(seconds=60)
    track = tracker().track(record)
    told = track.resolved
    assert np.mean(told) > 0.95
    # The estimate is one memory behind: compared with the delay of then. Within a memory the
    # delay wears by 2 samples, and averages over that are known to a third or so.
    then = np.interp(track.time - 2.5, record.time, truth)
    assert np.sqrt(np.mean((track.delay - then)[told] ** 2)) < 1.0
    now = np.interp(track.time, record.time, truth)
    inside = (track.low / track.dt - 0.5 <= now) & (now <= track.high / track.dt + 0.5)
    # not when the wear sets in: the samples of the memory do not know of it yet
    assert np.mean(inside[told]) > 0.85
    assert abs(track.delay[-1] - 60) < 0.6


def test_a_delay_at_rest_is_known_as_well_as_weighted_samples_can_tell_it():
    errors, limits = [], []
    for seed in range(4):
        record, _ = worn_valve(seconds=10, last=37.0, seed=seed)
        bank = tracker(dynamics=False)
        bank.track(record)
        last = bank.estimate()
        assert last.delay_interval[0] <= 37 <= last.delay_interval[1]
        errors.append(last.dead_time / TS - 37)
        # bound of any linear estimate from samples of these weights: delay, gain and offset free
        k, moved = np.arange(record.n_samples), record.input - record.input[0]
        weight = np.exp(-(k[-1] - k) * TS / 2.5)
        early, here, late = (
            cr.delayed_ss(R3, dead_time=d * TS, dt=TS).simulate(moved) for d in (36.95, 37, 37.05)
        )
        slopes = np.column_stack([(late - early) / 0.1, here, np.ones(k.size)])
        inverse = np.linalg.inv(slopes.T @ (weight[:, None] * slopes))
        spread = slopes.T @ (weight[:, None] ** 2 * slopes)
        limits.append(0.08 * np.sqrt((inverse @ spread @ inverse)[0, 0]))
    # chi-square of four: 18.5 is exceeded once in 1000
    assert np.sum((np.array(errors) / limits) ** 2) < 18.5
    assert np.mean(limits) < 0.05  # samples


def test_a_model_with_part_of_a_sample_of_dead_time_tracks_the_whole_dead_time():
    u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 150), 10)
    y = cr.delayed_ss(ct.tf([2.0], [8.0, 1.0]), dead_time=5.3, dt=1.0).simulate(u)
    y = y + 0.02 * np.random.default_rng(1).standard_normal(u.size)
    record = cr.Record(np.arange(u.size) * 1.0, u, y)
    model = cr.identify(record[0:999], structures="FOPDT")
    assert model.fit.dead_time == pytest.approx(5.3, abs=0.1)
    track = cr.DelayTracker(model, max_delay=20, forgetting_time=300.0).track(record)
    assert np.median(track.dead_time) == pytest.approx(5.3, abs=0.3)  # parabola through samples
    told = track.resolved
    assert np.mean((track.low[told] <= 5.3) & (track.high[told] >= 5.3)) > 0.95


def test_gain_is_followed_with_the_delay():
    record, _ = worn_valve(seconds=25, gain=0.8)
    bank = tracker()
    track = bank.track(record)
    assert abs(track.gain_ratio[10] - 1.0) < 0.02
    last = bank.estimate()
    assert abs(last.gain_ratio - 0.8) < max(4 * last.gain_std, 0.005)
    assert abs(ct.dcgain(bank.model) - 0.8 * ct.dcgain(R3)) < 0.01
    assert bank.model.delay == last.delay
    assert bank.model.fit.delay == last.delay


def test_a_model_that_is_off_is_renewed_until_poles_and_delay_are_right():
    record, truth = worn_valve(seconds=30, last=50.0)
    bank = tracker(lag(2.5) * pair(7.0, 0.6))
    track = bank.track(record)
    last = bank.estimate()
    ratios = np.sort(last.pole_speed_ratios)
    # 2.2 Hz against 2.5 Hz, and 8 Hz against 7 Hz: the pair is known to 2 % from 2.5 s
    assert abs(ratios[0] - 2.2 / 2.5) < 0.02
    assert abs(ratios[1] - 8.0 / 7.0) < 0.05
    assert abs(last.delay - 50) <= 1
    now = np.interp(track.time, record.time, truth)
    inside = (track.low / track.dt - 0.5 <= now) & (now <= track.high / track.dt + 0.5)
    assert np.mean(inside[track.resolved]) > 0.9
    pulse = cr.delayed_ss(R3, delay=0, dt=TS).markov(1000)
    found = cr.DelayedStateSpace(bank.model.delay_free).markov(1000)
    assert np.abs(found - pulse).max() < 0.04 * pulse.max()


def test_an_input_that_rests_does_not_tell():
    record, _ = worn_valve(seconds=5, last=37.0)
    bank = tracker(forgetting_time=1.0)
    bank.track(record)
    assert bank.estimate().resolved
    rest_y = float(record.output[-400:].mean())
    rng = np.random.default_rng(1)
    for noise in 0.08 * rng.standard_normal(8 * 1280):
        bank.update(record.input[-1], rest_y + noise)
    last = bank.estimate()
    assert not last.resolved
    assert "no movement above the noise" in last.reason
    assert "no: no movement" in last.report()


def test_a_tracker_goes_on_after_pickling_as_if_nothing_had_happened():
    record, _ = worn_valve(seconds=4, last=37.0)
    one = tracker(forgetting_time=1.0)
    samples = list(zip(record.input, record.output, strict=True))
    for sample in samples[:3000]:
        one.update(*sample)
    other = pickle.loads(pickle.dumps(one))
    for bank in (one, other):
        for sample in samples[3000:]:
            bank.update(*sample)
    assert other.estimate().dead_time == one.estimate().dead_time
    assert repr(other) == repr(one)
    assert f"{record.n_samples} samples" in repr(one)


def operated(plant, *, seconds, seed, noise=0.005, walk=0.0):
    """Simulate any plant of the bench's sample time; `walk` is per sample, part of the span."""
    rng = np.random.default_rng(seed)
    k = np.arange(int(seconds / TS))
    u = 4 + 4 * np.repeat(rng.integers(0, 5, k.size // 512 + 1), 512)[: k.size]
    noisy = noise * rng.standard_normal(k.size) + walk * np.cumsum(rng.standard_normal(k.size))
    return cr.Record(k * TS, u, plant.simulate(u - u[0]) + 16 * noisy)


def wrong(track, delay):
    """Moments at which an interval is told that does not hold the delay."""
    held = (track.low / track.dt - 0.5 <= delay) & (delay <= track.high / track.dt + 0.5)
    return int(np.sum(track.resolved & ~held))


def test_a_track_that_is_lost_is_said_and_found_again_after_a_reset():
    """All poles of the plant become half as fast at once."""
    slow = cr.delayed_ss(lag(1.1) * pair(4.0, 0.7), delay=37, dt=TS)
    before = operated(cr.delayed_ss(R3, delay=37, dt=TS), seconds=6, seed=0)
    after = operated(slow, seconds=12, seed=1)
    bank = tracker()
    assert not bank.track(before).lost[-1]
    assert bank.estimate().resolved
    track = bank.track(after)
    assert wrong(track, 37) == 0
    assert track.lost.any()
    assert "track lost at" in track.report()
    bank = pickle.loads(pickle.dumps(bank))
    # A second look at the plant gives a new model, here with poles 10 % off.
    bank.reset(cr.delayed_ss(lag(1.0) * pair(4.4, 0.7), delay=0, dt=TS))
    assert bank.estimate().reason == "no samples yet"
    found = bank.track(operated(slow, seconds=10, seed=2))
    assert wrong(found, 37) == 0
    assert bank.estimate().resolved
    assert abs(bank.estimate().delay - 37) <= 2
    with pytest.raises(UnsuitableSystemError, match="sample time"):
        bank.reset(cr.delayed_ss(R3, delay=0, dt=2 * TS))


def test_the_noise_of_a_fitted_model_is_known():
    plant = cr.delayed_ss(R3, delay=37, dt=TS)
    first = tracker(dynamics=False)
    first.track(operated(plant, seconds=6, seed=0))
    louder = operated(plant, seconds=6, seed=1, noise=0.02)  # four times
    known = cr.DelayTracker(first.model, max_delay=90, forgetting_time=2.5, dynamics=False)
    known.track(louder)
    assert known.estimate().lost
    assert "4" in known.estimate().reason


@pytest.mark.parametrize("seed", [0, 1])
def test_a_dead_time_under_a_random_walk_is_followed_behind_a_high_pass(seed):
    plant = cr.delayed_ss(R3, delay=45, dt=TS)
    record = operated(plant, seconds=12, seed=seed, walk=0.0005)
    passed = tracker(dynamics=False, drift_time=0.1)
    track = passed.track(record)
    late = track.time > 5
    assert np.mean(track.resolved[late]) > 0.9
    assert wrong(track, 45) <= 0.1 * np.sum(track.resolved)
    assert abs(passed.estimate().delay - 45) <= 3


@pytest.mark.parametrize("known", [True, False])
def test_a_residual_much_louder_than_the_models_stops_it_from_telling(known):
    """From 8 s on the output takes in a wave that the input does not explain."""
    record = operated(cr.delayed_ss(R3, delay=37, dt=TS), seconds=16, seed=0)
    loud = tracker(dynamics=False, noise_std=0.08 if known else None)
    wave = 5 * 0.08 * 2**0.5 * np.sin(2 * np.pi * 0.7 * record.time) * (record.time > 8)
    track = loud.track(cr.Record(record.time, record.input, record.output + wave))
    assert np.all(track.resolved[(track.time > 4) & (track.time < 8)])
    last = loud.estimate()
    assert (last.resolved, last.lost) == (False, True)
    assert "the track is lost" in last.report()
    with pytest.raises(OptionError, match="noise_std"):
        tracker(noise_std=-1.0)


def test_the_exchanger_keeps_its_delay_of_zero():
    record = measured.record("exchanger/record")
    first = cr.impulse_from_io(record.between(0, 1500), 200)
    model = cr.realize(first, 3, feedthrough=True)
    track = cr.DelayTracker(model, max_delay=20, forgetting_time=300.0).track(record)
    # the plant is not linear, and at times a pole of the third order moves too far
    assert np.mean(track.resolved) > 0.6
    assert np.all(track.dead_time[track.resolved] <= 1.0)  # s, one sample


@pytest.mark.parametrize("dynamics", [True, False])
@pytest.mark.parametrize("delay", [12.2, 12.8])
def test_a_dead_time_between_two_samples_is_within_its_interval(delay, dynamics):
    rng, dt = np.random.default_rng(0), 0.1
    lags = ct.tf([3.0], [2.0, 1]) * ct.tf([1.0], [0.7, 1])
    u = np.repeat(rng.choice([-1.0, 1.0], 75), 40)
    y = cr.delayed_ss(lags, dead_time=delay * dt, dt=dt).simulate(u)
    y += 0.06 * rng.standard_normal(u.size)
    start = cr.delayed_ss(lags, delay=12, dt=dt)
    found = cr.DelayTracker(start, max_delay=40, forgetting_time=30.0, dynamics=dynamics)
    track = found.track(cr.Record(dt * np.arange(u.size), u, y))
    settled = track.time > 60  # two forgetting times
    told = track.resolved & settled
    inside = (track.low <= delay * dt) & (delay * dt <= track.high)
    # an interval of 95 %; whole delays alone left it outside for 4 to 45 % of the time
    assert np.mean(told[settled]) > 0.95
    assert np.mean(inside[told]) > 0.95
