"""What a time column means: its unit, its zone, how times are said; and counters that turn."""

import re
import warnings

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.cli import main
from ctrl_realize.errors import DataError, DataWarning, OptionError, TimeAxisError
from ctrl_realize.numerics.signals.counters import counter_period
from tests.io.plant_files import response, steps

GAIN, DEAD_TIME, LAG = 12.0, 0.0225, 0.06
T = 1e-3 * np.arange(600)
U = steps(T, [(0.1, 5.0)])
Y = response(T, U, GAIN, DEAD_TIME, (LAG,)) + 0.02 * np.random.default_rng(5).standard_normal(600)


def scope(path, last="Unit Offset", mark="\t", decimal="."):
    """A file of TwinCAT Scope: a block of keys above columns of time in ms and of signals."""
    block = [("Name", "Drive.Torque", "Axis.Velocity"), ("SymbolComment", "", ""),
             ("Data-Type", "REAL64", "REAL64"), ("SampleTime[ms]", "1", "1"),
             ("SymbolName", "MAIN.a", "MAIN.b"), ("Port", "851", "851"),
             ("BitMask", "0xffffffffffffffff", "0xffffffffffffffff"), ("Unit", "(None)", "(None)"),
             ("Unit Offset", "0", "0")]  # fmt: skip
    block = block[: [line[0] for line in block].index(last) + 1]
    lines = ["Name\tProject", "Starttime of export\t132959733843760000\t2. Mai 2022", "", ""]
    lines += [f"{key}\t{one}\t{key}\t{other}" for key, one, other in block] + [""]
    rows = zip(1e3 * T, U, Y, strict=True)
    lines += [f"{t:g}\t{u:g}\t{t:g}\t{y:.4f}".replace(".", decimal) for t, u, y in rows]
    path.write_text("\n".join(lines).replace("\t", mark) + "\n")
    return path


