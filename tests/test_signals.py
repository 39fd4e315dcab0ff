"""Records and responses: what they accept, keep and refuse; units, parts and tables of a record."""

import pickle

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError, TimeAxisError

T = 0.01 * np.arange(100)
ONES = np.ones(100)


def test_sample_time_is_free_of_rounding():
    assert cr.Record(0.01 * np.arange(1, 18062), *np.zeros((2, 18061))).dt == 0.01
    assert cr.Record(7.8125e-4 * np.arange(6440), *np.zeros((2, 6440))).dt == 7.8125e-4


def broken(kind: str) -> np.ndarray:
    time = T.copy()
    if kind == "gap":
        time[40:] += 0.05
    elif kind == "repeat":
        time[40] = time[39]
    elif kind == "back":
        time[40] = 0.2
    elif kind == "reversed":
        time = time[::-1].copy()
    elif kind == "jitter":
        time[40] += 0.003
    return time


@pytest.mark.parametrize(
    ("kind", "match"),
    [
        ("gap", r"gap at row 40.*5 sample"),
        ("repeat", "repeats at row 40"),
        ("back", "jumps back at row 40"),
        ("reversed", "backwards: row 1"),
        ("jitter", "row 40 is 0.3 samples off"),
    ],
)
def test_broken_time_is_named_with_its_first_bad_row(kind, match):
    with pytest.raises(TimeAxisError, match=match):
        cr.Record(broken(kind), ONES, ONES)


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        (([], [], []), DataError, r"shape \(0,\)"),
        ((T[:2], ONES[:2], ONES[:2]), DataError, "N >= 3"),
        ((T, ONES[:50], ONES), DataError, "input has 50 samples, time has 100"),
        ((T, ONES, np.ones((100, 2))), DataError, r"transposed, pass output.T"),
        ((T, ONES, np.where(T == 0.5, np.nan, 1)), DataError, "first at index 50"),
        ((T, np.where(T > 0.97, np.inf, 1), ONES), DataError, "2 non-finite values"),
        ((T, ["a"] * 100, ONES), DataError, "real numbers"),
        ((T, 1j * ONES, ONES), DataError, "real numbers"),
        ((T, np.ones((1, 1, 100)), ONES), DataError, r"\(signals, N\)"),
        ((T[None], ONES, ONES), DataError, r"shape \(1, 100\)"),
    ],
)
def test_unusable_arrays_are_refused(arguments, error, match):
    with pytest.raises(error, match=match):
        cr.Record(*arguments)


def test_paper_filter_delays_by_13_samples_and_lags_48_degrees_at_13_hz():
    spec = cr.data.FilterSpec(5, 50.0, False, 7.8125e-4)
    # paper.md E11 and section 0.3: 13.1 samples, 10.25 ms, 48.4 degrees
    assert_allclose(spec.group_delay, 13.12, atol=0.01)
    assert_allclose(spec.group_delay * spec.dt, 10.25e-3, atol=0.01e-3)
    lag = -np.degrees(np.angle(spec.response(2 * np.pi * 13.0)[0]))
    assert_allclose(lag, 48.4, atol=0.1)


def frf() -> cr.MeasuredFRF:
    f = np.array([10.0, 0.1, 1.0])
    return cr.MeasuredFRF(1 / (1 + 1j * f), f, coherence=[0.2, 1.0, 0.99], std=[0.1, 0.2, 0.3])


def test_frf_is_sorted_with_all_that_belongs_to_it():
    F = frf()
    assert_array_equal(F.frequency_hz, [0.1, 1.0, 10.0])
    assert_array_equal(F.coherence, [1.0, 0.99, 0.2])
    assert_array_equal(F.std, [0.2, 0.3, 0.1])
    assert_allclose(F.complex, 1 / (1 + 1j * F.frequency_hz))


