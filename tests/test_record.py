"""Units, parts, tables and the steady state of a record."""

import pickle

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError, TimeAxisError

T = 0.5 * np.arange(20)
U = (T >= 2).astype(float)
RECORD = cr.Record(T, U, [3 * U + 20, 5 - U], name="oven", units={"u": "%", "y[0]": "°C"})


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
    assert cr.Record(T, U, U, units={"time": "min"}).units["time"] == "min"


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
        (U, {"output": "y"}, DataError, "got a ndarray"),
    ):
        with pytest.raises(error, match=match):
            cr.Record.from_frame(table, input="u", **options)


@pytest.mark.parametrize(
    ("units", "match"), [({"v": "%"}, "'v'.*'u', 'y' or 'time'"), ("%", "by label")]
)
def test_units_of_no_signal_are_refused(units, match):
    with pytest.raises(OptionError, match=match):
        cr.Record(T, U, U, units=units)


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
