"""Records with missing samples, irregular time stamps and two sample times."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError, TimeAxisError

RNG = np.random.default_rng(20261123)
SOME = np.sort(RNG.choice(1000, 700, replace=False))


@pytest.mark.parametrize(
    ("stamps", "step"),
    [
        (10.0 * SOME, 10.0),
        (1.7e9 + 10.0 * SOME, 10.0),
        (np.round(SOME / 3, 3), 1 / 3),  # a rounded step that no decimal number hits
        (np.cumsum(RNG.integers(3, 60, 300)).astype(float), 1.0),  # whole seconds
        (0.25 * np.cumsum(RNG.integers(3, 60, 300)), 0.25),
    ],
)
def test_samples_keep_their_times_on_the_coarsest_grid(stamps, step):
    values = RNG.standard_normal(stamps.size)
    record = cr.Record.from_samples(stamps, values, values)
    seen = ~np.isnan(record.output)
    assert_allclose(record.dt, step, rtol=1e-5)
    assert_array_equal(record.output[seen], values)
    # 5 % of a step is the jitter that a uniform time axis may have
    assert np.abs(record.time[seen] - stamps).max() < 0.05 * step
    assert_array_equal(record.input[seen], values)


def test_stamps_of_full_precision_move_by_a_hundredth_of_their_distance_at_most():
    stamps = np.cumsum(RNG.uniform(5, 15, 400))
    record = cr.Record.from_samples(stamps, stamps, stamps)
    seen = ~np.isnan(record.output)
    assert_array_equal(record.output[seen], stamps)
    assert np.abs(record.time[seen] - stamps).max() < 0.01 * np.median(np.diff(stamps))


def test_an_input_stored_at_its_changes_is_held_from_each_to_the_next():
    changes, levels = np.array([-5.0, 37.0, 61.0]), np.array([1.0, 4.0, 2.0])
    time = 10.0 * np.arange(12)
    record = cr.Record.from_samples(time, levels, time, input_time=changes)
    held = levels[np.searchsorted(changes, record.time, side="right") - 1]
    assert_array_equal(record.input, held)
    assert record.time[0] == changes[0]
    assert_array_equal(record.output[~np.isnan(record.output)], time)


def test_missing_inputs_are_held_and_outputs_before_the_first_input_left_out():
    time = np.arange(8.0)
    u = np.array([np.nan, np.nan, 1.0, np.nan, 2.0, 2.0, np.nan, np.nan])
    record = cr.Record.from_samples(time, u, time)
    assert_array_equal(record.time, time[2:])
    assert_array_equal(record.input, [1, 1, 2, 2, 2, 2])
    assert record.n_missing == 0


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"time": [0, 1, 1, 2, 3]}, TimeAxisError, "time repeats at row 2"),
        ({"time": [0, 1, 2, 2.4, 3], "dt": 1.0}, TimeAxisError, "lie within dt=1 s"),
        ({"dt": 1e-3}, OptionError, "would give 4000 rows for 5 samples"),
        ({"input": [np.nan] * 5}, DataError, "all of its values are NaN"),
        ({"input": [np.nan] * 3 + [1, 2]}, DataError, "less than 3 samples from 3 s on"),
        ({"input_time": [0, 1, 2]}, DataError, "input has 5 samples, time has 3"),
    ],
)
def test_samples_that_cannot_be_placed_are_refused(change, error, match):
    samples = {"time": np.arange(5.0), "input": np.arange(5.0), "output": np.arange(5.0)}
    with pytest.raises(error, match=match):
        cr.Record.from_samples(**(samples | change))
