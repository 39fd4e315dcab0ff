"""Cases that the fuzz lane has found, each as a test of its own with what was wrong."""

import functools
import os

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.errors import (
    DataError,
    DelayRangeError,
    NoStepError,
    OptionError,
    TimeAxisError,
    UnsuitableSystemError,
)
from ctrl_realize.numerics.signals.onset import rise_time
from ctrl_realize.numerics.state_space.pole_sensitivity import moved_core, pole_directions
from tests.fuzz.lane import good_end

PLANT = ct.ss(0.9, 1, 0.1, 0, 0.1)


def test_five_thousand_digits_do_not_take_minutes(tmp_path):
    # the pattern for numbers had two ways to match digits: time grew with their square
    (tmp_path / "a.csv").write_text("t,u,y\n" + ("9" * 40_000 + ",1,2\n") * 5)
    with (
        good_end(seconds=10),
        pytest.raises(DataError, match=r"\(or too large for double precision\)"),
    ):
        cr.read_record(tmp_path / "a.csv")


def test_a_header_without_end_does_not_take_minutes(tmp_path):
    for name in ("_" * 50_000, "1" * 50_000, "[" * 50_000 + "]", " s" * 25_000):
        (tmp_path / "a.csv").write_text(f"t,u,{name},z\n0,1,2,3\n1,2,3,4\n2,3,4,5\n")
        with good_end(seconds=10), pytest.raises(OptionError, match="which column is the"):
            cr.read_record(tmp_path / "a.csv")


def test_times_near_the_end_of_the_doubles_are_refused():
    # their differences overflowed with a warning of NumPy
    with pytest.raises(TimeAxisError, match=r"time is -1.7e\+308 s at row 0"):
        cr.Record([-1.7e308, 0, 1.7e308], [1, 2, 3], [1, 2, 3])
    with pytest.raises(TimeAxisError, match=r"steps of 4.94066e-324 s"):
        cr.Record([0, 5e-324, 1e-323], [1, 2, 3], [1, 2, 3])


@pytest.mark.parametrize("largest", [8.98846567e307, 1.79769313e308])
def test_a_response_near_the_end_of_the_doubles_is_refused(largest):
    # sums of squares and scaling by powers of two overflowed with warnings of NumPy
    g = np.array([0.0, largest, 0.0, 0.0])
    for estimate in (
        lambda: cr.realize(g, 1, dt=1.0),
        lambda: cr.estimate_delay(g, 1, max_delay=1, dt=1.0),
    ):
        with pytest.raises(DataError, match="which is not a plausible measurement"):
            estimate()


def test_a_long_record_is_not_resampled_to_billions_of_samples():
    # 28 GB for three samples
    stamps = np.array([0.0, 1.02, 3.7e9])
    with pytest.raises(OptionError, match=r"dt=1 s would give 3.7e\+09 samples from 3"):
        cr.Record.resampled(stamps, stamps, stamps, max_jitter=1.0, dt=1.0)


def test_an_edge_of_almost_nothing_is_no_step():
    # the response divided by it overflowed with a warning of NumPy
    u = np.where(np.arange(40) < 9, 0.0, 5e-324)
    record = cr.Record(np.arange(40.0), u, np.arange(40.0))
    with pytest.raises(NoStepError, match=r"4\.9.*e-324 and cannot be distinguished from zero"):
        cr.detect_step(record)


def test_a_response_that_underflows_behind_the_delay_makes_no_noise():
    # the inverse roots of singular values around 1e-313 overflowed
    g = np.zeros((2, 2, 3))
    g[0], g[1] = [[1, -1e-313, 6e-313], [2, -2e-313, 1e-312]], [[-1, 1e-313, -6e-313], [0, 0, 1]]
    with good_end() as models:
        models.append(cr.estimate_delay(g, 1, max_delay=0, dt=1.0))
    for model in models:
        assert np.isfinite(model.delay_free.A).all()


@pytest.mark.parametrize("samples", [3, 4, 19])
def test_a_handful_of_samples_is_not_fitted(samples):
    # a division by zero at four samples, arrays that do not fit at three
    t = np.arange(float(samples))
    with pytest.raises(DataError, match="at least 20"):
        cr.fit_output_error(cr.Record(t, np.cos(9 * t), np.sin(t)))


