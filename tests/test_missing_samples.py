"""Records with missing samples, irregular time stamps and two sample times."""

import control as ct
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.errors import DataError, DataWarning, OptionError, TimeAxisError

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


@pytest.mark.parametrize("dropped", [False, True])
@pytest.mark.parametrize("missing", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("step", [1 / 3, 1 / 1280, 7 / 60, 10.0])
def test_regular_samples_of_which_some_are_missing_keep_their_step(step, missing, dropped):
    """Beside an input that moves between the samples, so that the time axis is finer."""
    time, rng = step * np.arange(400), np.random.default_rng(1)
    y = np.where(rng.random(400) < missing, np.nan, rng.standard_normal(400))
    keep = ~np.isnan(y) if dropped else np.full(400, True)
    moves = [0.0, 100.37 * step]
    record = cr.Record.from_samples(time[keep], [0.0, 1.0], y[keep], input_time=moves)
    assert record.dt < 0.5 * step
    assert_allclose(record.sample_time, step, rtol=1e-9)


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


DT, LAGS, GAIN, DELAY = 10.0, (400.0, 80.0), 1.5, 114.3


def furnace(time, moves, sizes):
    """Two lags behind a dead time, exactly, for an input that moves at any times."""
    slow, fast = LAGS
    late = np.maximum(time[:, None] - moves - DELAY, 0.0)
    decay = slow * np.exp(-late / slow) - fast * np.exp(-late / fast)
    return 50 + GAIN * (1 - decay / (slow - fast)) @ sizes


def stored(kind, rng, noise, operating):
    """Record of the furnace as a historian has it: some samples, and changes of the input."""
    time = DT * np.arange(500)
    if kind == "irregular":
        time = DT * np.cumsum(rng.uniform(0.4, 1.6, 500))
    moves, sizes = np.array([700.0]), np.array([3.0])
    if operating:
        moves = np.sort(rng.choice(np.arange(200.0, 4500.0, 1.0 if kind == "rates" else DT), 20))
        moves = np.unique(moves)
        sizes = rng.uniform(-3, 3, moves.size)
    elif kind == "rates":
        moves += 3.0
    y = furnace(time, moves, sizes) + noise * rng.standard_normal(500)
    if kind == "missing":
        y[rng.random(500) < 0.3] = np.nan
    levels = np.concatenate([[0.0], np.cumsum(sizes)])
    return cr.Record.from_samples(time, levels, y, input_time=[time[0], *moves])


@pytest.mark.parametrize("operating", [False, True])
@pytest.mark.parametrize("kind", ["missing", "irregular", "rates"])
def test_samples_as_they_are_give_the_dead_time_and_the_gain(kind, operating):
    record = stored(kind, np.random.default_rng(3), 0.01, operating)
    fit = cr.identify(record, structures=[(2, 2)]).fit
    # four standard errors; how often 95 % intervals hold is counted below and in the docs
    assert_allclose(fit.dead_time, DELAY, atol=4 * fit.std_given_structure)
    assert_allclose(fit.gain, GAIN, atol=4 * fit.gain_std_given_structure)
    assert fit.std_given_structure < 2.0
    assert set(fit.time) <= set(record.time[record.seen])
    assert_array_equal(fit.measured, record.output[np.isin(record.time, fit.time)])
    assert fit.at_noise_level
    assert_allclose(fit.residual, 0.01, rtol=0.15)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_rows_without_samples_change_nothing(pole):
    rng = np.random.default_rng(5)
    time = DT * np.arange(600)
    u, noise = 1.0 * (time >= 2000), lfilter([0.01], [1, -pole], rng.standard_normal(600))
    y = furnace(time, np.array([2000.0]), np.array([1.0])) + noise
    plain = cr.identify(cr.Record(time, u, y), structures=[(2, 2)]).fit
    fine = np.full(1798, np.nan)
    fine[::3] = y
    finer = cr.Record(DT / 3 * np.arange(1798), np.repeat(u, 3)[:1798], fine, missing="keep")
    other = cr.identify(finer, structures=[(2, 2)]).fit
    assert other.estimate.residual.whitened == plain.estimate.residual.whitened == bool(pole)
    # bins are chosen on the grid, so that they are not the same
    assert_allclose(other.dead_time, plain.dead_time, atol=0.1 * plain.std_given_structure)
    assert_allclose(other.interval, plain.interval, atol=0.2 * plain.std_given_structure)
    assert_allclose(other.gain, plain.gain, rtol=1e-4)


def test_the_interval_of_a_record_with_missing_samples_holds():
    held = 0
    for seed in range(20):
        record = stored("missing", np.random.default_rng([seed, 1]), 0.02, operating=False)
        low, high = cr.identify(record, structures=[(2, 2)]).fit.interval
        held += low <= DELAY <= high
    # a right 95 % interval holds 17 times or more in 98 % of such trials; all of them: see docs
    assert held >= 17


def test_several_records_with_missing_samples_are_fitted_together():
    records = [stored("missing", np.random.default_rng([s, 2]), 0.02, False) for s in range(2)]
    fit = cr.identify(records, structures=[(2, 2)]).fit
    assert_allclose(fit.dead_time, DELAY, atol=4 * fit.std_given_structure)
    assert fit.std_given_structure < 2.0
    assert fit.repeatability is not None
    assert_allclose(fit.repeatability.delays, DELAY, atol=5.0)


@pytest.mark.parametrize("method", ["scan", "paper"])
def test_methods_that_need_every_sample_name_the_one_that_does_not(method):
    record = stored("missing", np.random.default_rng(0), 0.01, False)
    with pytest.raises(DataError, match="identify\\(record\\) and fit_output_error use"):
        cr.identify(record, method=method)


def test_dead_sensors_and_outliers_of_operating_data_are_named():
    rng = np.random.default_rng(8)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], 40), 20)
    plant = cr.delayed_ss(ct.tf([2.0], [9, 1]), dead_time=7.3, dt=1.0)
    clean = np.ravel(plant.simulate(u)) + 0.02 * rng.standard_normal(u.size)

    def flags(y):
        fit = cr.identify(cr.Record(np.arange(800.0), u, y), structures=[(1, 1)]).fit
        return {flag.code: str(flag) for flag in fit.flags}

    stuck, spiked, coded = clean.copy(), clean.copy(), clean.copy()
    stuck[700:] = stuck[700]
    told = flags(stuck)["stuck_output"]
    assert "100 samples, from 700 s to 799 s (the end of the record)" in told
    spiked[rng.choice(800, 12, replace=False)] += 0.3  # 15 standard deviations: not left out
    assert "1.5 % of the samples are outliers" in flags(spiked)["outliers"]
    coded[[100, 400]] = -9999.0
    assert "2 sample(s), the first at 100 s, are -9999" in flags(coded)["outliers"]


