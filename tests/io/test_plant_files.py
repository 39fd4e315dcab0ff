"""From the files of plants and laboratories to stable loops, and what is asked on the way."""

import inspect
import json
import shlex
from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.cli.options import ARGUMENTS, option_of
from ctrl_realize.errors import DataError, DataWarning, OptionError, TimeAxisError
from tests.io.plant_files import FILES, historian_signals, response, stamps, steps

AMBIGUOUS = {"german.csv": "output", "four_tests.csv": "input"}
"""Files with several columns that could be a signal."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plants")
    for file in FILES:
        file.write(folder / file.name)
    return folder


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_file_becomes_a_stable_loop_in_two_calls(folder, file):
    path = folder / file.name
    if (signal := AMBIGUOUS.get(file.name)) is not None:
        options = {} if file.many else {"missing": "keep"}
        with pytest.raises(OptionError, match=rf"{signal}; give {signal}=.* it has columns 0 '"):
            cr.read_record(path, **options)
    # the two calls
    bad = file.name.startswith("historian")
    with pytest.warns(DataWarning, match="quality is bad") if bad else nullcontext():
        record = cr.io.read_records(path, **file.reading) if file.many else cr.read_record(
            path, **file.reading
        )  # fmt: skip
    model = cr.identify(record, structures=[(1, 1), (2, 2)])
    assert model.fit.dead_time == pytest.approx(file.dead_time, abs=file.within)
    assert model.fit.gain == pytest.approx(file.gain, rel=0.02)
    assert cr.design.margins(model, cr.design.pid(model)).stable


def test_a_held_input_is_held_and_missing_outputs_are_missing(folder):
    """In the wide file bad rows, a gap and a repeated stamp; in the long one tags of their own."""
    t, u, y, _ = historian_signals()
    for name, fewest in (("historian_wide.csv", 380), ("historian_long.csv", 395)):
        with pytest.warns(DataWarning, match=r"20 of \d+ samples are left out"):
            record = cr.read_record(folder / name, missing="keep")
        assert set(record.input) == set(u)
        seen = np.flatnonzero(~np.isnan(record.output))
        assert fewest <= seen.size <= 400
        at = np.searchsorted(t - t[0], record.time[seen])
        assert_array_equal(t[at] - t[0], record.time[seen])
        np.testing.assert_allclose(record.output[seen], y[at], atol=5.1e-4)  # three decimals
        with pytest.raises(DataError, match=r"line \d+: its quality is bad; missing='keep'"):
            cr.read_record(folder / name, missing="refuse")


def written(tmp_path, header, rows, name="a.csv"):
    path = tmp_path / name
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


STAMPS = [f"2025-01-01 00:{minute:02}:00" for minute in range(6)]
QUALITIES = {  # header, cells behind time, u and y, what is asked, and which of them are bad
    "words": ("Quality", ["Good", "bad", "Good", "Bad Input", "Uncertain", "Good"], {}, [1, 3]),
    "OPC codes": ("Status", [192, 0, 216, 64, 24, 192], {}, [1, 4]),
    "OPC codes of a vendor": ("Quality", [192, 448, 256, 192, 1216, 192], {}, [2]),
    "OPC UA": ("StatusCode", [0, 0x80340000, 0, 0x40000000, 0, 0xC0000000], {}, [1, 5]),
    "OPC UA in hexadecimal": ("y.Quality", ["0x0", "0x80340000", *["0x00"] * 4], {}, [1]),
    "Ignition 7": ("quality", [192, 500, 404, 192, 192, 900], {}, [1, 2, 5]),
    "Ignition 8": ("y.quality", [192, -2147483132, 192, 1073742081, 0, 200], {}, [1]),
    "in words": ("y.quality", ["Good", "Bad_Stale", "Error_IO", *["Good"] * 3], {}, [1, 2]),
    "PI": ("y Status", [0, 0, 246, 0, 254, 0], {}, [2, 4]),
    "PI's Good": ("Good", ["True", "False", *["True"] * 4], {}, [1]),
    "flags of good": ("y.IsGood", [1, 0, 1, 1, 1, 0], {}, [1, 5]),
    "mixed": ("y quality", ["192", "Bad", "0", "192", "good", "192"], {}, [1, 2]),
    "words beside numbers": ("Quality", ["1", "Bad", "2", "1", "1", "1"], {}, [1]),
    "other numbers": ("Status", [0, 1, 0, 1, 0, 1], {}, []),
    "a switch": ("Status", ["true", "false"] * 3, {}, []),
    "always the same": ("Quality", [0] * 6, {}, []),
    "good ones that are told": ("State", list("aabbaa"), {"quality": "State", "good": "a"}, [2, 3]),
    "good numbers": ("Flag", [1, 0, 1, 1, 1, 1], {"quality": "Flag", "good": [1]}, [1]),
    "ignored": ("Quality", ["Good", *["Bad"] * 5], {"quality": None}, []),
    "of the output": ("y.Quality", ["Good", "Bad", *["Good"] * 4], {}, [1]),
    "of the output in brackets": ("y (quality)", ["Good", "Bad", *["Good"] * 4], {}, [1]),
    "of another signal": ("z.Quality", ["Good", *["Bad"] * 5], {}, []),
}


@pytest.mark.parametrize("kind", QUALITIES)
def test_samples_of_bad_quality_are_missing(tmp_path, kind):
    header, cells, asked, bad = QUALITIES[kind]
    rows = [f"{at},1,{k},{cell}" for k, (at, cell) in enumerate(zip(STAMPS, cells, strict=True))]
    path = written(tmp_path, f"Timestamp,u,y,{header}", rows)
    said = rf"{len(bad)} of 6 samples are left out, .* in line {bad[0] + 2}" if bad else ""
    with pytest.warns(DataWarning, match=said) if bad else nullcontext():
        record = cr.read_record(path, missing="keep", **asked)
    assert_array_equal(np.flatnonzero(np.isnan(record.output)), bad)
    if bad:
        with pytest.raises(DataError, match=f"line {bad[0] + 2}: its quality is bad"):
            cr.read_record(path, **asked, missing="refuse")


PAIRED = {  # columns, and in which of them the sample 2 is missing
    "tags": ("TIC101/OP,TIC101/OP.quality,TIC101/PV,TIC101/PV.quality", (192, 500), "output"),
    "values": ("A/OP.value,A/OP.quality,A/PV.value,A/PV.quality", (500, 192), "input"),
    "units": ("OP [%],OP Quality,PV [°C],PV Quality", (192, 0), "output"),
    "other marks": ("A_OP,A.OP.Quality,A_PV,A.PV.Quality", (192, 0), "output"),
    "side by side": ("OP,Quality,PV,Quality", (192, 0), "output"),
    "of the loop": ("A.OP,B.Quality,A.PV,A.Quality", (192, 0), "both"),
}


@pytest.mark.parametrize("kind", PAIRED)
def test_each_signal_has_its_own_quality(tmp_path, kind):
    header, codes, missing = PAIRED[kind]
    rows = [[at, 1 + k, 192, k, 192] for k, at in enumerate(STAMPS)]
    rows[2][2], rows[2][4] = codes
    path = written(tmp_path, f"t_stamp,{header}", [",".join(map(str, row)) for row in rows])
    with pytest.warns(DataWarning, match="1 of 5 samples are left out, .* in line 4"):
        record = cr.read_record(path, missing="keep", start=STAMPS[1], input=1, output=3)
    for signal, first in (("input", 2.0), ("output", 1.0)):
        expected = first + np.arange(5.0)
        expected[1] = np.nan if missing in (signal, "both") else expected[1]
        assert_array_equal(getattr(record, signal), expected)


def test_codes_are_told_by_the_whole_column_and_unknown_ones_are_said(tmp_path):
    """A stretch that is bad throughout has no good code beside it."""
    rows = [f"{at},1,{k},{192 if k < 3 else 0}" for k, at in enumerate(STAMPS)]
    path = written(tmp_path, "Timestamp,u,y,Quality", rows)
    with pytest.raises(DataError, match="line 5: its quality is bad"):
        cr.read_record(path, start=STAMPS[3], missing="refuse")
    rows = [f"{at},1,{k},{k % 2}" for k, at in enumerate(STAMPS)]
    path = written(tmp_path, "Timestamp,u,y,y.Quality", rows)
    with pytest.warns(DataWarning, match=r"codes of column 'y.Quality' are not known.*good="):
        assert cr.read_record(path).n_missing == 0
    with pytest.warns(DataWarning, match="3 of 6 samples are left out"):
        assert cr.read_record(path, good=1, missing="keep").n_missing == 3


def test_bad_zeros_do_not_become_dead_time(tmp_path):
    """With bad samples as zeros, the dead time of 90 s was found to be 145 s."""
    rng = np.random.default_rng(11)
    t = 10.0 * np.arange(300)
    u = steps(t, [(0, 40), (600, 50)])
    y = 20 + response(t, u, 2.2, 90, (240,)) + 0.05 * rng.standard_normal(t.size)
    bad = rng.choice(t.size, 25, replace=False)
    quality = np.full(t.size, 192)
    y[bad], quality[bad] = 0.0, 500
    rows = [f"{a},{b},192,{c:.3f},{d}" for a, b, c, d in zip(stamps(t), u, y, quality, strict=True)]
    header = "t_stamp,TIC101/OP,TIC101/OP.quality,TIC101/PV,TIC101/PV.quality"
    path = written(tmp_path, header, rows)
    with pytest.raises(DataError, match=r"missing='keep' leaves such samples out \(25 here\)"):
        cr.read_record(path, missing="refuse")
    with pytest.warns(DataWarning, match="25 of 300 samples are left out"):
        record = cr.read_record(path, missing="hold")
    model = cr.fit_output_error(record, structures="FOPDT")
    assert model.fit.dead_time == pytest.approx(90, abs=2)
    assert model.fit.gain == pytest.approx(2.2, rel=0.01)


@pytest.mark.parametrize("cell", ["Bad", "I/O Timeout", "No Data", "#DIV/0!", "-9999", "dead"])
def test_words_that_stand_for_no_value_are_missing(tmp_path, cell):
    rows = [f"{at},1,{cell if k == 2 else k}" for k, at in enumerate(STAMPS)]
    path = written(tmp_path, "Timestamp,u,y", rows)
    options = {"na_values": [-9999.0, "dead"]} if cell in ("-9999", "dead") else {}
    with pytest.raises(DataError, match=f"line 4: '?{cell}'?: a value is missing; missing='keep'"):
        cr.read_record(path, **options, missing="refuse")
    assert_array_equal(
        cr.read_record(path, missing="keep", **options).output, [0, 1, np.nan, 3, 4, 5]
    )


def test_an_input_holds_its_last_value_where_it_was_not_stored(tmp_path):
    cells = ["1", "Bad", "", "3", "NaN", "4"]
    rows = [f"{at},{cell},{k}" for k, (at, cell) in enumerate(zip(STAMPS, cells, strict=True))]
    path = written(tmp_path, "Timestamp,OP,PV", rows)
    record = cr.read_record(path, missing="hold")
    assert_array_equal(record.input, [1, 1, 1, 3, 3, 4])
    assert_array_equal(record.output, np.arange(6.0))
    kept = cr.read_record(path, missing="keep").input
    assert_array_equal(kept, [1, np.nan, np.nan, 3, np.nan, 4])


def test_a_part_is_read_by_its_dates_newest_first_or_not(tmp_path):
    rows = [f"{at.replace(' ', ',')},{k},{k}" for k, at in enumerate(STAMPS)]
    for lines in (rows, rows[::-1]):
        path = written(tmp_path, "Date,Time,MV,PV", lines)
        part = cr.read_record(path, start="2025-01-01 00:01", stop="2025-01-01 00:04:30")
        assert_array_equal(part.output, [1, 2, 3, 4])
        assert_array_equal(part.time, [60, 120, 180, 240])
        assert_array_equal(cr.read_record(path, start=100, stop=250).output, [2, 3, 4])
    with pytest.raises(OptionError, match=r"start='yesterday'; expected .*'2025-01-01 00:00:00'"):
        cr.read_record(path, start="yesterday")
    with pytest.raises(
        DataError, match=r"0 samples .* covers 0 s to 300 s from 2025-01-01 00:00:00"
    ):
        cr.read_record(path, start="2025-01-02")
    oneday = written(tmp_path, "Time,u,y", [f"1/2/2025 0{k}:00,{k},{k}" for k in range(9)])
    with pytest.raises(
        OptionError, match=r"start='2025-02-01': '1/2/2025 00:00' may be .*time_format"
    ):
        cr.read_record(oneday, start="2025-02-01")
    plain = written(tmp_path, "t,u,y", [f"{k},{k},{k}" for k in range(9)])
    assert_array_equal(cr.read_record(plain, start=2, stop=5).output, [2, 3, 4, 5])
    with pytest.raises(OptionError, match="has no dates"):
        cr.read_record(plain, start="2025-01-01")


def test_tests_are_told_apart_by_a_column_or_by_jumps_of_time(tmp_path):
    rows = [f"{name},{start + k},{k > 3},{k}" for name, start in (("a", 0), ("b", 0), ("c", 500))
            for k in range(8)]  # fmt: skip
    path = written(tmp_path, "test,t,u,y", rows)
    with pytest.raises(TimeAxisError, match=r"several tests, read them with read_records"):
        cr.read_record(path)
    for options, names in (({"by": "test"}, "abc"), ({}, "123")):
        records = cr.io.read_records(path, **options, rest=(0.0, 1.0))
        assert [record.name for record in records] == [f"a {name}" for name in names]
        for record in records:
            assert_array_equal(record.output, [1, *range(8)])
    with pytest.raises(OptionError, match=r"by='x'.*columns 0 'test'"):
        cr.io.read_records(path, by="x")
    with pytest.raises(OptionError, match="expected input and output in the steady state"):
        cr.io.read_records(path, by="test", rest=3)


COLUMNS = {  # names of columns, and which of them are input and output; None is asked about
    "a loop": ("SP,PV,OP", 2, 1),
    "tags": ("TIC101.SP,TIC101.PV,TIC101.OP", 2, 1),
    "tags with units": ("TIC101_MV [%],TIC101_PV [degC],FI_7 [l/h]", 0, 1),
    "words and tags": ("Room,Gas valve CO (%),Zone PV (°C)", 1, 2),
    "German": ("Stellgröße,Istwert,Sollwert", 0, 1),
    "one left beside a set-point": ("CO,Setpoint,Temp", 0, 2),
    "a controller's output and its valve": ("OP,MV,PV", None, None),
    "two loops": ("A_PV,B_PV,OP", 2, None),
    "two loops with dots": ("A.PV,B.PV,OP", 2, None),
}


@pytest.mark.parametrize("kind", COLUMNS)
def test_signals_have_the_names_of_process_control(tmp_path, kind):
    header, input, output = COLUMNS[kind]
    path = written(
        tmp_path, f"millis,{header}", [f"{20 * k},{k},{k + 10},{k + 20}" for k in range(5)]
    )
    if input is None or output is None:
        with pytest.raises(OptionError, match=r"(could be|which column is) the .*it has columns"):
            cr.read_record(path)
        return
    record = cr.read_record(path)
    assert record.dt == 0.02
    assert (record.input[0], record.output[0]) == (10 * input, 10 * output)


def test_percent_signs_and_switches_are_numbers(tmp_path):
    rows = [f"{k},{5 * k}.5 %,{'ON' if k > 2 else 'off'}" for k in range(6)]
    record = cr.read_record(written(tmp_path, "t,y,u", rows))
    assert_array_equal(record.output, 5 * np.arange(6) + 0.5)
    assert_array_equal(record.input, [0, 0, 0, 1, 1, 1])
    assert record.output_units == ("%",)
    rows[2] = rows[2].replace("off", "between")
    with pytest.raises(DataError, match=r"'.*': is not a number"):
        cr.read_record(written(tmp_path, "t,y,u", rows))


@pytest.mark.parametrize("temperature", ["temperature", "pv"])
def test_a_heater_that_is_on_or_off_is_the_input(tmp_path, temperature):
    on = np.repeat([0, 1, 0, 1], [10, 20, 25, 15])
    alarm = ["no"] * on.size  # a switch that does not move is no signal
    rising = 20 + np.cumsum(on) - 0.3 * np.arange(on.size)
    rows = [
        f"{k},{'ON' if u else 'OFF'},{y:.1f},{word}"
        for k, (u, y, word) in enumerate(zip(on, rising, alarm, strict=True))
    ]
    path = written(tmp_path, f"t,heater,{temperature},alarm", rows)
    guessed = pytest.warns(DataWarning, match="'heater' is taken as input")
    with nullcontext() if temperature == "pv" else guessed:
        record = cr.read_record(path)
    assert_array_equal(record.input, on)
    assert_array_equal(record.output, np.round(rising, 1))
    rows[5] = rows[5].replace("OFF", "starting")
    path = written(tmp_path, f"t,heater,{temperature},alarm", rows)
    with pytest.raises(DataError, match="expected ON and OFF, or 1 and 0, in a column of a switch"):
        cr.read_record(path, input="heater", output=temperature)


def test_a_column_in_percent_has_a_percent_sign_in_every_cell(tmp_path):
    """What Excel shows as 50 % is stored as 0.5: cells of two formats are no signal."""
    rows = [f"{k},1,{'100%' if k in (3, 4) else '1.0'}" for k in range(6)]
    for text in rows, [row.replace("1.0", "100 %") for row in rows[:5]] + ["5,1,1.5"]:
        place = "line 5" if text is rows else "line 2"
        with pytest.raises(DataError, match=rf"'y' has \d cells with .*{place}\) and '1.*one unit"):
            cr.read_record(written(tmp_path, "t,u,y", text))
    openpyxl = pytest.importorskip("openpyxl")
    for mixed in (True, False):
        book = openpyxl.Workbook()
        sheet = book.active
        sheet.append(["t", "u", "y"])
        for k in range(6):
            sheet.append([k, 1, 0.5 + k])
            sheet.cell(k + 2, 3).number_format = "General" if mixed and k > 3 else "0%"
        book.save(tmp_path / "a.xlsx")
        if mixed:
            with pytest.raises(DataError, match=r"4 .* 2 without, .*\(row 2\) and '4.5' \(row 6\)"):
                cr.read_record(tmp_path / "a.xlsx")
        else:
            record = cr.read_record(tmp_path / "a.xlsx")
            assert_array_equal(record.output, 50 + 100 * np.arange(6))
    none = [f"{k},1,{'0' if k == 2 else f'{k + 1}%'}" for k in range(6)]
    assert_array_equal(cr.read_record(written(tmp_path, "t,u,y", none)).output, [1, 2, 0, 4, 5, 6])


OWN_MISTAKES = {  # what is wrong, and the option that the message offers
    "columns": ("t,a,b,c", "{k},{k},{k},{k}", "--input NAME-OR-NUMBER"),
    "a date": ("time,u,y", "0{k}/02/2026 10:00,{k},{k}", "--time-format '%d/%m/%Y %H:%M'"),
    "a clock": ("time,u,y", "{k}:00,{k},{k}", "--time-unit h or --time-unit min"),
    "no time": ("a,u,y", "{k},{k},{k}", "or --dt in s"),
    "a gap": ("t,u,y", "{gap},{k},{k}", "--missing hold holds its value"),
    "a constant input": ("t,u,y", "{k},5,{k}", "--rest U0 Y0"),
}


@pytest.mark.parametrize("kind", OWN_MISTAKES)
def test_the_command_line_offers_options_and_no_arguments_of_python(tmp_path, capsys, kind):
    header, row, told = OWN_MISTAKES[kind]
    lines = [row.format(k=k, gap=k + 20 * (k > 4)) for k in range(1, 8)]
    path = written(tmp_path, header, lines)
    assert main(["identify", str(path), "-o", str(tmp_path / "out"), "--method", "scan"]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert not any(f"{name}=" in said for name in ("time", "input", "missing", "dt", "resample"))
    assert "read_record" not in said


def test_every_argument_of_the_readers_is_an_option(capsys):
    reader = set(inspect.signature(cr.read_record).parameters) - {"path", "name"}
    units = {"frequency_unit", "magnitude_unit", "phase_unit"}
    assert reader | units | {"by", "gains", "actuator"} <= ARGUMENTS
    assert main(["identify", "--help"]) == 0
    said = capsys.readouterr().out
    assert [name for name in reader | units if f"{option_of(name)}" not in said] == []


def test_joint_fits_and_steady_states_have_options(folder, tmp_path):
    grid = np.geomspace(0.02, 1, 20)
    s = 2j * np.pi * grid
    frf = np.exp(-0.6 * s) / (0.8 * s + 1)
    table = pd.DataFrame({"f": grid, "re": frf.real, "im": frf.imag})
    table.to_csv(tmp_path / "frf.csv", index=False)
    four, start = folder / "four_tests.csv", folder / "step_at_start.csv"
    columns = {"input": "valve", "output": "flow"}
    tests = cr.io.read_records(four, by="test", **columns)
    response = cr.read_frf(tmp_path / "frf.csv", frequency="f", real="re", imag="im")
    for words, expected in (
        ([str(four), "--by", "test", "--gains", "own", "--input", "valve", "--response", "flow",
          "--structures", "P1D"],
         cr.identify(tests, structures="P1D", gains="own")),
        ([str(start), "--rest", "0", "20.3", "--joint", "--frf", str(tmp_path / "frf.csv"),
          "--frequency", "f", "--real", "re", "--imag", "im", "--order", "1"],
         cr.identify(cr.read_record(start, rest=(0, 20.3)), order=1, frf=response)),
        ([str(start), "--rest", "0", "20.3", "--actuator", "slew_rate", "--order", "1"],
         cr.identify(cr.read_record(start, rest=(0, 20.3)), order=1, actuator="slew_rate")),
    ):  # fmt: skip
        out = tmp_path / "out"
        more = ["--no-report", "--overwrite"]
        assert main(["identify", *words, "-o", str(out), *more]) == 0
        stored = cr.load_model(out / "model.json")
        assert stored.dead_time == expected.dead_time
        assert stored.fit.choices == expected.fit.choices
        # the command that is kept makes the same model
        command = shlex.split(json.loads((out / "manifest.json").read_text())["command"])
        assert main([*command[1:], "-o", str(tmp_path / "again"), "--no-report"]) == 0
        again = cr.load_model(tmp_path / "again" / "model.json")
        assert again.dead_time == expected.dead_time
        (tmp_path / "again").rename(tmp_path / f"again {len(words)}")
        assert not (out / "report.html").exists()
    both = ["--by", "test", "--split"], ["--joint", "--separate"]
    for words in both:
        assert main(["identify", str(four), "-o", str(tmp_path / "none"), *words]) == 2
