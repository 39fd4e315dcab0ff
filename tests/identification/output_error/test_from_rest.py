"""Records of any input that begin at rest, against the closed forms they were made from."""

import numpy as np
import pytest

import ctrl_realize as cr


def moved(times, moves, response):
    """Sum of the responses to moves (time, size) of the input."""
    return sum(size * response(np.clip(times - at, 0, None)) for at, size in moves)


def lag_of(gain, lag, dead_time):
    return lambda t: -gain * np.expm1(-np.clip(t - dead_time, 0, None) / lag)


def record_of(moves, response, *, samples=600, noise=0.01, drift=0.0, seed=0):
    """Record with noise, and a drift, in parts of the range of the response."""
    time = np.arange(float(samples))
    y = moved(time, moves, response)
    rng = np.random.default_rng(seed)
    y += np.ptp(y) * (drift * time / samples + noise * rng.standard_normal(samples))
    return cr.Record(time, 50 + moved(time, moves, lambda t: t > 0), 300 + y)


def binary(seed, hold, first=40, last=600):
    """Moves between two levels, from rest at the middle of them."""
    levels = np.random.default_rng(seed).choice([-1.0, 1.0], (last - first) // hold)
    times = first + hold * np.arange(levels.size) - 1e-9  # the sample itself has moved
    return list(zip(times, np.diff(levels, prepend=0.0), strict=True))


def holds(ends, value):
    return ends[0] <= value <= ends[1]


UP, UP_AND_DOWN = (1, 1, 1), (1, 1, -1)


@pytest.mark.parametrize(
    ("dead_time", "lag", "sizes", "structures"),
    [
        (110.0, 6.0, UP, None),
        (110.0, 6.0, UP_AND_DOWN, None),
        (110.0, 6.0, UP_AND_DOWN, "FOPDT"),
        (165.0, 20.0, UP, None),
        (165.0, 20.0, UP, "FOPDT"),
    ],
)
def test_a_dead_time_of_half_a_stair_and_more_is_found(dead_time, lag, sizes, structures):
    # beside a free response and a drift stairs up had a gain of the wrong sign, -11 for 20, and
    # those up and down a dead time that was short by a tenth
    moves = [(29.999 + 200 * i, size) for i, size in enumerate(sizes)]
    record = record_of(moves, lag_of(20, lag, dead_time), noise=0.005, seed=2)
    fit = cr.identify(record, structures=structures).fit
    assert holds(fit.interval, dead_time)
    assert holds(fit.gain_interval, 20)
    assert fit.dead_time == pytest.approx(dead_time, abs=1)  # a sample
    assert fit.gain == pytest.approx(20, rel=0.005)  # half the width of the interval is 0.0012


def test_a_search_with_a_motion_begins_at_the_level_at_which_the_input_rests():
    # by chance this noise has evidence for a motion; from the mean of the input, a step before the
    # record, the search ended at a gain of -9
    moves = [(at - 0.001, 1) for at in (30, 230, 430)]
    fit = cr.identify(record_of(moves, lag_of(20, 20, 140.0), noise=0.005, seed=9)).fit
    assert holds(fit.interval, 140)
    assert holds(fit.gain_interval, 20)


def test_an_integrator_behind_a_binary_input_has_its_slope():
    # a lag of 15 to 100 records, in whose free response and drift the slope was lost
    slope, lag, dead_time = 0.04, 12.0, 6.3

    def response(t):
        since = np.clip(t - dead_time, 0, None)
        return slope * (since + lag * np.expm1(-since / lag))

    fit = cr.identify(record_of(binary(2, 11), response, seed=2)).fit
    assert fit.integrators == 1
    assert holds(fit.gain_interval, slope)
    assert fit.gain == pytest.approx(slope, rel=0.01)  # half the width of the interval is 0.005
    assert holds(fit.interval, dead_time)


def test_a_drift_is_no_part_of_a_plant_at_rest():
    record = record_of(binary(4, 17), lag_of(2, 25, 9.4), drift=-0.3, noise=0.02)
    fit = cr.identify(record).fit
    assert "fitted from rest" not in " ".join(fit.choices)
    assert holds(fit.gain_interval, 2)
    assert holds(fit.interval, 9.4)
    assert fit.gain == pytest.approx(2, rel=0.02)  # half the width of the interval is 0.01


def test_a_motion_from_before_the_record_is_seen_though_the_input_rests():
    # the input has moved 10 samples before the record, and rests for 40 of it
    whole = record_of(
        [(49.999, 3.0), *binary(5, 17, first=100, last=660)], lag_of(2, 30, 9.4), samples=660
    )
    record = cr.Record(whole.time[60:], np.ravel(whole.input)[60:], np.ravel(whole.output)[60:])
    fit = cr.identify(record).fit
    assert "fitted from rest" not in " ".join(fit.choices)
    assert holds(fit.gain_interval, 2)
    assert fit.dead_time == pytest.approx(9.4, abs=0.5)  # half a sample


def test_the_interval_of_an_integrator_at_rest_does_not_depend_on_units():
    # the free response of the integrator, of 1e-321, was fitted: 0.43 to 1.41 s became 0.57 to 1.29
    rng = np.random.default_rng(3)
    time = 0.1 * np.arange(300)

    def response(t):
        since = np.clip(t - 0.9, 0, None)
        return 0.5 * (since + 0.8 * np.expm1(-since / 0.8))

    y = response(time - 5.0) - response(time - 8.7) + 0.05 * rng.standard_normal(time.size)
    pulse = ((time > 4.95) & (time < 8.65)).astype(float)
    here, *others = (cr.identify(cr.Record(time, k * pulse, y)).fit for k in (1, 1e3, -1e-9))
    assert "fitted from rest" in " ".join(here.choices)
    for there in others:  # ends are rounded outwards, to a hundredth of the width
        assert there.interval == pytest.approx(here.interval, abs=0.02 * np.ptp(here.interval))
