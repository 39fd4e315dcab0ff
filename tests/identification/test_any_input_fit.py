"""What is made of fits of records with any input, with fits that are written by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification import any_input_fit
from ctrl_realize.identification.any_input_fit import (
    FOLLOWS,
    LEAST_MOVE,
    _gain_flags,
    _gain_outliers,
    fit_any_input,
)
from ctrl_realize.numerics.output_error_result import OutputErrorFit
from ctrl_realize.numerics.sampled_data import MOST_SAMPLES, cut
from ctrl_realize.numerics.sampled_fit import OwnDelay, SampledFit
from ctrl_realize.numerics.separable_fit import KnownFactor, Structure

DT = 0.1
DELAY = np.linspace(0.9, 1.1, 21)
FIT = OutputErrorFit(
    delay=1.0,
    low=0.99,
    high=1.01,
    std=0.005,
    structure=Structure(1, 1),
    poles=np.array([-1.0 + 0j]),
    numerator=np.array([1.0]),
    adequate=True,
    misfit=1.0,
    residual=0.01,
    correlation=1.0,
    structures=(),
    views=(),
    fitted=np.zeros(0),
    profile=(DELAY, ((DELAY - 1.0) / 0.005) ** 2),
    latest=5.0,
)


def record(number, samples=200, name="", start=0.0, moves=1.0):
    """A record whose first output is its number."""
    u = moves * np.sin(np.arange(samples))
    return cr.Record(start + DT * np.arange(samples), u, number + 0.5 * (u - u[0]), name=name)


def own(shift=0.0, gain=1.0, error=0.01, gain_error=0.01):
    return OwnDelay(shift, error, gain, gain_error)


@pytest.fixture
def by_hand(monkeypatch):
    """Fits of all records together that find `FIT`; what each record says stands in `own`."""

    class Fits(list):
        def __init__(self):
            self.own, self.explained, self.starts = {}, 1000.0, (20, 30, 40, 50, 60)
            self.asked = []

    fits = Fits()

    class Found(SampledFit):
        def own_delay(self, output, signal):
            assert output.shape == signal.shape
            return fits.own.get(int(output[0]), own())

    def fit_sampled(outputs, inputs, dt, **ways):
        fits.append([int(y[0]) for y in outputs])
        fits.asked.append((dt, ways))
        data = replace(cut(outputs, inputs, dt), starts=fits.starts[: len(outputs)])
        fitted = tuple(y[s:] + 1 for y, s in zip(data.outputs, data.starts, strict=True))
        return Found(FIT, data, fitted, fits.explained, KnownFactor())

    monkeypatch.setattr(any_input_fit, "fit_sampled", fit_sampled)
    return fits


def codes(fit):
    return [flag.code for flag in fit.flags]


def test_one_record_is_fitted_as_it_is(by_hand):
    one = record(7)
    result, fit = fit_any_input((one,), None, {"huber": False, "whiten": True})
    assert fit is FIT
    assert by_hand == [[7]]
    assert by_hand.asked == [(one.dt, {"latest": None, "huber": False})]
    assert result.records == (one,)
    assert result.repeatability is None
    assert codes(result) == []
    # from the first sample on whose input is known
    assert_array_equal(result.time, one.time[20:])
    assert_array_equal(result.measured, one.output[20:])
    assert_array_equal(result.fitted, one.output[20:] + 1)
    assert (result.dead_time, result.noise, result.dt) == (1.0, 0.01, one.dt)


def test_a_largest_delay_is_given_in_s_and_flagged_in_samples(by_hand):
    result, _ = fit_any_input((record(0),), 50, {})
    assert by_hand.asked[0][1]["latest"] == pytest.approx(5.0)
    assert codes(result) == []
    by_hand.clear()
    at_end = replace(FIT, high=5.0)
    result = any_input_fit._summary(
        any_input_fit._fit((record(0),), DT, None, {}), at_end, (record(0),), (0,), 50, ()
    )
    assert "delay_at_bound" in codes(result)


def test_records_are_laid_out_one_after_the_other(by_hand):
    records = (record(0), record(1, samples=100, start=1000.0), record(2, start=-5.0))
    result, fit = fit_any_input(records, None, {})
    # from samples 20, 30 and 40 of each; a sample time lies between the pieces
    assert_allclose(result.time, 2.0 + DT * np.arange(180 + 70 + 160), rtol=0, atol=1e-9)
    measured = np.concatenate([r.output[s:] for r, s in zip(records, (20, 30, 40), strict=True)])
    assert_array_equal(result.measured, measured)
    assert_array_equal(result.fitted, measured + 1)
    assert result.records == records
    assert fit.std == FIT.std  # they agree
    assert_allclose(result.repeatability.delays, 1.0)


def test_the_longest_record_tells_whether_a_lag_has_settled(by_hand):
    # a lag of 1 s has not settled within 1.9 s of record; within 20 s it has
    by_hand.starts = (5, 5)
    assert codes(fit_any_input((record(0, samples=19),), None, {})[0]) == ["not_settled"]
    assert codes(fit_any_input((record(0, samples=19), record(1)), None, {})[0]) == []


@pytest.mark.parametrize("apart", [own(shift=0.2), own(gain=1.5)])
def test_a_record_that_lies_apart_is_left_out_and_named(by_hand, apart):
    by_hand.own = {2: apart}
    records = tuple(record(k, name="abcd"[k]) for k in range(4))
    result, _ = fit_any_input(records, None, {})
    assert by_hand == [[0, 1, 2, 3], [0, 1, 3]]
    assert codes(result) == ["outlying_records"]
    repeats = result.repeatability
    assert repeats.names == ("a", "b", "c", "d")
    assert repeats.outlying == ("c",)
    assert_allclose(repeats.delays, [1.0, 1.0, 1.0 + apart.shift, 1.0])
    assert_allclose(repeats.gains, [1.0, 1.0, apart.gain, 1.0])
    assert_allclose(repeats.errors, 0.01)
    assert result.measured.size == 180 + 170 + 160
    assert result.records == records  # what was given


def test_a_record_that_lies_apart_from_what_is_left_is_left_out_as_well(by_hand):
    # 0.18 s lies 0.15 s from the median of all, of a scatter of 0.06 s; without the largest one
    # 0.16 s, of a scatter of 0.03 s
    by_hand.own = {k: own(shift=s) for k, s in enumerate((-0.02, 0.0, 0.02, 0.04, 0.18, 0.9))}
    by_hand.starts = (20,) * 6
    result, _ = fit_any_input(tuple(record(k, name=f"r{k}") for k in range(6)), None, {})
    assert by_hand == [[0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4], [0, 1, 2, 3]]
    assert result.repeatability.outlying == ("r4", "r5")
    assert result.measured.size == 4 * 180


def test_records_that_differ_widen_the_interval(by_hand):
    by_hand.own = {k: own(shift=s) for k, s in enumerate((-0.04, 0.0, 0.04))}
    result, fit = fit_any_input(tuple(record(k) for k in range(3)), None, {})
    scatter = 0.04 / np.sqrt(3)  # of the mean of three
    assert_allclose(result.interval, [0.99 - 1.96 * scatter, 1.01 + 1.96 * scatter], rtol=1e-9)
    assert (fit.low, fit.high) == result.interval
    assert codes(result) == ["records_differ"]
    assert result.repeatability.names == ("record 0", "record 1", "record 2")


def test_delays_are_compared_over_the_range_of_the_input(by_hand):
    by_hand.own = {k: own(shift=0.1 * k) for k in range(4)}
    records = tuple(record(k, moves=1.0 + k) for k in range(4))
    repeats = fit_any_input(records, None, {})[0].repeatability
    assert_allclose(repeats.amplitudes, [np.ptp(r.input) for r in records])
    assert_allclose(repeats.trend, 0.1 / np.ptp(records[0].input), rtol=1e-9)


def test_an_output_that_does_not_follow_is_refused_with_its_name(by_hand):
    by_hand.explained = FOLLOWS * 0.999
    with pytest.raises(DataError, match="record 'day': the output does not follow the input"):
        fit_any_input((record(0, name="day"),), None, {})
    with pytest.raises(DataError, match="2 records: the output does not follow"):
        fit_any_input((record(0), record(1)), None, {})
    by_hand.explained = FOLLOWS
    assert fit_any_input((record(0),), None, {})[1] is FIT


@pytest.mark.parametrize("what", ["output", "input"])
def test_what_stands_still_where_it_is_fitted_is_refused(by_hand, what):
    n = MOST_SAMPLES + 10
    for moves, refused in ((0.5 * LEAST_MOVE, True), (2 * LEAST_MOVE, False)):
        still = moves * (np.arange(n) % 2)
        still[MOST_SAMPLES:] = 5.0  # what comes later is not fitted
        u, y = (np.arange(n), still) if what == "output" else (still, np.arange(n))
        one = cr.Record(DT * np.arange(n), u, y)
        if refused:
            with pytest.raises(DataError, match=f"the {what} of .* there is nothing to fit"):
                fit_any_input((one,), None, {})
        else:
            assert fit_any_input((one,), None, {})[1] is FIT


def test_long_records_are_cut_and_say_so(by_hand):
    whole, long = record(0, samples=MOST_SAMPLES), record(1, samples=MOST_SAMPLES + 1)
    assert codes(fit_any_input((whole,), None, {})[0]) == []
    result, _ = fit_any_input((long,), None, {})
    assert codes(result) == ["cut"]
    assert f"longer than {MOST_SAMPLES} samples" in result.flags[0].message
    assert result.time.size == MOST_SAMPLES - 20
    assert codes(fit_any_input((whole, long), None, {})[0]) == ["cut"]


def test_records_of_another_sample_time_are_refused(by_hand):
    other = cr.Record(2 * DT * np.arange(50), np.sin(np.arange(50)), np.arange(50.0))
    with pytest.raises(DataError, match="one sample time"):
        fit_any_input((record(0), other), None, {})


def test_gains_that_scatter_by_more_than_their_noise_are_flagged():
    # of two with the errors e, the chi-square is (difference / e)^2 / 2; 6.635 is once in a hundred
    apart = 0.02 * np.sqrt(2 * 6.635)
    for factor, told in ((0.999, 0), (1.001, 1)):
        both = [own(gain=1.0, gain_error=0.02), own(gain=1 + factor * apart, gain_error=0.02)]
        assert len(_gain_flags(both, (0, 1))) == told
    # of three whose squares weigh 4 : 4 : 1 about their mean of 1: 4 + 4 + 64, and e^-36 in two
    # degrees of freedom
    three = [own(gain=g, gain_error=e) for g, e in ((0.0, 0.5), (0.0, 0.5), (9.0, 1.0))]
    (flag,) = _gain_flags(three, (0, 1, 2))
    assert "0 to 9 times the common one (chi-square 72, p = 2.3e-16)" in flag.message
    # a record that was left out does not count
    assert _gain_flags(three, (0, 1)) == ()
    assert _gain_flags(three, (2,)) == ()


def test_a_gain_apart_is_five_deviations_from_the_middle():
    gains = [1.0, 1.01, 0.99, 2.0]
    few = [own(gain=g, gain_error=0.1) for g in gains]
    assert _gain_outliers(few, (0, 1, 2, 3)) == (3,)
    assert _gain_outliers(few, (0, 1, 2)) == ()
    # by its own error, or by the scatter of all, whichever is larger
    assert _gain_outliers([*few[:3], own(gain=2.0, gain_error=0.2)], (0, 1, 2, 3)) == ()
    wide = [own(gain=g, gain_error=0.01) for g in (0.8, 1.0, 1.2, 2.0)]
    assert _gain_outliers(wide, (0, 1, 2, 3)) == ()
    assert _gain_outliers(
        [own(gain=g, gain_error=1e-3) for g in (1.0, 1.0, 1.0, 0.9)], (1, 2, 3)
    ) == (3,)
