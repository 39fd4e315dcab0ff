"""Cases that the fuzz lane has found, each with what was wrong."""

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

DT = 0.1
PLANT = ct.ss(0.9, 1, 0.1, 0, DT)
CORE = ct.ss([[0.9, 0.2], [-0.2, 0.9]], [[0], [1]], [[0.3, 0]], 0.1, DT)
LEVELS = np.random.default_rng(0).choice([-1.0, 1.0], 4500)
FREQUENCY = np.linspace(0.05, 2.0, 30)
RESPONSE = np.exp(-0.6j * FREQUENCY) / (1 + 1j * FREQUENCY)
LAG = cr.MeasuredFRF(1 / (1 + 3j * np.geomspace(0.01, 1, 30)), np.geomspace(0.01, 1, 30))


def record(u, y, dt=1.0):
    return cr.Record(dt * np.arange(len(u)), u, y)


def still(signal):
    """A record of which one signal rests for as long as the fit looks."""
    signals = {"u": LEVELS.copy(), "y": np.convolve(LEVELS, 0.1 * 0.9 ** np.arange(50))[:4500]}
    signals[signal][:4200] = 0.0
    return record(**signals)


def tracked(*samples, core=PLANT):
    tracker = cr.DelayTracker(core, max_delay=10, forgetting_time=10.0)
    for sample in samples:
        tracker.update(*sample)
    return tracker


def pulse(*values):
    return np.array([0.0, *values, 0.0, 0.0])