@pytest.mark.parametrize("repeats", [3, 5.5, None])
def test_circles_hold_the_truth_as_often_as_they_say(repeats):
    rng = np.random.default_rng(4)
    errors = rng.standard_normal((20_000, 2)) @ [1, 1j]
    scatter = np.ones(errors.size)
    if repeats is not None:  # the sum of 2 (n - 1) squares, as of n complex values
        scatter = rng.chisquare(2 * (repeats - 1), errors.size) / (2 * (repeats - 1))
    F = cr.MeasuredFRF(1 + errors, np.arange(20_000), std=np.sqrt(2 * scatter), repeats=repeats)
    for level in (0.5, 0.95):
        # binomial, 20 000 of them: a standard deviation of 0.35 % at most
        assert np.mean(abs(F.complex - 1) <= F.circle(level)) == pytest.approx(level, abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (([1.0, 2.0], [1.0]), "1 points"),
        (([], []), "K >= 1"),
        (([1.0], [-1.0]), ">= 0"),
        (([np.nan], [1.0]), "non-finite"),
        (([1.0], [np.inf]), "non-finite"),
        ((["a", "b"], [1.0, 2.0]), "response holds"),
        (([[1.0], [1.0, 2.0]], [1.0, 2.0]), "rows have different lengths"),
        (([1.0, 2.0], ["1", "2"]), "frequency_hz holds"),
        (([1.0, 2.0], [1.0, 1.7e308]), "frequency_hz is larger"),
        (([1.0, 1.7e308 + 1.7e308j], [1.0, 2.0]), "response is larger"),
    ],
)
def test_unusable_frfs_are_refused(arguments, match):
    with pytest.raises(DataError, match=match):
        cr.MeasuredFRF(*arguments)


@pytest.mark.parametrize("kind", ["i1", "u1", "f2", "f4", ">f4", ">f8", ">i4", "g"])
def test_arrays_of_every_kind_of_number_are_taken_by_value(kind):
    values = np.array([0, 1, 100, 3]).astype(kind)
    strided = np.stack([values, values], axis=1)[::-1, 0][::-1]
    assert not strided.flags.c_contiguous
    record = cr.Record(np.arange(4, dtype="f2"), values, strided)
    np.testing.assert_array_equal(record.output, [0.0, 1.0, 100.0, 3.0])
    assert record.output.dtype == np.float64


def test_density_is_per_second():
    g = cr.ImpulseResponse([0.0, 1.0, 0.5], 0.1)
    assert_allclose(g.density, g.markov / 0.1, atol=0)


TIME = 0.5 * np.arange(20)
U = (TIME >= 2).astype(float)
RECORD = cr.Record(TIME, U, [3 * U + 20, 5 - U], name="oven", units={"u": "%", "y[0]": "°C"})


def same(one, two):
    assert_array_equal(one.time, two.time)
    assert_array_equal(one.input, two.input)
    assert_array_equal(one.output, two.output)
    assert (one.input_labels, one.output_labels) == (two.input_labels, two.output_labels)


def test_units_stay_with_parts_copies_and_the_record_before_its_step():
    for record in (
        RECORD[1:4],
        pickle.loads(pickle.dumps(RECORD)),
        RECORD.with_baseline(0, [20, 5]),
    ):
        assert (record.input_units, record.output_units) == (("%",), ("°C", ""))
    assert cr.Record(TIME, U, U, units={"time": "min"}).units["time"] == "min"


def test_a_slice_is_the_part_between_two_times():
    same(RECORD[1.0:4.0], RECORD.between(1.0, 4.0))
    same(RECORD[:], RECORD)
    assert len(RECORD[:3]) == 7
    assert len(RECORD[3:]) == 14
    for part in (3, slice(0, 5, 2), slice("a", None)):
        with pytest.raises(OptionError):
            RECORD[part]


@pytest.mark.parametrize("start", [None, "2025-10-26 00:30"])
def test_a_table_gives_the_record_back(start):
    frame = RECORD.to_frame(start)
    assert isinstance(frame.index, pd.DatetimeIndex) == (start is not None)
    same(cr.Record.from_frame(frame, input="u", output=["y[0]", "y[1]"]), RECORD)


