"""What each way of seeing a delay is asked, and what becomes of its answer, by hand."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError, OrderError
from ctrl_realize.identification import cross_check
from ctrl_realize.identification.cross_check import NO_LEVEL
from ctrl_realize.results import Flag

DT = 0.125  # a power of two: times are exact


def record(n=400):
    time = DT * np.arange(n)
    return cr.Record(time, time > 5, 2.0 * (time > 6))


@pytest.fixture
def ways(monkeypatch):
    """A fit of 0.5 s, total 1.2 s, a scan of 4 samples in 3 to 6, and an onset at lag 5."""
    set_up = SimpleNamespace(
        asked=[],
        fit=SimpleNamespace(
            dead_time=0.5, interval=(0.4, 0.6), onset=0.7, total_delay=1.2, order=2
        ),
        scan=SimpleNamespace(delay=4, interval=(3, 6), flags=()),
        impulse=SimpleNamespace(n_samples=1000),
        onset=5,
    )

    def answer(of):
        if isinstance(of, Exception):
            raise of
        return of

    def fit_delay(given):
        assert given.n_samples == set_up.n
        return SimpleNamespace(fit=answer(set_up.fit))

    def impulse_from_io(given, length):
        assert given.n_samples == set_up.n
        set_up.asked.append(("any input", length))
        return set_up.impulse

    def impulse_from_step(step):
        set_up.asked.append(("step", step))
        return set_up.impulse

    def estimate_delay(impulse, order, *, max_delay):
        assert impulse is set_up.impulse
        set_up.asked.append(("scan", order, max_delay))
        return SimpleNamespace(fit=answer(set_up.scan))

    def correlation_onset(signal, output, lags, level):
        assert signal.shape == output.shape == (set_up.n,)
        assert (signal.max(), output.max()) == (1.0, 2.0)
        set_up.asked.append(("correlation", lags, level))
        return SimpleNamespace(onset=set_up.onset)

    set_up.n = 400
    monkeypatch.setattr(cross_check, "fit_delay", fit_delay)
    monkeypatch.setattr(cross_check, "unit_step", lambda given: f"step of {given.n_samples}")
    monkeypatch.setattr(cross_check, "impulse_from_io", impulse_from_io)
    monkeypatch.setattr(cross_check, "impulse_from_step", impulse_from_step)
    monkeypatch.setattr(cross_check, "estimate_delay", estimate_delay)
    monkeypatch.setattr(cross_check, "correlation_onset", correlation_onset)
    return set_up


def seen(check):
    return [(v.method, v.source, v.kind, v.value, v.low, v.high, v.doubt) for v in check.views]


FIT = ("output error", "record", "dead time", 0.5, 0.4, 0.6, "")
# a sample to both sides, for the part of a sample that a scan cannot see
SCAN = ("scan", "record", "dead time", 4 * DT, 2 * DT, 7 * DT, NO_LEVEL)


def test_a_step_is_seen_by_fit_first_motion_and_scan(ways):
    check = cr.check_delay(record())
    motion = ("first motion", "record", "upper bound", 0.7, 0.0, 0.7 + DT, "")
    assert seen(check) == [FIT, motion, SCAN]
    # 1.2 s are ten samples, and ten more
    assert ways.asked == [("step", "step of 400"), ("scan", 2, 20)]
    assert (check.agree, check.common, check.conflicts) == (True, (0.4, 0.6), ())
    assert (check.dt, check.flags) == (DT, ())


def test_a_first_motion_before_the_step_is_one_at_the_step(ways):
    ways.fit.onset = -0.3
    assert seen(cr.check_delay(record()))[1][3:6] == (0.0, 0.0, DT)


def test_any_other_input_is_seen_by_its_correlation_too(ways):
    ways.fit.onset = float("nan")
    correlation = ("cross-correlation", "record", "upper bound", 5 * DT, 0.0, 5 * DT, "")
    assert seen(cr.check_delay(record())) == [FIT, SCAN, correlation]
    # six times the total are 58 samples, and 20 more behind the largest delay; a quarter of the
    # record is 100
    assert ways.asked == [("any input", 98), ("scan", 2, 20), ("correlation", 20, 0.99)]
    ways.n = 240
    cr.check_delay(record(240))
    assert ways.asked[3:5] == [("any input", 60), ("scan", 2, 20)]
    ways.asked.clear()
    ways.n = 4000
    cr.check_delay(record(4000), order=20)
    assert ways.asked[:2] == [("any input", 180), ("scan", 20, 20)]  # eight times the order


def test_an_onset_at_lag_zero_is_one_and_none_is_told(ways):
    ways.fit.onset = float("nan")
    ways.onset = 0
    assert seen(cr.check_delay(record()))[2][3:6] == (0.0, 0.0, 0.0)
    ways.onset = -1
    check = cr.check_delay(record())
    assert seen(check) == [FIT, SCAN]
    assert [(f.code, f.message) for f in check.flags] == [
        ("no_correlation", "cross-correlation: nothing stands out up to lag 20")
    ]


@pytest.mark.parametrize(
    ("most", "n", "lags"), [(0, 400, 20), (30, 400, 30), (5000, 400, 100), (5000, 8000, 1000)]
)
def test_a_correlation_is_looked_at_up_to_the_largest_delay_within_reason(ways, most, n, lags):
    ways.fit.onset = float("nan")
    ways.n = n
    cr.check_delay(record(n), max_delay=most)
    assert ways.asked[-1] == ("correlation", lags, 0.99)
    assert ways.asked[1] == ("scan", 2, min(most, 500))  # half of what there is of a response


def test_order_and_largest_delay_of_the_scan_are_those_of_the_fit_or_as_given(ways):
    ways.fit.order = 5
    ways.fit.total_delay = 0.1  # leads; the dead time of 0.5 s is four samples
    cr.check_delay(record())
    cr.check_delay(record(), max_delay=7, order=1)
    assert ways.asked[1::2] == [("scan", 3, 14), ("scan", 1, 7)]


def test_without_a_fit_a_tenth_of_the_record_is_scanned_with_order_two(ways):
    ways.fit = DataError("no fit")
    check = cr.check_delay(record())
    assert [v.method for v in check.views] == ["scan", "cross-correlation"]
    # 40 samples and ten; 6 * 40 + 20 behind them are more than a quarter of the record
    assert ways.asked == [("any input", 100), ("scan", 2, 50), ("correlation", 50, 0.99)]
    assert [(f.code, f.message) for f in check.flags] == [
        ("no_output_error", "output error: no fit")
    ]


def test_what_stops_the_scan_is_told(ways):
    ways.scan = OrderError("no scan")
    check = cr.check_delay(record())
    assert [v.method for v in check.views] == ["output error", "first motion"]
    assert [(f.code, f.message) for f in check.flags] == [("no_scan", "scan: no scan")]


def test_a_scan_says_what_its_data_do_not_carry(ways):
    ways.scan.flags = (
        Flag("order_in_noise", "too high"),
        Flag("filter_delay", "late"),
        Flag("delay_at_bound", "at the end"),
    )
    ways.scan.interval = (0, 6)
    assert seen(cr.check_delay(record()))[2][4:] == (0.0, 7 * DT, "too high; at the end")


def test_where_nothing_finds_a_delay_every_reason_is_told(ways):
    ways.fit, ways.scan, ways.onset = DataError("no fit"), OrderError("no scan"), -1
    with pytest.raises(DataError, match=r"output error: no fit; scan: no scan; cross-corr"):
        cr.check_delay(record())


def test_arguments_are_checked_before_anything_is_fitted(ways):
    for wrong in ({"max_delay": -1}, {"max_delay": 1.5}, {"order": 0}, {"order": 1.5}):
        with pytest.raises(OptionError, match=next(iter(wrong))):
            cr.check_delay(record(), **wrong)
    with pytest.raises(DataError, match="neither"):
        cr.check_delay()
    holes = cr.Record(DT * np.arange(9), np.arange(9), [np.nan, *range(8)], missing="keep")
    with pytest.raises(DataError, match="check_delay needs every sample"):
        cr.check_delay(holes)
    assert ways.asked == []
    cr.check_delay(record(), max_delay=0, order=1)


# frequency responses


@pytest.fixture
def frf_fit(monkeypatch):
    set_up = SimpleNamespace(dead_time=0.3, interval=(0.2, 0.4), flags=())

    def fit_frf(given):
        if isinstance(set_up.flags, Exception):
            raise set_up.flags
        return SimpleNamespace(fit=set_up)

    monkeypatch.setattr(
        importlib.import_module("ctrl_realize.frequency.fit_frf"), "fit_frf", fit_frf
    )
    return set_up


def delayed(dead_time, lines=40):
    hz = np.linspace(0.1, 4.0, lines)
    return cr.MeasuredFRF(np.exp(-2j * np.pi * hz * dead_time), hz)


def test_a_pure_dead_time_is_the_slope_of_its_phase(frf_fit):
    check = cr.check_delay(frf=delayed(0.3))
    fit, slope = seen(check)
    assert fit == ("FRF fit", "FRF", "dead time", 0.3, 0.2, 0.4, "")
    assert slope[:3] == ("phase slope", "FRF", "upper bound")
    np.testing.assert_allclose(slope[3:6], 0.3, rtol=1e-9)  # rounding of the phase
    assert check.dt is None
    assert check.flags == ()


@pytest.mark.parametrize(("spread", "low", "high"), [(0.1, 0.1, 0.5), (0.2, 0.0, 0.7)])
def test_the_slope_is_taken_at_the_top_of_the_band_within_two_standard_errors(
    frf_fit, monkeypatch, spread, low, high
):
    def phase_slope(omega, phase, share):
        np.testing.assert_allclose(phase, -0.3 * omega, atol=1e-9)
        assert share == 1 / 3
        return 0.3, spread

    monkeypatch.setattr(cross_check, "phase_slope", phase_slope)
    ends = seen(cr.check_delay(frf=delayed(0.3)))[1][4:6]
    assert ends == pytest.approx((low, high), rel=1e-12)


def test_four_lines_have_a_slope_and_three_have_none(frf_fit):
    assert len(cr.check_delay(frf=delayed(0.1, 4)).views) == 2
    check = cr.check_delay(frf=delayed(0.1, 3))
    assert len(check.views) == 1
    assert [(f.code, f.message) for f in check.flags] == [
        ("no_phase_slope", "phase slope: 3 lines are too few")
    ]


def test_a_fit_to_a_phase_that_leads_is_in_doubt_and_what_stops_it_is_told(frf_fit):
    frf_fit.flags = (Flag("phase_leads", "it leads"), Flag("other", "x"))
    assert seen(cr.check_delay(frf=delayed(0.3)))[0][-1] == "it leads"
    frf_fit.flags = DataError("no fit")
    check = cr.check_delay(frf=delayed(0.3))
    assert [v.method for v in check.views] == ["phase slope"]
    assert [(f.code, f.message) for f in check.flags] == [("no_frf_fit", "FRF fit: no fit")]


def test_record_and_frequency_response_are_one_table(ways, frf_fit):
    check = cr.check_delay(record(), frf=delayed(0.45))
    assert [v.method for v in check.views] == [
        "output error",
        "first motion",
        "scan",
        "FRF fit",
        "phase slope",
    ]
    assert check.common == (0.4, 0.4)
    frf_fit.interval = (0.1, 0.3)
    apart = cr.check_delay(record(), frf=delayed(0.45))
    assert (apart.agree, apart.common) == (False, None)
    assert apart.conflicts == (("output error", "FRF fit"),)