IMPLAUSIBLE, MOTIONLESS = "is not a plausible measurement", "does not leave its baseline"
UNMOVED = "does not respond to the input"
REFUSED = {
    "differences of times overflowed": (
        lambda: cr.Record([-1.7e308, 0, 1.7e308], [1, 2, 3], [1, 2, 3]),
        TimeAxisError, r"time is -1.7e\+308 s at row 0",
    ),
    "steps of nearly nothing": (
        lambda: cr.Record([0, 5e-324, 1e-323], [1, 2, 3], [1, 2, 3]),
        TimeAxisError, r"steps of 4.94066e-324 s",
    ),
    "squares of a response overflowed": (
        lambda: cr.realize(pulse(8.98846567e307), 1, dt=1.0), DataError, IMPLAUSIBLE,
    ),
    "scaling by powers of two overflowed": (
        lambda: cr.estimate_delay(pulse(1.79769313e308), 1, max_delay=1, dt=1.0),
        DataError, IMPLAUSIBLE,
    ),
    "28 GB for three samples": (
        lambda: cr.Record.resampled(*3 * [[0.0, 1.02, 3.7e9]], max_jitter=1.0, dt=1.0),
        OptionError, r"dt=1 s would give 3.7e\+09 samples from 3",
    ),
    "a response divided by a step of nearly nothing": (
        lambda: cr.detect_step(record(np.where(np.arange(40) < 9, 0.0, 5e-324), np.arange(40.0))),
        NoStepError, r"4\.9.*e-324 and cannot be distinguished from zero",
    ),
    "arrays of three samples do not fit": (
        lambda: cr.fit_output_error(record([1, 0, 1], [0, 1, 1])), DataError, "at least 20",
    ),
    "four samples: a division by zero": (
        lambda: cr.fit_output_error(record([1, 0, 1, 0], [0, 1, 1, 0])), DataError, "at least 20",
    ),
    "a misfit relative to a noise of 0": (
        lambda: cr.identify(record(LEVELS[:100], np.full(100, 5.0))), DataError, MOTIONLESS,
    ),
    "a motion of 1e-200": (
        lambda: cr.identify(record(LEVELS[:100], 1e-200 * np.cumsum(LEVELS[:100]))),
        DataError, MOTIONLESS,
    ),
    "an input that rests where the fit looks": (
        lambda: cr.fit_output_error(still("u"), structures=[(1, 1)]), DataError, UNMOVED,
    ),
    "an output that rests where the fit looks": (
        lambda: cr.fit_output_error(still("y"), structures=[(1, 1)]), DataError, UNMOVED,
    ),
    "an output that is one spike at the start": (
        lambda: cr.identify(record(LEVELS[:26] + 0.1 * np.arange(26), [482.0, *np.zeros(25)])),
        DataError, UNMOVED,
    ),
    **{
        f"a frequency response and a sample time of {dt:g} s": (
            lambda dt=dt: cr.fit_frf(cr.MeasuredFRF(RESPONSE, FREQUENCY), 1, dt=dt),
            (UnsuitableSystemError, DelayRangeError), "use a",
        )
        for dt in (2.3e-308, 2.9e-230, 1e-9, 1.7e308)
    },
    **{
        f"a search up to {bound:g} s": (
            lambda bound=bound: cr.fit_frf(LAG, 1, max_dead_time=bound),
            OptionError, f"too {fault} for these frequencies",
        )
        for bound, fault in ((1e308, "long"), (1e6, "long"), (1e-320, "short"), (1e-200, "short"))
    },
    "a sample of 1e308": (
        lambda: cr.Record([0, 1, 2], [1, 2, 3], [1, 1.7e308, 3]),
        DataError, r"output is larger than 1e\+70 at index 1",
    ),
    "a ragged time axis": (
        lambda: cr.Record([[], [0.0]], [1, 2], [1, 2]), DataError, "time is not an array",
    ),
    "squares of a tracker's output overflowed": (
        lambda: tracked((0.0, 1e71)), DataError, IMPLAUSIBLE,
    ),
    "squares of a tracker's input overflowed": (
        lambda: tracked((-1.7e308, 0.0)), DataError, IMPLAUSIBLE,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_measurement_is_refused(case):
    call, error, match = REFUSED[case]
    with pytest.raises(error, match=match):
        call()


def nothing_behind_the_delay():
    g = np.zeros((2, 2, 3))
    g[0], g[1] = [[1, -1e-313, 6e-313], [2, -2e-313, 1e-312]], [[-1, 1e-313, -6e-313], [0, 0, 1]]
    return cr.estimate_delay(g, 1, max_delay=0, dt=1.0).delay_free.A


def short_exact_step(samples, length):
    y = np.concatenate([[0.0], 1 - 0.8 ** np.arange(samples - 1)])
    return cr.impulse_from_io(record(np.arange(samples) >= 1, y), length).markov


def odd_point(value, std):
    response = RESPONSE.copy()
    response[7] = value
    frf = cr.MeasuredFRF(response, FREQUENCY, std=std)
    model = cr.delayed_ss(ct.tf(1, [1 / (2 * np.pi), 1]), dead_time=0.1, dt=0.01)
    cr.compare_frf(model, frf).report()
    return cr.fit_frf(frf, 1).delay_free.A


def heavy_point(value):
    f = np.geomspace(0.004, 0.4, 24)
    g = 1 / (1 + 3j * f)
    g[5] = value
    return cr.impulse_from_frf(cr.MeasuredFRF(g, f), 1.0, 53, weighting="relative").markov


def moved(*moves):
    core = (CORE.A, CORE.B[:, 0], CORE.C[0], 0.1)
    directions = pole_directions(CORE.poles(), DT)
    moved_core(core, CORE.zeros(), directions, np.array(moves), DT)
    return 0.0


def of_two_worlds():
    g = np.zeros(43)
    g[8], g[16:] = -7e-282, 1e90
    return cr.scan_orders(g, 2, max_delay=7, dt=1.0, samples=16, feedthrough=True).iae


def far_below_its_slope():
    samples = [(1e12 * u, 0.0) for u in np.repeat([0.0, 1.0, -1.0, 1.0], 30)]
    told = tracked(*samples, core=ct.ss(0.8, 1, 0.2, 0, DT)).estimate()
    assert not told.resolved
    return 0.0


NOISE = np.random.default_rng(0).standard_normal(23)
WILD_AT_REST = np.r_[-4.94e-324, 0, 0, -653.0, np.zeros(11), -3.2 * np.arange(1, 11)]
WILD_AND_LATE = np.r_[np.zeros(6), -8.58913364, np.zeros(22), -3.2]


def odd_step(edge, height, dt, y):
    return cr.identify(record(np.where(np.arange(y.size) < edge, 0.0, height), y, dt)).A


FINITE = {
    # the inverse roots of singular values around 1e-313 overflowed
    "a response that underflows behind the delay": nothing_behind_the_delay,
    # a sum of squares rounded to below zero, and a prior too wide for the rounding of the sums
    **{
        f"{n} samples of an exact step": functools.partial(short_exact_step, n, length)
        for n, length in ((12, 2), (20, 5), (22, 7), (52, 15))
    },
    # weights and relative errors overflowed
    "a point of 5e-324": lambda: odd_point(5e-324, None),
    "a point of 1e-200 with its deviation": lambda: odd_point(1e-200, np.full(30, 1e-3)),
    # with weights relative to the response the prior had to be narrower than its search went
    "a point of 1e-39 weighs more than all others": lambda: heavy_point(1e-39),
    "a point of 1e-67 weighs more than all others": lambda: heavy_point(1e-67),
    # StopIteration, and the logarithm of a pole at 0; a move of a tracker that overflowed
    "poles move to where they meet": lambda: moved(8.0, 0.0),
    "poles move to nothing": lambda: moved(-40.0, 5.0),
    "poles move by e^2169": lambda: moved(2169.0, 0.0),
    # relative to a final level of 1e-304 everything overflowed
    "a step response that ends in nothing": lambda: rise_time(
        np.r_[np.zeros(5), 3e5, np.full(40, 1e-304)], DT
    ),
    # of a Hankel matrix that ends just before a sample of another world a pole overflowed
    "a sample of 1e-282 before one of 1e90": of_two_worlds,
    "an output of zero beside an input of 1e12": far_below_its_slope,
    "an output 1e200 times as large as the input": lambda: tracked(
        *((2e-144 if k == 5 else 0.0, 1e58 * np.sin(k)) for k in range(40))
    ).estimate().delay_interval,
    # the inverse of sums of squares around 1e-310 was infinite
    "an input whose squares underflow": lambda: tracked(
        *((1e-155 if k % 7 == 5 else 0.0, np.sin(k)) for k in range(60))
    ).model.delay_free.C,
    # the line back to the rest level was drawn through a sample behind the end
    "a motion at the last sample": lambda: odd_step(44, 1.0, 1.0, np.r_[np.zeros(59), 1.0]),
    # the noise of the settled half was asked of a half without a sample
    "an edge near the end": lambda: odd_step(20, 1.0, 1.0, NOISE),
    # a chain of lags whose gain has no influence on the fit: 0/0 in the error of its delay
    "wild before an integrator": lambda: odd_step(12, -16.0, 1e-6, WILD_AT_REST),
    # the delay of a chain was known without any error: 0/0 in its profile
    "a last motion behind a wild sample": lambda: odd_step(26, -16.0, 1e-6, WILD_AND_LATE),
}  # fmt: skip


@pytest.mark.parametrize("case", FINITE)
def test_what_overflowed_is_finite_or_refused(case):
    with good_end(seconds=60) as results:
        results.append(FINITE[case]())
    for values in results:
        assert np.isfinite(values).all()


@pytest.mark.parametrize(
    ("header", "cell", "error", "match"),
    [
        # the pattern for numbers had two ways to match digits: time grew with their square
        ("y", "9" * 40_000, DataError, r"\(or too large for double precision\)"),
        *((name, "1", OptionError, "which column is the")
          for name in ("_" * 50_000, "1" * 50_000, "[" * 50_000 + "]", " s" * 25_000)),
    ],
    ids=["digits", "underscores", "ones", "brackets", "spaces"],
)  # fmt: skip
def test_a_cell_without_end_does_not_take_minutes(tmp_path, header, cell, error, match):
    names = "t,u,y" if header == "y" else f"t,u,{header},z"
    rows = "".join(f"{k},{cell},2{',3' * (header != 'y')}\n" for k in range(4))
    (tmp_path / "a.csv").write_text(f"{names}\n{rows}")
    with good_end(seconds=10), pytest.raises(error, match=match):
        cr.read_record(tmp_path / "a.csv")


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
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    campaign = cr.identify_campaign(sources, method="scan", order=1, max_delay=9, store=store)
    assert (len(campaign.good), len(store)) == (1, 1)
    assert "udcff" in campaign.table().index[0]
    assert "udcfe" in campaign.table().index[1]
    assert "udcff" in campaign.report()
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


def test_a_pulse_response_is_the_same_in_any_unit_of_the_output():
    # 1e-40 V met a bound of the prior, and its matrix was not positive definite
    one = cr.impulse_from_frf(cr.MeasuredFRF(RESPONSE, FREQUENCY), 0.2, 40).markov
    for unit in (2.0**-133, 2.0**133):
        other = cr.impulse_from_frf(cr.MeasuredFRF(unit * RESPONSE, FREQUENCY), 0.2, 40).markov
        np.testing.assert_array_equal(other, unit * one)


@pytest.mark.parametrize(
    ("band", "dead_time", "lag", "longest"),
    [
        # candidates were spread too thinly below such a bound, and the model was wrong silently
        *(((10.0, 1e4), 0.002345, 0.002, longest) for longest in (1.0, 50.0)),
        # by its slope the slow lag allows 60 000 turns of the phase, which were not all searched
        ((1e-3, 1e3), 0.01, 100.0, None),
        ((0.01, 1.0), 0.0, 3 / (2 * np.pi), 1e-12),
    ],
)
def test_a_dead_time_is_found_below_any_bound_that_can_be_searched(band, dead_time, lag, longest):
    f = np.geomspace(*band, 100)
    s = 2j * np.pi * f
    frf = cr.MeasuredFRF(2 * np.exp(-dead_time * s) / (lag * s + 1), f)
    fit = cr.fit_frf(frf, 1, max_dead_time=longest, dt=min(dead_time, 0.1) or None).fit
    assert fit.dead_time == pytest.approx(dead_time, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("zeros", [b"\0", b"\0\0"])
def test_a_line_of_zeros_among_the_last_is_no_row(tmp_path, zeros):
    # three of 25 000 tables: a row without a cell was asked for its last one
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + zeros + b"\r5 6")
    with good_end():
        cr.read_record(tmp_path / "a.csv")


@pytest.mark.parametrize("options", [{"delimiter": "·"}, {"delimiter": "·", "comment": "§"}])
def test_signs_beyond_ascii_part_cells_and_begin_comments(tmp_path, options):
    # pandas' fast parser refused the first with a ValueError, and half understood the second
    lines = [f"{k}·{float(k > 5)}·{k / 8}" for k in range(20)]
    lines = [f"{line} § {k}" for k, line in enumerate(lines)] if "comment" in options else lines
    (tmp_path / "a.csv").write_text("\n".join(["t·u·y", *lines]), encoding="utf-8")
    found = cr.read_record(tmp_path / "a.csv", **options)
    np.testing.assert_array_equal(found.output, np.arange(20) / 8)


@pytest.mark.parametrize("column", ["²", "6²", "٣"])
def test_digits_that_are_no_numbers_name_columns_at_the_command_line(tmp_path, column, capsys):
    (tmp_path / "a.csv").write_text("t,u,y\n0,0,0\n1,1,1\n2,1,2\n")
    asked = ["identify", str(tmp_path / "a.csv"), "-o", str(tmp_path / "out"), "--time", column]
    assert main(asked) == 2
    assert f"'{column}'" in capsys.readouterr().err


@pytest.mark.parametrize("given", [None, [(1, 1)]])
def test_an_output_that_moves_at_its_last_sample_alone_is_fitted(given):
    # responses that come after the record showed in rounding, with slopes of 1e168
    u, y = np.repeat([0.0, 1e30], [19, 4]), np.zeros(23)
    u[0], y[-1] = 8.75366413e-130, 2e20
    with good_end() as models:
        models.append(cr.identify(record(u, y, 1e-6), structures=given))
    # One sample is that of any structure, so that rounding chooses among them: the response comes
    # after 2 to 3 samples, or with more lags earlier.
    low, high = models[0].fit.interval
    assert (1.9e-6 if given else 0.0) <= low <= 2e-6 < high <= 4e-6
    assert given or low <= 2e-6 < 3e-6 <= high