@pytest.mark.parametrize(("samples", "length"), [(12, 2), (20, 2), (20, 5), (22, 7), (52, 15)])
def test_a_short_exact_step_gives_an_impulse_response_or_one_of_our_errors(samples, length):
    # a sum of squares rounded to below zero, and a prior too wide for the rounding of the sums
    u = (np.arange(samples) >= 1).astype(float)
    y = np.concatenate([[0.0], 1 - 0.8 ** np.arange(samples - 1)])
    with good_end() as results:
        results.append(cr.impulse_from_io(cr.Record(np.arange(float(samples)), u, y), length))
    for impulse in results:
        assert np.isfinite(impulse.markov).all()


@pytest.mark.parametrize("level", [0.0, 5.0, 1e6])
@pytest.mark.parametrize("height", [0.0, 1e-200])
def test_an_output_that_stays_where_it_is_is_not_fitted(level, height):
    # a misfit relative to a noise level of 0: ZeroDivisionError, for any input that is no step
    u = np.random.default_rng(0).choice([-1.0, 1.0], 100)
    y = level + height * np.cumsum(u)
    with pytest.raises(DataError, match="does not leave its baseline: its range is"):
        cr.identify(cr.Record(np.arange(100.0), u, y))


@pytest.mark.parametrize("still", ["input", "output"])
def test_what_stays_for_as_long_as_the_fit_looks_is_not_fitted(still):
    # noise levels of 0 over the stretch that is fitted: ZeroDivisionError
    u = np.random.default_rng(0).choice([-1.0, 1.0], 4500)
    y = np.convolve(u, 0.1 * 0.9 ** np.arange(50))[: u.size]
    {"input": u, "output": y}[still][:4200] = 0.0
    with pytest.raises(DataError, match="does not respond to the input"):
        cr.fit_output_error(cr.Record(np.arange(4500.0), u, y), structures=[(1, 1)])


NOISE = np.random.default_rng(0).standard_normal(23)
WILD_AT_REST = np.r_[-4.94e-324, 0, 0, -653.0, np.zeros(11), -3.2 * np.arange(1, 11)]
WILD_AND_LATE = np.r_[np.zeros(6), -8.58913364, np.zeros(22), -3.2]


@pytest.mark.parametrize(
    ("edge", "height", "dt", "y"),
    [
        # the line back to the rest level was drawn through a sample behind the end
        pytest.param(44, 1.0, 1.0, np.r_[np.zeros(59), 1.0], id="moves at the last sample"),
        # the noise of the settled half was asked of a half without a sample
        *(pytest.param(edge, 1.0, 1.0, NOISE, id=f"edge {edge} of 23") for edge in range(18, 22)),
        # a chain of lags whose gain has no influence on the fit: 0/0 in the error of its delay
        pytest.param(12, -16.0, 1e-6, WILD_AT_REST, id="wild before an integrator"),
        # the delay of a chain was known without any error: 0/0 in its profile
        pytest.param(26, -16.0, 1e-6, WILD_AND_LATE, id="moves last, behind a wild sample"),
    ],
)
def test_a_short_odd_record_of_a_step_is_fitted_or_refused(edge, height, dt, y):
    k = np.arange(y.size)
    with good_end(seconds=60):
        cr.identify(cr.Record(dt * k, np.where(k < edge, 0.0, height), y))