@pytest.mark.parametrize("rows", [slice(101, 102), slice(200, 215)])
def test_a_code_in_the_input_of_a_file_is_named(tmp_path, rows):
    """One of 300 rows made a gain of -0.00014 of one of 1.5, and no word said why."""
    t = 10.0 * np.arange(300)
    u = np.where(t < 500, 40.0, 50.0)
    u[rows] = -9999
    path = tmp_path / "a.csv"
    table = np.stack([t, u, np.where(t < 563, 20.0, 35.0)], axis=1)
    np.savetxt(path, table, delimiter=",", header="t,u,y", comments="")
    with pytest.warns(DataWarning, match=r"u is -9999 in \d+ of 300 samples.*; na_values=-9999"):
        cr.read_record(path)


def test_an_input_of_which_nothing_is_known_is_read_without_a_warning_of_numpy(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,u,y\n" + "".join(f"{k},,{k % 5}\n" for k in range(60)))
    record = cr.read_record(path, missing="keep")
    assert np.isnan(record.input).all()


def test_a_response_that_begins_in_a_gap_is_named_and_the_interval_holds():
    rng = np.random.default_rng(4)
    time = DT * np.arange(400)
    y = furnace(time, np.array([700.0]), np.array([3.0])) + 0.01 * rng.standard_normal(400)
    y[(time > 750) & (time < 950)] = np.nan
    gap = cr.Record(time, 3.0 * (time >= 700), y, missing="keep")
    fit = cr.identify(gap, structures=[(1, 1), (2, 2), (2, 1)]).fit
    assert "between 50 s and 250 s" in next(str(f) for f in fit.flags if f.code == "onset_in_gap")
    assert fit.interval[0] <= DELAY <= fit.interval[1]


def test_a_model_is_validated_and_drawn_on_the_samples_that_there_are():
    record = stored("missing", np.random.default_rng(11), 0.01, True)
    sys = cr.identify(stored("missing", np.random.default_rng(12), 0.01, True), structures=[(2, 2)])
    noise = np.std(record.output[record.seen])
    fit = cr.validation.cross_validate(sys, record).to_numpy()[0, 0]
    assert_allclose(fit, 100 * (1 - 0.01 / noise), atol=0.1)
    drawn = record.plot().axes.flat[0].lines[0].get_xdata()
    assert drawn.size == np.count_nonzero(record.seen)
    with pytest.raises(DataError, match="a simulation needs complete data"):
        cr.validation.analyse_residuals(sys, record)


def test_a_record_without_an_output_after_its_step_is_refused():
    time = 0.1 * np.arange(200)
    y = np.where(time < 10, np.random.default_rng(0).standard_normal(200), np.nan)
    with pytest.raises(DataError, match="expected samples of the output after the step at 10 s"):
        cr.fit_output_error(cr.Record(time, 1.0 * (time >= 10), y, missing="keep"))


def jittered(delay=5.3, lag=20.0, gain=0.8):
    """Simulated log about once a second, of stamps that are exact, and a step of 10."""
    rng = np.random.default_rng(5)
    time = np.round(np.cumsum(1.004 + 0.1 * rng.uniform(-1, 1, 300)), 3)
    u = 10.0 * (np.arange(300) >= 60)
    y = gain * 10 * -np.expm1(-np.maximum(time - time[60] - delay, 0) / lag)
    return time, u, y + 0.02 * rng.standard_normal(300)


def test_models_and_controllers_have_the_sample_time_of_irregular_stamps():
    record = cr.Record.from_samples(*jittered())
    assert (record.sample_time, record.irregular) == (1.0, True)
    assert record.dt < 0.03
    assert "300 samples about 1 s apart" in repr(record)
    sys = cr.identify(record, structures="FOPDT")
    fit, pid = sys.fit, cr.design.pid(sys)
    assert (sys.dt, fit.dt, pid.dt, fit.plausible_models.dt) == (1.0, 1.0, 1.0, 1.0)
    # the stamps are exact in the fit: rounded to whole samples they were 0.2 to 0.5 s off
    assert fit.interval[0] <= 5.3 <= fit.interval[1]
    assert_allclose(fit.dead_time, 5.3, atol=0.1)
    assert_allclose(fit.delay, fit.dead_time)
    assert_allclose(sys.dcgain(), 0.8, rtol=0.01)
    assert "sample time 1 s: the median distance of the stamps" in fit.report()
    table = cr.validation.cross_validate({"model": sys}, [record])
    assert table.to_numpy().min() > 99


def test_the_onset_between_irregular_stamps_is_in_seconds():
    fit = cr.fit_output_error(cr.Record.from_samples(*jittered(delay=5.3))).fit
    # within a stamp; in steps of the fine time axis it was told as 270 s and more
    assert_allclose(fit.onset, 5.3, atol=1.0)


def test_the_sample_time_of_irregular_stamps_may_be_stated():
    record = cr.Record.from_samples(*jittered(), sample_time=2.0)
    assert cr.identify(record, structures="FOPDT").dt == 2.0
    assert len(record[50:250]) < len(record)
    assert record[50:250].sample_time == 2.0
    with pytest.raises(OptionError, match="at least the step of the time axis"):
        cr.Record.from_samples(*jittered(), sample_time=1e-4)
    with pytest.raises(DataError, match="stamps of this record are irregular"):
        cr.identify(record, method="scan")


def test_gaps_and_slow_outputs_leave_the_sample_time_of_regular_stamps():
    assert cr.Record.from_samples(10.0 * SOME, SOME, SOME).sample_time == 10.0
    slow = cr.Record.from_samples(
        10.0 * np.arange(20), np.arange(200), np.arange(20), input_time=np.arange(200.0)
    )
    assert (slow.dt, slow.sample_time, slow.irregular) == (1.0, 1.0, False)


def test_several_channels_with_irregular_stamps_have_their_sample_time():
    time, _, _ = jittered()
    rng = np.random.default_rng(2)
    held = np.repeat(rng.choice([-1.0, 1.0], (2, 30)), 10, axis=1)
    held[:, :30] = 0  # at rest
    fine = np.arange(0, time[-1] + 0.01, 0.01)
    rows = np.clip(np.searchsorted(time, fine, side="right") - 1, 0, None)
    a, b = np.exp(-0.01 / 8), np.exp(-0.01 / 5)
    one = lfilter([0, 1 - a], [1, -a], np.r_[np.zeros(300), held[0][rows]])[: fine.size]
    two = lfilter([0, 1 - b], [1, -b], np.r_[np.zeros(500), held[1][rows]])[: fine.size]
    seen = np.round(time / 0.01).astype(int).clip(0, fine.size - 1)
    output = (2 * one - two)[seen] + 0.005 * rng.standard_normal(time.size)
    record = cr.Record.from_samples(time, held, output)
    sys = cr.identify(record, structures="FOPDT")
    assert sys.dt == 1.0
    for fit, truth in zip(sys.fit.fits, (3.0, 5.0), strict=True):
        assert_allclose(fit.dead_time, truth, atol=0.1)
    even = record.at_equal_distances()
    assert (even.dt, even.irregular) == (1.0, False)
    whole = cr.fit_state_space(record, 2)
    assert whole.dt == 1.0
    assert_allclose(whole.dcgain().ravel(), [2, -1], rtol=0.05)
    assert any("interpolates" in choice for choice in whole.fit.choices)


def test_logs_of_different_stamps_are_fitted_together():
    first, u, y = jittered()
    rng = np.random.default_rng(6)
    second = np.cumsum(1.013 + 0.1 * rng.uniform(-1, 1, 300))
    again = 8 * -np.expm1(-np.maximum(second - second[60] - 5.3, 0) / 20)
    even = np.arange(300.0)
    regular = 8 * -np.expm1(-np.maximum(even - 65.3, 0) / 20)
    noise = 0.02 * rng.standard_normal((2, 300))
    records = [
        cr.Record.from_samples(first, u, y),
        cr.Record.from_samples(second, u, again + noise[0]),
        cr.Record(even, u, regular + noise[1]),
    ]
    sys = cr.identify(records, structures="FOPDT")
    assert sys.dt == 1.0
    assert_allclose([sys.fit.dead_time, sys.fit.gain], [5.3, 0.8], rtol=0.01)


def test_a_frame_with_irregular_rows_is_kept_on_request():
    time, u, y = jittered()
    index = pd.Timestamp("2025-03-01 10:00") + pd.to_timedelta(time, unit="s")
    frame = pd.DataFrame({"OP": u, "PV": y}, index=index)
    with pytest.raises(TimeAxisError, match=r"from_frame\(..., missing='keep'\) does so"):
        cr.Record.from_frame(frame, input="OP", output="PV")
    record = cr.Record.from_frame(frame, input="OP", output="PV", missing="keep")
    seen = record.seen
    assert_array_equal(record.output[seen], y)
    assert_allclose(record.time[seen], time - time[0], atol=0.011)
    with pytest.raises(TimeAxisError, match="newest sample is first"):
        cr.Record.from_frame(frame[::-1], input="OP", output="PV", missing="keep")


def test_samples_that_are_missing_more_often_than_not_keep_the_sample_time():
    rng = np.random.default_rng(4)
    for left in (0.4, 0.2):
        kept = np.flatnonzero(rng.random(500) < left).astype(float)
        record = cr.Record.from_samples(kept, kept, kept)
        assert (record.dt, record.sample_time) == (1.0, 1.0)


def test_samples_close_together_are_averaged():
    rng = np.random.default_rng(8)
    time = np.cumsum(rng.exponential(1.0, 600))
    u = 10.0 * (time > 100)
    y = 20 * -np.expm1(-np.maximum(time - time[np.argmax(u > 0)] - 5.3, 0) / 20)
    record = cr.Record.from_samples(time, u, y + 0.05 * rng.standard_normal(600))
    assert 400 < np.count_nonzero(record.seen) <= 600
    fit = cr.identify(record, structures="FOPDT").fit
    assert fit.interval[0] <= 5.3 <= fit.interval[1]
    assert_allclose(fit.dead_time, 5.3, atol=0.1)
    twice = cr.Record.from_samples([0, 1, 1 + 1e-6, 2, 3], [0] * 5, [0, 1, 3, 4, 5])
    assert_array_equal(twice.output[twice.seen], [0, 2, 4, 5])


def test_time_that_runs_backwards_from_nothing_is_named():
    with pytest.raises(TimeAxisError, match="reverse time, input and output"):
        cr.Record([1e-300, -1e10, -2e10], [0, 1, 1], [0, 0, 1])


@pytest.mark.parametrize(("empty", "cells"), [("output", "1,nan"), ("input", "nan,1")])
def test_a_channel_without_a_value_is_named(empty, cells, tmp_path):
    path = tmp_path / "logged.csv"
    path.write_text("t,u,y\n" + "".join(f"{k},{cells}\n" for k in range(50)))
    # it said that time has shape (0,)
    with pytest.raises(DataError, match=f"the {empty} has no value in any of 50 rows"):
        cr.read_record(path)


@pytest.mark.parametrize(("every", "first"), [(14, 12), (16, 0), (18, 12)])
def test_an_output_that_is_measured_seldom_is_fitted_beside_an_input_that_is_not(every, first):
    # 22 to 28 of 400 samples: a fast pole, whose free response is zero, had more rows (ValueError)
    plant = cr.delayed_ss(ct.tf([2.0], [30.0, 1.0]), dead_time=12.4, dt=1.0)
    u = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 40), 10)
    y = plant.simulate(u) + 0.02 * np.random.default_rng(0).standard_normal(400)
    seldom = np.full(400, np.nan)
    seldom[first::every] = y[first::every]
    fit = cr.fit_output_error(cr.Record(np.arange(400.0), u, seldom, missing="keep")).fit
    # noise of 1 % on a sample in half a lag; the structure is chosen by these few as well
    assert fit.dead_time == pytest.approx(12.4, abs=2)
    assert fit.gain == pytest.approx(2, rel=0.05)