def columns(path, header, factor=1.0):
    rows = [f"{factor * t:.10g},{u},{y:.4f}" for t, u, y in zip(T, U, Y, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("last", "mark", "decimal"),
    [("Unit Offset", "\t", "."), ("BitMask", ";", ","), ("SampleTime[ms]", ",", ".")],
)
def test_a_sample_time_above_the_columns_tells_their_unit(tmp_path, last, mark, decimal):
    path = scope(tmp_path / "scope.csv", last, mark, decimal)
    record = cr.read_record(path, time=0, input="Drive.Torque", output="Axis.Velocity")
    assert_allclose(record.time, T, rtol=1e-12)
    assert record.units["time"] == "ms"
    assert_allclose(record.output, Y, atol=5.1e-5)


def test_a_stated_sample_time_is_compared_with_the_column(tmp_path):
    for factor, unit in ((1e3, "ms"), (1.0, "s")):
        path = columns(tmp_path / "a.csv", "scope,x\nSampleTime[ms],1\n\ntime,u,y", factor)
        record = cr.read_record(path)
        assert_allclose(record.time, T, rtol=1e-12)
        assert record.units["time"] == unit
    path = columns(tmp_path / "a.csv", "scope,x\nSampleTime[ms],1\n\ntime,u,y", 50.0)
    with pytest.raises(OptionError, match=r"steps of 0\.05, .*SampleTime\[ms\] 1; give time_unit="):
        cr.read_record(path)
    assert cr.read_record(path, time_unit="min").dt == pytest.approx(3.0)
    # a column of that name is no statement
    stamps = cr.read_record(columns(tmp_path / "b.csv", "ts [ms],u,y", 1e3), time=0)
    assert_allclose(stamps.time, T, rtol=1e-12)
    assert cr.read_record(tmp_path / "b.csv", time="ts [ms]").n_samples == T.size
    np.savez(tmp_path / "a.npz", u=U, y=Y, **{"dt [ms]": 1.0})
    assert cr.read_record(tmp_path / "a.npz").dt == 1e-3


@pytest.mark.parametrize("name", ["T [°C]", "T (K)", "t [%]", "T [bar]"])
def test_a_column_with_the_unit_of_another_quantity_is_no_time(tmp_path, name):
    record = cr.read_record(columns(tmp_path / "a.csv", f"time [s],u [%],{name}"))
    assert record.output_labels == (name,)
    assert record.dt == 1e-3
    above = f"time,u,T\ns,%,{name[3:-1]}"
    assert cr.read_record(columns(tmp_path / "b.csv", above)).output_labels == ("T",)


@pytest.mark.usefixtures("without_figures")
def test_seconds_that_were_assumed_are_said(tmp_path):
    path = columns(tmp_path / "a.csv", "t_stamp,u,y")
    record = cr.read_record(path)
    assert repr(record) == "<Record 'a': 600 samples of 0.001 s (assumed), 1 input, 1 output>"
    model = cr.fit_output_error(record, structures="FOPDT")
    said = "time in s (assumed): the file names no unit"
    assert said in model.fit.report()
    cr.save_model(tmp_path / "model.json", model)
    again = cr.load_model(tmp_path / "model.json")
    assert again.fit.report() == model.fit.report()
    page = report.write_identification(tmp_path / "r.html", model, record)
    assert said in page.read_text(encoding="utf-8")
    for header, asked in (("t [s],u,y", {}), ("t,u,y", {"time_unit": "s"}), ("t_s,u,y", {})):
        told = cr.read_record(columns(tmp_path / "a.csv", header), **asked)
        assert "assumed" not in repr(told)
        assert told.units["time"] == "s"
    from_rows = cr.Record(T, U, Y)
    assert "assumed" not in repr(from_rows)
    assert "assumed" not in cr.fit_output_error(from_rows, structures="FOPDT").fit.report()


def test_the_s_of_laplace_stands_beside_seconds_alone(tmp_path):
    """The times of the truth are read off the formula, whatever unit the file has."""
    for header, factor, beside in (
        ("t [ms],u [V],y [mm/s]", 1e3, ""),
        ("t [min],u [V],y [mm/s]", 1 / 60, "L = "),
    ):
        record = cr.read_record(columns(tmp_path / "a.csv", header, factor))
        model = cr.fit_output_error(record, structures="FOPDT")
        first, _, rest = model.fit.formula.partition(", ")
        found = re.fullmatch(r"(\S+) .* e\^\(-(\S+) s\) / \((\S+) s \+ 1\)", first)
        assert_allclose(
            [float(found[k]) for k in (1, 2, 3)], [GAIN, DEAD_TIME, LAG], rtol=0.02, err_msg=first
        )
        assert rest.startswith(beside)
        assert bool(rest) == bool(beside)
        if beside:
            times = re.fullmatch(r"L = (\S+) min, T1 = (\S+) min", rest)
            assert_allclose([60 * float(times[k]) for k in (1, 2)], [DEAD_TIME, LAG], rtol=0.02)
        integrating = cr.fit_output_error(record, structures="IPDT").fit.formula
        assert "(mm/s)/(V s)" in integrating


def test_cards_and_controllers_of_a_file_in_ms_have_a_unit_that_reads(tmp_path):
    slow = columns(tmp_path / "a.csv", "t [ms],u [%],y [°C]", 1e5)
    model = cr.fit_output_error(cr.read_record(slow), structures="FOPDT")
    card, pid = model.fit.report(), cr.design.pid(model, "simc", "PI")
    assert re.search(r"dead time +2\.2\d* s = ", card)
    assert re.search(r"integral ti +(5\.9\d*|6(\.0\d*)?) s\n", pid.report())
    assert "ki = kp / ti = " in pid.report()
    assert "%/(°C s)" in pid.report()
    assert " ms" not in pid.as_form("series").report()
    table = model.fit.parameter_table()
    assert table.loc["lag_1", "unit"] == "s"
    assert table.loc["lag_1", "value"] == pytest.approx(6.0, rel=0.02)
    asked = model.fit.parameter_table(time_unit="ms").loc["lag_1"]
    assert asked["value"] == pytest.approx(6000.0, rel=0.02)


ZONES = {  # where and when a clock is set, and its shown form
    "Berlin in autumn": ("Europe/Berlin", "2025-10-25 20:00", "back", "%d.%m.%Y %H:%M:%S"),
    "Berlin in spring": ("Europe/Berlin", "2025-03-29 20:00", "forward", "%Y-%m-%d %H:%M:%S"),
    "New York in autumn": ("America/New_York", "2025-11-01 23:00", "back", "%Y-%m-%dT%H:%M:%S"),
}


def logged(path, zone, first, form, dt, order=1):
    """Twelve hours of a clock on the wall; returns the seconds that have passed."""
    t = np.arange(0, 12 * 3600, dt, dtype=float)
    start = first if isinstance(first, pd.Timestamp) else pd.Timestamp(first, tz=zone)
    start = start.tz_convert("UTC")
    wall = pd.DatetimeIndex(start + pd.to_timedelta(t, unit="s")).tz_convert(zone).strftime(form)
    rows = [f"{at};{k % 7};{k}" for k, at in enumerate(wall)][::order]
    path.write_text("\n".join(["Timestamp;u;y", *rows]) + "\n")
    return t


@pytest.mark.parametrize("kind", ZONES)
@pytest.mark.parametrize("dt", [60.0, 1800.0, 3600.0])
@pytest.mark.parametrize("order", [1, -1])
def test_a_clock_that_is_set_is_named_and_put_right(tmp_path, kind, dt, order):
    """The truth is a clock that is never set: UTC, from pandas."""
    zone, first, set_to, form = ZONES[kind]
    path = tmp_path / "a.csv"
    t = logged(path, zone, first, form, dt, order)
    with pytest.warns(DataWarning, match=rf"set {set_to} by an hour for summer time .* time_zone="):
        guessed = cr.read_record(path)
    np.testing.assert_array_equal(guessed.time, t)
    record = cr.read_record(path, time_zone=zone)
    np.testing.assert_array_equal(record.time, t)
    np.testing.assert_array_equal(record.output, np.arange(t.size))
    last = pd.Timestamp(first, tz=zone) + pd.Timedelta(10, "h")
    part = cr.read_record(path, time_zone=zone, stop=str(last.tz_localize(None)))
    assert part.time[-1] == 36000.0
    (whole,) = cr.io.read_records(path, time_zone=zone)
    assert whole.n_samples == t.size


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("first", ["2025-10-26 00:55", "2025-10-26 00:10"])
def test_a_test_of_minutes_in_which_the_clock_is_set_back(tmp_path, first, order):
    path = tmp_path / "a.csv"
    utc = pd.Timestamp(first, tz="UTC")
    t = logged(path, "Europe/Berlin", utc, "%Y-%m-%d %H:%M:%S", 10.0, order)
    rows = path.read_text().splitlines()
    kept = [row for row in rows[1:] if int(row.split(";")[2]) < 360]  # an hour
    path.write_text("\n".join([rows[0], *kept]) + "\n")
    with pytest.warns(DataWarning, match="set back by an hour for summer time"):
        np.testing.assert_array_equal(cr.read_record(path).time, t[:360])
    np.testing.assert_array_equal(cr.read_record(path, time_zone="Europe/Berlin").time, t[:360])


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("dt", [10.0, 600.0, 3600.0])
@pytest.mark.parametrize(
    ("first", "hours"), [("00:10", 0.5), ("01:10", 0.5), ("01:40", 4), ("-04:20", 5), ("00:00", 1)]
)
def test_a_record_with_a_part_of_the_hour_that_comes_twice(tmp_path, first, hours, dt, order):
    """It lies within the hour, begins in the second or ends in the first of both."""
    path = tmp_path / "a.csv"
    utc = pd.Timestamp("2025-10-26", tz="UTC") + pd.Timedelta(f"{first}:00")
    t = logged(path, "Europe/Berlin", utc, "%d.%m.%Y %H:%M:%S", dt, order)
    rows = path.read_text().splitlines()
    count = max(4, int(hours * 3600 / dt)) if dt < 3600 else 9
    path.write_text(
        "\n".join([rows[0], *(rows[1:] if order > 0 else rows[:0:-1])[:count][::order]])
    )
    np.testing.assert_array_equal(cr.read_record(path, time_zone="Europe/Berlin").time, t[:count])


@pytest.mark.parametrize("first", ["2026-03-08 06:10", "2026-11-01 05:30"])
def test_a_night_of_the_change_tells_that_day_and_month_matter(tmp_path, first):
    """Both readings have equal distances: a gap of an hour in March made 3663 s of 63 s."""
    path, form = tmp_path / "a.csv", "%m/%d/%Y %I:%M:%S %p"
    t = logged(path, "America/New_York", pd.Timestamp(first, tz="UTC"), form, 10.0)
    rows = path.read_text().splitlines()[:601]
    path.write_text("\n".join(rows) + "\n")
    for options in ({}, {"time_zone": "America/New_York"}):
        with pytest.raises(OptionError, match=r"one of two possible days: .* time_format="):
            cr.read_record(path, **options)
    told = cr.read_record(path, time_zone="America/New_York", time_format=form)
    np.testing.assert_array_equal(told.time, t[:600])


@pytest.mark.parametrize("dt", [5.0, 10.0, 20.0, 60.0])
def test_days_of_a_spreadsheet_with_few_digits_have_the_sample_time(tmp_path, dt):
    """Steps of 0.864 s: their median is 4 % off."""
    path = tmp_path / "a.csv"
    days = [f"{46000.25 + k * dt / 86400:.5f},{k % 7},{k}" for k in range(400)]
    path.write_text("\n".join(["day,u,y", *days]) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # stamps of 5 s are irregular, others not
        record = cr.read_record(path, time="day", time_unit="day")
    assert record.sample_time == pytest.approx(dt, rel=1e-3)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(
    ("form", "shown", "midnight"),
    [
        (
            "%d.%m.%Y %H:%M:%S",
            "04.03.2025 20:00:00",
            ["05.03.2025 00:00:00", "5.3.2025 0:00", "05.03.2025"],
        ),
        (
            "%d.%m.%Y %H:%M:%S,%f",
            "04.03.2025 20:00:00.000000",
            ["05.03.2025 00:00:00,000000", "05.03.2025 00:00:00"],
        ),
        (
            "%m/%d/%Y %I:%M:%S %p",
            "03/04/2025 08:00:00 PM",
            ["03/05/2025 12:00:00 AM", "3/5/2025 12:00 am", "03/05/2025"],
        ),
        (
            "%Y-%m-%dT%H:%M:%S%z",
            "2025-03-04 20:00:00+01:00",
            ["2025-03-05T00:00:00+01:00", "2025-03-04T23:00:00Z"],
        ),
        (
            "%Y-%m-%d %H:%M:%S,%f%z",
            "2025-03-04 20:00:00+01:00",
            ["2025-03-05 00:00:00,000000+0100"],
        ),
        ("%Y%m%dT%H%M%S%z", "2025-03-04 20:00:00+01:00", ["20250305T000000+0100", "20250305"]),
        ("%b %d, %Y %H:%M:%S", "Mar 04, 2025 20:00:00", ["Mar 05, 2025 00:00:00", "Mar 05, 2025"]),
        ("%H:%M:%S %d.%m.%Y %z", "20:00:00 04.03.2025 +0100", ["00:00:00 05.03.2025 +0100"]),
    ],
)
def test_a_part_is_read_as_the_stamps_are(tmp_path, form, shown, midnight, order):
    """05.03.2025 was the third of May, and a date without offset one of UTC."""
    path = tmp_path / "a.csv"
    logged(path, "Europe/Berlin", "2025-03-04 20:00", form, 60.0, order)
    stated = {} if form[1] in "dmY" else {"time_format": form}
    for text in [*midnight, "2025-03-05", "2025-03-05T00:00", np.datetime64("2025-03-05")]:
        assert cr.read_record(path, start=text, **stated).output[0] == 240, text
        assert cr.read_record(path, stop=text, **stated).output[-1] == 240, text
    with pytest.raises(DataError, match=rf"0 samples .* covers .* from {re.escape(shown)} on"):
        cr.read_record(path, start="2025-03-06", **stated)


REFUSED = {  # a zone, a form, the given date, and what is needed
    "an hour": ("UTC", "%d.%m.%Y %H:%M:%S", "21:00", "or a date, .* '25.10.2025 20:00:00'"),
    "an hour of digits": (
        "UTC",
        "%Y-%m-%d %H:%M:%S",
        "2100",
        "or a date, .* '2025-10-25 20:00:00'",
    ),
    "today": ("UTC", "%d.%m.%Y %H:%M:%S", "today", "or a date, .* as in the file or in ISO 8601"),
    "another order": ("UTC", "%Y-%m-%d %H:%M:%S", "10/26/2025", "as in the file or in ISO 8601"),
    "an offset": ("UTC", "%Y-%m-%d %H:%M:%S", "2025-10-26T00:00Z", "without one, or time_zone="),
    "no offset": ("Europe/Berlin", "%Y-%m-%dT%H:%M:%S%z", "2025-10-26", "differ; .* time_zone="),
    "a clock": ("Europe/Berlin", "%Y-%m-%d %H:%M:%S", "2025-10-26", "set for summer .* time_zone="),
}


@pytest.mark.filterwarnings("ignore:.*the clock is taken to be set back")
@pytest.mark.parametrize("kind", REFUSED)
def test_a_date_that_may_be_another_is_refused(tmp_path, kind, capsys):
    zone, form, text, needed = REFUSED[kind]
    path = tmp_path / "a.csv"
    logged(path, zone, "2025-10-25 20:00", form, 60.0)
    with pytest.raises(OptionError, match=f"stop='{text}'.*{needed}"):
        cr.read_record(path, stop=text)
    if not text.isdecimal():  # s on the command line
        assert main(["identify", str(path), "-o", str(tmp_path / "out"), "--to", text]) == 2
        assert re.search(f"--to '?{text}", capsys.readouterr().err)


def test_a_part_may_begin_in_the_hour_that_is_left_out(tmp_path):
    path = tmp_path / "a.csv"
    logged(path, *ZONES["Berlin in spring"][:2], "%Y-%m-%d %H:%M:%S", 60.0)
    part = cr.read_record(path, start="2025-03-30 02:30", time_zone="Europe/Berlin")
    assert part.time[0] == 6 * 3600.0


def test_stamps_of_parquet_are_compared_on_their_clock(tmp_path):
    pytest.importorskip("pyarrow")
    time = pd.date_range("2025-03-04 20:00", periods=480, freq="min", tz="Europe/Berlin", name="t")
    pd.DataFrame({"u": np.arange(480) % 7, "y": np.arange(480)}, time).to_parquet(tmp_path / "a")
    assert cr.read_record(tmp_path / "a", start="2025-03-05").output[0] == 240


def test_tags_in_a_long_table_share_the_hour_that_comes_twice(tmp_path):
    path = tmp_path / "a.csv"
    t = logged(path, *ZONES["Berlin in autumn"][:2], "%Y-%m-%d %H:%M:%S", 600.0)
    rows = [row.split(";") for row in path.read_text().splitlines()[1:]]
    lines = [f"{tag};{at};{value}" for at, u, y in rows for tag, value in (("OP", u), ("PV", y))]
    path.write_text("\n".join(["Tag;Timestamp;Value", *lines]) + "\n")
    record = cr.read_record(path, time_zone="Europe/Berlin")
    np.testing.assert_array_equal(record.time, t)


def test_a_zone_that_does_not_fit_is_refused(tmp_path, capsys):
    path = tmp_path / "a.csv"
    t = logged(path, *ZONES["Berlin in autumn"][:2], "%Y-%m-%d %H:%M:%S", 60.0)
    with pytest.raises(
        OptionError, match=r"time_zone='Mars/Olympus' is not known; expected a name"
    ):
        cr.read_record(path, time_zone="Mars/Olympus")
    once = [row for row in path.read_text().splitlines() if " 02:" not in row]
    path.write_text("\n".join([*once[:361], "2025-10-26 02:30:00;0;0", *once[361:]]) + "\n")
    with pytest.raises(DataError, match=r"'Europe/Berlin' does not fit .*expected an hour that"):
        cr.read_record(path, time_zone="Europe/Berlin", missing="keep")
    seconds = columns(tmp_path / "b.csv", "t [s],u,y")
    with pytest.raises(OptionError, match="has no dates; expected dates with the time of day"):
        cr.read_record(seconds, time_zone="Europe/Berlin")
    # stamps that are written with their distance from UTC are clear by themselves
    start = pd.Timestamp("2025-10-25 20:00", tz="Europe/Berlin")
    wall = (start + pd.to_timedelta(t, unit="s")).map(pd.Timestamp.isoformat)
    path.write_text(
        "\n".join(["Timestamp,u,y", *[f"{at},{k % 7},{k}" for k, at in enumerate(wall)]])
    )
    for zone in (None, "Europe/Berlin"):
        np.testing.assert_array_equal(cr.read_record(path, time_zone=zone).time, t)
    # in the middle of a week it is no change of summer time
    logged(path, *ZONES["Berlin in autumn"][:2], "%Y-%m-%d %H:%M:%S", 60.0)
    path.write_text(path.read_text().replace("-10-26", "-10-29").replace("-10-25", "-10-28"))
    assert main(["identify", str(path), "-o", str(tmp_path / "out")]) == 2
    assert "time jumps back" in capsys.readouterr().err


def motor(bits=12):
    """A motor, 900 counts/s behind 6 ms and a lag of 80 ms, with a counter, in binary noise."""
    rng = np.random.default_rng(7)
    t = 2e-3 * np.arange(1500)
    u = np.repeat(rng.choice([-1.0, 1.0], 30), 50) + 1.5
    late = np.r_[np.full(3, u[0]), u[:-3]]
    pole = np.exp(-2e-3 / 0.08)
    speed = np.zeros(t.size)
    for k in range(1, t.size):
        speed[k] = pole * speed[k - 1] + (1 - pole) * late[k - 1]
    counts = np.floor(np.cumsum(900.0 * 2e-3 * speed) * 4)
    return t, u, counts, counts % 2**bits


def test_a_counter_that_starts_again_is_named_and_joined(tmp_path):
    t, u, counts, turned = motor()
    path = tmp_path / "a.csv"
    rows = [f"{a:.3f},{b},{c:.0f}" for a, b, c in zip(t, u, turned, strict=True)]
    path.write_text("\n".join(["time_s,u,encoder", *rows]) + "\n")
    with pytest.warns(
        DataWarning, match="a counter that starts again after 4096, .* joined; wrap=0"
    ):
        np.testing.assert_array_equal(cr.read_record(path).output, counts)
    wrapped = cr.read_record(path, wrap=0)
    with pytest.raises(DataError, match=r"does not respond .* counter .* after 4096: wrap=4096"):
        cr.fit_output_error(wrapped, structures="IPDT")
    np.testing.assert_array_equal(cr.read_record(path, wrap=4096).output, counts)
    rows[700] = rows[700].rpartition(",")[0] + ","
    path.write_text("\n".join(["time_s,u,encoder", *rows]) + "\n")
    gap = cr.read_record(path, wrap=4096, missing="keep").output
    expected = np.where(np.arange(t.size) == 700, np.nan, counts)
    np.testing.assert_array_equal(gap, expected)
    with pytest.raises(OptionError, match=r"wrap=1024: the output runs from \d+ to 4\d+; expected"):
        cr.read_record(path, wrap=1024, missing="keep")
    with pytest.raises(OptionError, match="wrap"):
        cr.read_record(path, wrap=-1)


@pytest.mark.parametrize(
    ("level", "rise", "noise"), [(3122, 2554, 3), (3600, 1700, 10), (3000, 2900, 0)]
)
def test_a_turn_of_a_noisy_response_is_joined(tmp_path, level, rise, noise):
    # in 26 of 45 the turn was none: gains of the wrong sign, 7 of 12 called good
    t = 2.0 * np.arange(400)
    for seed in range(3):
        y = level - rise * np.expm1(-np.clip(t - 112, 0, None) / 100)
        y = np.round(y + noise * np.random.default_rng(seed).standard_normal(t.size))
        path = tmp_path / f"{seed}.csv"
        rows = [f"{a:g},{30 + 10 * (a >= 100)},{b:g}" for a, b in zip(t, y % 4096, strict=True)]
        path.write_text("\n".join(["time_s,OP,PV", *rows]) + "\n")
        with pytest.warns(DataWarning, match="starts again after 4096"):
            np.testing.assert_array_equal(cr.read_record(path).output, y)


def test_an_output_that_is_at_one_end_of_its_range_or_the_other_is_no_counter():
    still = np.repeat([0.0, 1.0, 0.0], 60) * 4091
    noisy = still + np.random.default_rng(0).integers(0, 5, still.size)
    assert counter_period(noisy) is None


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S UTC", "%Y-%m-%dT%H:%M:%S.%f GMT"])
def test_the_zone_of_universal_time_may_be_in_words(tmp_path, form):
    path = tmp_path / "a.csv"
    t = 60.0 * np.arange(300)
    stamps = pd.Timestamp("2025-03-10 09:00") + pd.to_timedelta(t, unit="s")
    rows = [f"{at};{k % 7};{k}" for k, at in enumerate(stamps.strftime(form))]
    path.write_text("\n".join(["Timestamp;u;y", *rows]) + "\n")
    np.testing.assert_array_equal(cr.read_record(path).time, t)
    np.testing.assert_array_equal(cr.read_record(path, time_zone="Europe/Berlin").time, t)


@pytest.mark.parametrize("begin", ["2026-03-04 23:55", "2026-03-04 09:00"])
@pytest.mark.parametrize("newest_first", [False, True])
@pytest.mark.parametrize("form", ["%H:%M:%S", "%I:%M:%S %p", "%I:%M:%S.%f %p"])
def test_times_of_day_go_on_across_midnight(tmp_path, form, newest_first, begin):
    t = 2.0 * np.arange(300)
    stamps = pd.Timestamp(begin) + pd.to_timedelta(t, unit="s")
    rows = [f"{at},{k % 7},{k}" for k, at in enumerate(stamps.strftime(form))]
    rows = rows[::-1] if newest_first else rows
    (tmp_path / "a.csv").write_text("\n".join(["Time,OP,PV", *rows]) + "\n")
    record = cr.read_record(tmp_path / "a.csv")
    np.testing.assert_array_equal(record.time, t)
    np.testing.assert_array_equal(record.output, np.arange(300))


@pytest.mark.parametrize("start", ["0 s", "1 days 23:59:30", "-2 days"])
def test_durations_are_read_as_pandas_writes_them(tmp_path, start):
    t = 0.5 * np.arange(200)
    frame = pd.DataFrame({"u": np.arange(200) % 7, "y": np.arange(200)})
    frame.index = pd.Index(pd.Timedelta(start) + pd.to_timedelta(t, unit="s"), name="time")
    frame.to_csv(tmp_path / "a.csv")
    record = cr.read_record(tmp_path / "a.csv")
    np.testing.assert_allclose(record.time - record.time[0], t, rtol=0, atol=1e-9)
    text = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join([*text[:50], "0 days soon,1,2", *text[50:]]) + "\n")
    with pytest.raises(DataError, match=r"line 51: '0 days soon' is neither .* 0 days 00:00:00"):
        cr.read_record(tmp_path / "a.csv")


@pytest.mark.parametrize("name", ["Date", "Datum"])
def test_days_of_a_spreadsheet_may_be_called_a_date(tmp_path, name):
    days = 45969.2 + np.arange(60) / 8640  # every 10 s
    rows = [f"{at:.9f},{40 + (k > 10)},{k / 7:.3f}" for k, at in enumerate(days)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{name},OP,PV", *rows]) + "\n")
    with pytest.warns(DataWarning, match="taken for days since 1900"):
        record = cr.read_record(path)
    assert record.dt == pytest.approx(10.0, rel=1e-5)  # digits of 86 us over 10 min
    # a day of digits for all rows is no clock
    path.write_text("\n".join([f"{name},OP,PV", *[f"20251107,{k > 10:d},{k}" for k in range(60)]]))
    with pytest.raises(OptionError, match="cannot tell which column is time"):
        cr.read_record(path)


def test_a_clock_that_is_set_behind_a_gap_is_told_before_missing_values(tmp_path):
    """It was `missing="keep"` that was proposed, which the clock refuses as well."""
    path = tmp_path / "a.csv"
    utc = pd.Timestamp("2025-10-25 22:10", tz="UTC")
    t = logged(path, "Europe/Berlin", utc, "%d.%m.%Y %H:%M:%S", 60.0)
    rows = path.read_text().splitlines()
    rows[10] = rows[10].rsplit(";", 1)[0] + ";Bad"
    path.write_text("\n".join(rows[:30] + rows[36:]) + "\n")  # six are missing
    with pytest.raises(TimeAxisError, match="time_zone= is its zone"):
        cr.read_record(path)
    with pytest.warns(DataWarning, match="1 sample has missing values"):
        record = cr.read_record(path, time_zone="Europe/Berlin")
    assert record.time[-1] == t[-1]
    assert record.n_missing == 7
    assert "7 missing values>" in repr(record)
    assert "1 missing value>" in repr(record[:700.0])