@pytest.mark.usefixtures("without_figures")
def test_a_file_name_that_is_no_utf8_does_not_lose_a_campaign(tmp_path):
    # model files and pandas refuse the lone surrogates that such a name comes with
    k = np.arange(60)
    rows = np.column_stack([0.1 * k, k >= 15, 1 - 0.8 ** np.clip(k - 17, 0, None)])
    names = [b"\xff<b>.csv", b"broken \xfe.csv"]
    paths = [os.fsdecode(os.path.join(os.fsencode(tmp_path), name)) for name in names]
    try:
        np.savetxt(paths[0], rows, delimiter=",", header="t,u,y", comments="")
        with open(paths[1], "w") as broken:
            broken.write("no table")
    except OSError:
        pytest.skip("this file system takes no such names")
    sources = [functools.partial(cr.read_record, path) for path in paths]
    store = cr.io.CampaignStore(tmp_path / "rows")
    campaign = cr.identify_campaign(sources, method="scan", order=1, max_delay=9, store=store)
    assert (len(campaign.good), len(store)) == (1, 1)
    assert "udcff" in campaign.table().index[0]
    assert "udcfe" in campaign.table().index[1]
    assert "udcff" in cr.identify_campaign(sources, method="scan", order=1, max_delay=9).report()
    # the report's list of calls holds the names as well
    out = tmp_path / "out"
    assert main(["identify", *paths, "-o", str(out), "--method", "scan", "--order", "1"]) == 1
    assert r"\udcff" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("fault", [ValueError("x"), KeyError("x"), MemoryError(), RuntimeError()])
def test_whatever_a_reading_function_raises_is_a_row(fault):
    # a reader of the caller's raised what identify_campaign did not wait for: all rows were lost
    def broken():
        raise fault

    campaign = cr.identify_campaign([broken, lambda: None], method="scan")
    assert campaign.rows[0].error.startswith(type(fault).__name__)
    assert (
        campaign.rows[1].error == "DataError: the function returned a NoneType; expected a Record"
    )
    # pandas missed the columns of a table without rows
    assert len(campaign.by_amplitude()) == 0


FREQUENCY = np.linspace(0.05, 2.0, 30)
RESPONSE = np.exp(-0.6j * FREQUENCY) / (1 + 1j * FREQUENCY)


@pytest.mark.parametrize("degree", [0, 1])
@pytest.mark.parametrize("dt", [2.3e-308, 2.9e-230, 1e-9, 1.7e308])
def test_a_sample_time_of_another_world_than_the_response_is_refused(dt, degree):
    with pytest.raises((UnsuitableSystemError, DelayRangeError), match="use a"):
        cr.fit_frf(cr.MeasuredFRF(RESPONSE, FREQUENCY), 1, relative_degree=degree, dt=dt)


def test_a_pulse_response_is_the_same_in_any_unit_of_the_output():
    # 1e-40 V met a bound of the prior, and its matrix was not positive definite
    one = cr.impulse_from_frf(cr.MeasuredFRF(RESPONSE, FREQUENCY), 0.2, 40).markov
    for unit in (2.0**-133, 2.0**133):
        other = cr.impulse_from_frf(cr.MeasuredFRF(unit * RESPONSE, FREQUENCY), 0.2, 40).markov
        np.testing.assert_array_equal(other, unit * one)


@pytest.mark.parametrize("odd", [5e-324, 1e-200])
def test_a_response_of_almost_nothing_is_left_out_of_fit_and_comparison(odd):
    # weights and relative errors overflowed
    response = RESPONSE.copy()
    response[7] = odd
    model = cr.delayed_ss(ct.tf(1, [1 / (2 * np.pi), 1]), dead_time=0.1, dt=0.01)
    for std in (None, np.full(response.size, 1e-3)):
        frf = cr.MeasuredFRF(response, FREQUENCY, std=std)
        with good_end() as ends:
            ends.append(cr.compare_frf(model, frf).report())
            ends.append(cr.fit_frf(frf, 1))
        assert len(ends) == 2


CORE = ct.ss([[0.9, 0.2], [-0.2, 0.9]], [[0], [1]], [[0.3, 0]], 0.1, 0.1)


@pytest.mark.parametrize("value", [1e71, -1.7e308])
def test_a_sample_near_the_end_of_the_doubles_is_refused_and_changes_nothing(value):
    # squares overflowed in the tracker's sums
    tracker = cr.DelayTracker(CORE, max_delay=5, forgetting_time=3.0)
    for pair in ((0.0, value), (value, 0.0)):
        with pytest.raises(DataError, match="is not a plausible measurement"):
            tracker.update(*pair)
    assert tracker.estimate().reason == "no samples yet"