def test_a_table_may_have_its_time_in_a_column_and_missing_values():
    frame = pd.DataFrame({"when": pd.date_range("2025-02-01", periods=4, freq="min"),
                          "u": [0, 1, 1, 1], "y": pd.array([1, None, 3, 4], "Int64")})  # fmt: skip
    kept = cr.Record.from_frame(frame, input="u", output="y", time="when", missing="keep")
    assert_array_equal(kept.time, 60.0 * np.arange(4))
    assert_array_equal(kept.output, [1, np.nan, 3, 4])
    bad = frame.assign(y=["1", "Bad", "3", "4"])
    for table, options, error, match in (
        (frame, {"output": "y", "time": "when"}, DataError, "non-finite"),
        (frame, {"output": "z", "time": "when"}, OptionError, "columns 'when', 'u', 'y'"),
        (frame.loc[[0, 3, 1]], {"output": "u", "time": "when"}, TimeAxisError, "jumps back"),
        (bad, {"output": "y", "time": "when"}, DataError, "to_numeric"),
        (bad.set_index("y"), {"output": "u"}, DataError, "to_datetime"),
        (frame, {"output": "y"}, OptionError, "counts its rows; give time=, .* 'when', 'u', 'y'"),
        (frame[["u", "y"]][1:], {"output": "y"}, OptionError, "counts its rows"),
        (frame.rename_axis("time_ms"), {"output": "y"}, OptionError, "'time_ms'; numbers are sec"),
        (frame, {"output": "y", "time": "t [min]"}, OptionError, "the columns 'when'"),
        (
            frame.assign(**{"t [min]": [0, 1, 2, 3]}),
            {"output": "y", "time": "t [min]"},
            OptionError,
            r"'t \[min\]'; numbers are seconds: convert and rename min",
        ),
        (
            frame.set_index(pd.Index(1.77e12 + 500.0 * np.arange(4), name="time")),
            {"output": "y"},
            OptionError,
            r"convert and rename ms \(such as 1770000001500\)",
        ),
        (U, {"output": "y"}, DataError, "got a ndarray"),
    ):
        with pytest.raises(error, match=match):
            cr.Record.from_frame(table, input="u", **options)


@pytest.mark.parametrize(
    ("units", "match"), [({"v": "%"}, "'v'.*'u', 'y' or 'time'"), ("%", "by label")]
)
def test_units_of_no_signal_are_refused(units, match):
    with pytest.raises(OptionError, match=match):
        cr.Record(TIME, U, U, units=units)


def test_the_steady_state_before_a_step_makes_a_record_that_begins_with_it_usable():
    t = 0.02 * np.arange(200)
    y = 20.3 - 5 * np.expm1(-np.maximum(t - 0.6, 0) / 0.8)
    y += 0.02 * np.random.default_rng(1).standard_normal(t.size)
    record = cr.Record(t, np.full(t.size, 5.0), y)
    with pytest.raises(cr.errors.NoStepError, match="with_baseline"):
        cr.identify(record)
    fit = cr.identify(record.with_baseline(0.0, 20.3), structures=[(1, 1)]).fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1]
    assert fit.dead_time == pytest.approx(0.6, abs=0.02)  # a sample
    with pytest.raises(DataError, match="baseline of the output has 2 values"):
        record.with_baseline(0.0, [1, 2])


def test_a_held_input_keeps_its_levels_when_samples_with_jitter_are_resampled():
    rng = np.random.default_rng(0)
    t = np.arange(60.0) + rng.uniform(-0.2, 0.2, 60)
    u = np.where(t < 20, 34.0, np.where(t < 40, 38.0, 31.0))
    record = cr.Record.resampled(t, u, t)
    assert set(record.input) == {31.0, 34.0, 38.0}
    moved = [values[np.flatnonzero(np.diff(levels)) + 1]
             for values, levels in ((record.time, record.input), (t, u))]  # fmt: skip
    np.testing.assert_allclose(*moved, rtol=0, atol=0.71)  # half a step and the jitter
    np.testing.assert_allclose(cr.Record.resampled(t, 2 * t, t).input, 2 * record.time)


def test_a_record_tells_its_span_and_the_ranges_and_units_of_its_signals():
    time = 0.5 * np.arange(5)
    units = {"valve": "%", "time": "s (assumed)"}
    record = cr.Record(time, [0, 0, 1, 1, 1], [[1, np.nan, 3, 4, 5], [np.nan] * 5], units=units,
                       input_labels=["valve"], name="tank", missing="keep")  # fmt: skip
    assert [" ".join(line.split()) for line in record.report().splitlines()] == [
        "Record tank",
        "samples 5 of 0.5 s (assumed), 2 s long",
        "input valve 0 to 1 %",
        "output y[0] 1 to 5",
        "output y[1] missing",
        "missing 6 values",
    ]
    assert "valve" in record._repr_html_()


def test_what_new_users_type_is_answered_by_what_is_right():
    arrays = np.arange(30.0), np.ones(30), np.ones(30)
    with pytest.raises(DataError, match=r"got 3 arguments; arrays become a record by Record\("):
        cr.identify(*arrays)
    with pytest.raises(DataError, match="missing='keep' takes NaN as missing samples"):
        cr.Record(arrays[0], arrays[1], np.full(30, np.nan))
    with pytest.raises(AttributeError, match=r"did you mean ctrl_realize\.design\.pid\?"):
        cr.pid  # noqa: B018
    with pytest.raises(AttributeError, match="nothing"):
        cr.nothing  # noqa: B018