def test_an_output_of_zero_beside_a_moving_input_is_told_without_overflow():
    tracker = cr.DelayTracker(ct.ss(0.8, 1, 0.2, 0, 0.1), max_delay=10, forgetting_time=10.0)
    with good_end():
        for u in 1e12 * np.repeat([0.0, 1.0, -1.0, 1.0], 30):
            tracker.update(u, 0.0)
        told = tracker.estimate()
    assert not told.resolved


def test_a_pole_that_is_moved_to_where_it_cannot_move_from_gives_no_core():
    # StopIteration, and the logarithm of a pole at 0
    directions = pole_directions(CORE.poles(), 0.1)
    core = (CORE.A, CORE.B[:, 0], CORE.C[0], 0.1)
    # a move of 2169, of a tracker that had seen two samples from another world, overflowed
    for moves in ([8.0, 0.0], [8.0, 0.5], [-40.0, 5.0], [2169.0, 0.0], [-2169.0, 0.0]):
        with good_end():
            moved_core(core, CORE.zeros(), directions, np.array(moves), 0.1)


def test_a_step_response_that_ends_in_almost_nothing_has_a_rise_time():
    # relative to a final level of 1e-304 everything overflowed
    step = np.concatenate([np.zeros(5), [3e5], np.full(40, 1e-304)])
    with good_end() as ends:
        ends.append(rise_time(step, 0.1))
    assert 0 < ends[0] < step.size * 0.1


@pytest.mark.parametrize("zeros", [b"\0", b"\0\0"])
def test_a_line_of_zeros_among_the_last_is_no_row(tmp_path, zeros):
    # three of 25 000 tables: a row without a cell was asked for its last one
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + zeros + b"\r5 6")
    with good_end():
        cr.read_record(tmp_path / "a.csv")


def test_an_output_that_is_one_spike_at_the_start_is_refused():
    # the first samples are left out, and what was left had a noise level of 0
    u = np.random.default_rng(0).standard_normal(26)
    y = np.where(np.arange(26) == 0, 482.0, 0.0)
    with pytest.raises(DataError, match="the output does not respond to the input"):
        cr.identify(cr.Record(np.arange(26.0), u, y))


def test_a_sample_of_1e_282_before_one_of_1e90_is_no_pole_of_1e372():
    # of a Hankel matrix that ends just before a sample of another world the pole overflowed
    g = np.zeros(43)
    g[8], g[16:] = -7e-282, 1e90
    with good_end() as scans:
        scans.append(cr.scan_orders(g, 2, max_delay=7, dt=1.0, samples=16, feedthrough=True))
    assert np.isfinite(scans[0].iae).all()


@pytest.mark.parametrize("tiny", [1e-39, 1e-67])
def test_one_point_that_weighs_more_than_all_others_gives_a_finite_pulse_response(tiny):
    # with weights relative to the response the prior had to be narrower than its search went
    f = np.geomspace(0.004, 0.4, 24)
    g = 1 / (1 + 3j * f)
    g[5] = tiny
    with good_end() as pulses:
        pulses.append(cr.impulse_from_frf(cr.MeasuredFRF(g, f), 1.0, 53, weighting="relative"))
    assert np.isfinite(pulses[0].markov).all()


def test_an_output_1e200_times_as_large_as_the_input_is_followed_without_overflow():
    tracker = cr.DelayTracker(PLANT, max_delay=10, forgetting_time=10.0)
    with good_end() as told:
        for k in range(40):
            tracker.update(2e-144 if k == 5 else 0.0, 1e58 * np.sin(k))
        told.append(tracker.estimate())
    assert not np.isnan(told[0].gain_std)


@pytest.mark.parametrize("moved", [1e-155, 1e-158, 1e-100])
def test_an_input_whose_squares_underflow_is_followed_or_refused_without_overflow(moved):
    # the inverse of sums of squares around 1e-310 was infinite
    tracker = cr.DelayTracker(PLANT, max_delay=10, forgetting_time=10.0)
    with good_end() as models:
        for k in range(60):
            tracker.update(moved if k % 7 == 5 else 0.0, np.sin(k))
        models.append(tracker.model)
    assert np.isfinite(models[0].delay_free.C).all()


@pytest.mark.parametrize("longest", [1.0, 10.0, 50.0])
def test_a_dead_time_is_found_below_a_bound_of_thousands_of_periods(longest):
    # candidates were spread too thinly below such a bound, and the model was wrong without a word
    f = np.geomspace(10.0, 1e4, 100)
    s = 2j * np.pi * f
    frf = cr.MeasuredFRF(2 * np.exp(-0.002345 * s) / (0.002 * s + 1), f)
    fit = cr.fit_frf(frf, 1, max_dead_time=longest, dt=1e-4).fit
    assert fit.dead_time == pytest.approx(0.002345, rel=1e-6)


def test_a_dead_time_far_below_a_slow_lag_is_found_over_six_decades():
    # by its slope the slow lag allows 60 000 turns of the phase, which were not all searched
    f = np.geomspace(1e-3, 1e3, 100)
    s = 2j * np.pi * f
    fit = cr.fit_frf(cr.MeasuredFRF(np.exp(-0.01 * s) / (100 * s + 1), f), 1, dt=1e-3).fit
    assert fit.dead_time == pytest.approx(0.01, rel=1e-6)


def test_a_bound_of_the_dead_time_that_cannot_be_searched_is_refused():
    f = np.geomspace(0.01, 1.0, 30)
    frf = cr.MeasuredFRF(1 / (1 + 3j * f), f)
    # 1e308 overflowed, and the interval within 1e-320 had no width to search in
    for bound, fault in ((1e308, "long"), (1e6, "long"), (1e-320, "short"), (1e-200, "short")):
        with pytest.raises(OptionError, match=f"too {fault} for these frequencies"):
            cr.fit_frf(frf, 1, max_dead_time=bound)
    assert cr.fit_frf(frf, 1, max_dead_time=1e-12).fit.dead_time <= 1e-12


@pytest.mark.parametrize("options", [{"delimiter": "·"}, {"delimiter": "·", "comment": "§"}])
def test_signs_beyond_ascii_part_cells_and_begin_comments(tmp_path, options):
    # pandas' fast parser refused the first with a ValueError, and half understood the second
    lines = [f"{k}·{float(k > 5)}·{k / 8}" for k in range(20)]
    lines = [f"{line} § {k}" for k, line in enumerate(lines)] if "comment" in options else lines
    (tmp_path / "a.csv").write_text("\n".join(["t·u·y", *lines]), encoding="utf-8")
    with good_end() as records:
        records.append(cr.read_record(tmp_path / "a.csv", **options))
    np.testing.assert_array_equal(records[0].output, np.arange(20) / 8)


@pytest.mark.parametrize("column", ["²", "6²", "٣"])
def test_digits_that_are_no_numbers_name_columns_at_the_command_line(tmp_path, column, capsys):
    (tmp_path / "a.csv").write_text("t,u,y\n0,0,0\n1,1,1\n2,1,2\n")
    asked = ["identify", str(tmp_path / "a.csv"), "-o", str(tmp_path / "out"), "--time", column]
    assert main(asked) == 2
    assert f"'{column}'" in capsys.readouterr().err


def test_values_and_rows_that_are_no_signal_are_refused():
    with pytest.raises(DataError, match=r"output is larger than 1e\+70 at index 1"):
        cr.Record([0, 1, 2], [1, 2, 3], [1, 1.7e308, 3])
    # the ValueError was NumPy's
    with pytest.raises(DataError, match="time is not an array"):
        cr.Record([[], [0.0]], [1, 2], [1, 2])


def test_an_output_that_moves_at_its_last_sample_alone_is_fitted():
    # responses that come after the record showed in rounding, with slopes of 1e168
    u, y = np.repeat([0.0, 1e30], [19, 4]), np.zeros(23)
    u[0], y[-1] = 8.75366413e-130, 2e20
    record = cr.Record(1e-6 * np.arange(23), u, y)
    with good_end() as models:
        models.append(cr.identify(record))
        models.append(cr.identify(record, structures=[(1, 1)]))
    # One sample is that of any structure: the response comes after 2 to 3 samples, or one earlier.
    low, high = models[0].fit.interval
    assert 0.9e-6 < low <= 2e-6 < 3e-6 <= high <= 4e-6
    low, high = models[1].fit.interval
    assert 1.9e-6 < low < high <= 4e-6
