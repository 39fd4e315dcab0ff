"""Text files as they come from loggers, scopes, spreadsheets and other programs."""

import csv
import math
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, DataWarning, FileFormatError, OptionError, TimeAxisError
from ctrl_realize.io import read_record
from ctrl_realize.io.text.csv_files import as_text, write_csv

U = np.array([0.0, 0.0, 1.5, 1.5, -1.5])
Y = np.array([10.25, 10.0, 9.75, 12.5, 12.0])
T = np.array([0.0, 0.5, 1.0, 1.5, 2.0])


def check(record, *, time=T, input=U, output=Y):
    assert_array_equal(record.time, time)
    assert_array_equal(record.input, input)
    assert_array_equal(record.output, output)


def table(delimiter=",", decimal=".", header=None, end="\n", last_end=True, columns=(T, U, Y)):
    """The record above, written in one of many ways."""
    lines = [] if header is None else [header]
    for row in zip(*columns, strict=True):
        lines.append(delimiter.join(f"{value:g}".replace(".", decimal) for value in row))
    return end.join(lines) + (end if last_end else "")


PLAIN = "time,input,output"
GERMAN = "Zeit [s];Eingang [mA];Ausgang [V]"

LAST = "t,u,y\n0,0,10.2500\n0.5,0,10.0000\n1,1.5,9.7500\n1.5,1.5,12.5000\n2,-1.5,12.0000"
WRITTEN = {
    "plain": table(header=PLAIN),
    "no header": table(),
    "no line end at the end": table(header=PLAIN, last_end=False),
    "carriage returns": table(header=PLAIN, end="\r\n"),
    "old Macintosh": table(header=PLAIN, end="\r"),
    "tabs": table("\t", header="t\tu\ty"),
    "semicolons, decimal comma": table(";", ",", GERMAN),
    "tabs, decimal comma": table("\t", ",", "t\tu\ty"),
    "blanks, decimal comma": table("  ", ",", "t u y"),
    "bars": table("|", header="t|u|y"),
    "aligned with blanks": table("   ", header="   t    u    y").replace("\n", "\n "),
    "names with blanks": table("  ", header="Time (s)  input signal  output signal"),
    "comma and blank": table(", ", header="t, u, y"),
    "quoted header": table(header='"time","input","output"'),
    "quoted numbers": '"' + table('","', header='t","u","y', end='"\n"', last_end=False) + '"\n',
    "quotes after blanks": "t, u, y\n"
    + "".join(f'{t:g}, "{u:g}", "{y:g}"\n' for t, u, y in zip(T, U, Y, strict=True)),
    "quoted decimal commas": "t,u,y\n"
    + "".join(
        ",".join(f'"{value:g}"'.replace(".", ",") for value in row) + "\n"
        for row in zip(T, U, Y, strict=True)
    ),
    "units below the names": table(header="time,input,output\ns,mA,V"),
    "units in brackets below": table(header="time,input,output\n[s],[mA],[V]"),
    "comments above": table(header="# bench 3\n# valve\ntime,input,output"),
    "header in a comment, as savetxt": table(" ", header="# time input output"),
    "header in a comment, other delimiter": table(",", header="# time input output"),
    "percent comments": table(header="% made by hand\nt,u,y"),
    "a unit that begins as a comment": table(header="u,t,y\n%,ms,mV", columns=(U, 1e3 * T, Y)),
    "dates with blanks between tabs, and remarks": "t\tu\ty\tstate\n"
    + "".join(
        f"2025-03-04 09:00:{t:04.1f}\t{u:g}\t{y:g}\tno alarm\n"
        for t, u, y in zip(T, U, Y, strict=True)
    ),
    "words above": table(header="Bench 3\nMonday\n\ntime,input,output"),
    "scope settings above": table(header="Sample Interval,0.5\nPoints,5\n\ntime,input,output"),
    "blank lines": table(header=PLAIN, end="\n\n"),
    "lines of blanks": table(header=PLAIN).replace("\n", "\n   \n", 3),
    "empty rows of a spreadsheet": table(header=PLAIN) + ",,\n,,\n",
    "delimiter at the end": table(header=PLAIN).replace("\n", ",\n"),
    "delimiter at the end of the data": PLAIN + "\n" + table().replace("\n", ",\n"),
    "a comment in the middle": table(header="# log\n" + PLAIN).replace("\n1,", "\n# restart\n1,"),
    "other order": table(header="output,time,input", columns=(Y, T, U)),
    "capital letters": table(header="TIME,Input,OUTPUT"),
    "a column of text": "t,u,y,remark\n"
    + "".join(f"{t:g},{u:g},{y:g},good\n" for t, u, y in zip(T, U, Y, strict=True)),
    "one signal by its name": table(header="t,u,pressure"),
    "digits up to the end, which is no line end": LAST,
    "an empty line at the end": LAST + "\n\n",
    "a last number as short as others": LAST.replace("00", ""),
    "exponents": "t,u,y\n"
    + "".join(f"{t:.3e},{u:+.2E},{y:.4e}\n" for t, u, y in zip(T, U, Y, strict=True)),
}  # fmt: skip


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN.keys())
def test_the_same_record_is_read_however_it_is_written(tmp_path, text):
    file = tmp_path / "record.csv"
    file.write_bytes(text.encode())
    check(read_record(file))


@pytest.mark.parametrize("above", ["", "# bench 3\n"])
@pytest.mark.parametrize("order", ["y,t,u", "t,y,u", "t,u,y"])
def test_a_row_that_begins_with_a_missing_value_of_excel_is_no_comment(tmp_path, order, above):
    # the moves of the input in such rows were lost: dead times two samples too short
    cells = {"t": [f"{t:g}" for t in T], "u": [f"{u:g}" for u in U], "y": [f"{y:g}" for y in Y]}
    cells["y"][2] = "#N/A"
    rows = [",".join(cells[name][k] for name in order.split(",")) for k in range(T.size)]
    (tmp_path / "a.csv").write_text(above + "\n".join([order, *rows]) + "\n")
    record = read_record(tmp_path / "a.csv", missing="keep")
    np.testing.assert_array_equal(record.time, T)
    np.testing.assert_array_equal(record.input, U)
    np.testing.assert_array_equal(record.output, np.where(np.arange(T.size) == 2, np.nan, Y))


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252"]
)
def test_the_encoding_does_not_matter(tmp_path, encoding):
    file = tmp_path / "größe.csv"
    file.write_bytes(table(";", ",", "Zeit [s];Eingang;Ausgang [°C]").encode(encoding))
    record = read_record(file)
    check(record)
    assert record.name == "größe"


@pytest.mark.parametrize("choice", [{"input": "in", "output": "out"}, {"input": 2, "output": 1}])
def test_columns_are_chosen_by_name_or_number(tmp_path, choice):
    file = tmp_path / "a.csv"
    file.write_text(table(header="t,out,in,extra", columns=(T, Y, U, T)))
    check(read_record(file, **choice))


def test_a_file_without_time_takes_dt_and_rows_are_left_out_on_request(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text(table(columns=(U, Y)))
    check(read_record(file, dt=0.5))
    check(read_record(file, dt=0.5, input=0, output=1))
    file.write_text("9,9,9\n1,2,3\n" + table())
    check(read_record(file, skip_rows=2))
    check(read_record(file, skip_rows=1, header=True, time=0, input=1, output=2))


@pytest.mark.parametrize(
    ("header", "unit", "factor"),
    [("t_ms,u,y", "auto", 1e3), ("t [us],u,y", "auto", 1e6), ("t,u,y\nms,V,V", "auto", 1e3),
     ("t,u,y", "ms", 1e3), ("t_ms,u,y", "s", 1.0), ("t/min,u,y", "auto", 1 / 60)],
)  # fmt: skip
def test_time_is_in_seconds_whatever_its_unit(tmp_path, header, unit, factor):
    file = tmp_path / "a.csv"
    file.write_text(header + "\n" + "".join(f"{k * 30 * factor!r},{k},{k}\n" for k in range(5)))
    # half an ulp from writing in the other unit, half from dividing
    np.testing.assert_allclose(
        read_record(file, time_unit=unit).time, 30.0 * np.arange(5), rtol=3e-16
    )


@pytest.mark.parametrize(
    "stamps",
    [
        ["2026-03-01 11:59:59.900", "2026-03-01 12:00:00.000", "2026-03-01 12:00:00.100"],
        ["2026-03-01T11:59:59,900", "2026-03-01T12:00:00,000", "2026-03-01T12:00:00,100"],
        ["2026-03-01T11:59:59.9Z", "2026-03-01T12:00:00Z", "2026-03-01T12:00:00.1Z"],
        ["2026-03-01T11:59:59.9+01:00", "2026-03-01T13:00:00+02:00", "2026-03-01T11:00:00.1Z"],
        ["11:59:59.9", "12:00:00.0", "12:00:00.1"],
        ["23:59:59.9", "00:00:00.0", "00:00:00.1"],
    ],
)
def test_dates_and_times_of_day_count_from_the_first_row(tmp_path, stamps):
    file = tmp_path / "a.csv"
    file.write_text("timestamp;u;y\n" + "".join(f"{stamp};1;2\n" for stamp in stamps))
    # nanoseconds are exact
    np.testing.assert_allclose(read_record(file).time, [0.0, 0.1, 0.2], rtol=0, atol=1e-15)


def test_jitter_is_refused_and_resampled_on_request(tmp_path):
    file = tmp_path / "a.csv"
    times = np.arange(50.0) + 0.2 * np.sin(np.arange(50.0))
    file.write_text(table(header="t,u,y", columns=(times, times, 2 * times)))
    with pytest.raises(TimeAxisError, match=r"a\.csv.*resample=True"):
        read_record(file, missing="refuse")
    record = read_record(file, resample=True)
    # linear signals are interpolated exactly, up to the six digits in the file
    np.testing.assert_allclose(record.output, 2 * record.time, atol=1e-4)


CUT = {
    "in a number": "1.5,1.5,12.5000\n2,-1.5,12.0",
    "before a number": "1.5,1.5,12.5000\n2,-1.5,",
    "after a sign": "1.5,1.5,12.5000\n2,-1.5,-",
    "in an exponent": "1.5,1.5,12.5000\n2,-1.5,1.2e-",
    "a column early": "1.5,1.5,12.5000\n2,-1",
    "in the first column": "1.5,1.5,12.5000\n2",
    "with zeros behind": "1.5,1.5,12.5000\n2,-1.5,12\0\0\0\0",
    "and a line of zeros": "1.5,1.5,12.5000\n\0\0\0\0\0\0\0",
    "and a line end": "1.5,1.5,12.5000\n2,-1.5\n",
}


@pytest.mark.parametrize("end", CUT.values(), ids=CUT.keys())
def test_a_last_line_that_was_cut_is_left_out_with_a_warning(tmp_path, end):
    file = tmp_path / "a.csv"
    file.write_text("t,u,y\n0,0,10.2500\n0.5,0,10.0000\n1,1.5,9.7500\n" + end)
    with pytest.warns(DataWarning, match="the last line is skipped") as caught:
        record = read_record(file)
    check(record, time=T[:4], input=U[:4], output=Y[:4])
    assert caught[0].filename == __file__


BAD = {
    "text": ("1,1.5,high\n", DataError, r"column 'y', line 4: 'high': is not a number"),
    "NaN": ("1,1.5,NaN\n", DataError, r"column 'y', line 4: 'NaN': a value is missing"),
    "nothing": ("1,,3\n", DataError, r"column 'u', line 4: '': a value is missing"),
    "infinity": ("1,inf,3\n", DataError, r"column 'u', line 4: inf is not finite"),
    "too large": ("1,1e999,3\n", DataError, r"line 4: (inf|1e999) is not finite .or too large"),
    "hexadecimal": ("1,0x10,3\n", DataError, r"'0x10': is not a number"),
    "underscore": ("1,1_0,3\n", DataError, r"'1_0': is not a number"),
    "other digits": ("1,²,3\n", DataError, r"'²': is not a number"),
    "decimal comma": ('1,"1,5",3\n', DataError, r"'1,5': is not a number; try decimal="),
    "too many cells": ("1,2,3,4\n", FileFormatError, r"Expected 3 fields in line 4, saw 4"),
    "too few cells": ("1,2\n", DataError, r"column 'y', line 4: ''"),
    "time twice": ("0.5,1,2\n", TimeAxisError, r"a\.csv \(line 4\): .* row 2"),
    "time back": ("0.25,1,2\n", TimeAxisError, r"a\.csv \(line 4\): .* row 2"),
    "a gap": ("", TimeAxisError, r"a\.csv \(line 4\): .* row 2"),
    "a quote": ('1,"2,3\n', FileFormatError, "EOF inside string"),
}


@pytest.mark.parametrize(("row", "error", "match"), BAD.values(), ids=BAD.keys())
def test_a_bad_row_is_named(tmp_path, row, error, match):
    file = tmp_path / "a.csv"
    file.write_text("t,u,y\n0,0,1\n0.5,0,1\n" + row + "1.5,0,1\n2,0,1\n2.5,0,1\n3,0,1\n")
    with pytest.raises(error, match=match):
        read_record(file, missing="refuse")


@pytest.mark.parametrize(
    ("text", "kwargs", "match"),
    [
        ("t,valve,level,flow\n", {}, r"which column is the input.*1 'valve', 2 'level', 3 'flow'"),
        ("t,u,level,flow\n", {}, r"which column is the output.*2 'level', 3 'flow'"),
        ("a,u,y,b\n", {}, r"which column is time; give time=name or number, or dt="),
        ("t,time,u,y\n", {}, r"2 columns that could be time"),
        ("t,u,y,y\n", {"output": "y"}, r"matches 2 columns"),
        ("t,u,y,z\n", {"input": "U2"}, r"input='U2'.*columns 0 't', 1 'u'"),
        ("t,u,y,z\n", {"input": 4}, r"input=4.*count from 0"),
        ("t,u,y,z\n", {"input": -1}, r"input=-1.*count from 0"),
        ("t,u,y,z\n", {"input": True}, r"must be a column's name or number"),
        ("t,u,y,z\n", {"input": []}, r"must name one or more"),
        ("t,u,y,z\n", {"time": 0, "dt": 1.0}, r"got both"),
        ("t,u,y,z\n", {"dt": -1.0}, r"dt=-1.0; expected a positive"),
        ("t,u,y,z\n", {"dt": math.nan}, r"dt=nan; expected a finite number"),
        ("t,u,y,z\n", {"input": "u", "output": "u"}, r"selected twice"),
        ("t [ticks],u,y,z\n", {}, r"'ticks' is not a known unit of time"),
        ("t,u,y,z\n", {"time_unit": "years"}, r"'years' is not a known unit of time"),
        ("", {}, r"which column is the input.*4 columns without a header"),
        ("", {"delimiter": ",,"}, r"delimiter=',,' must be one character"),
        ("", {"decimal": "'"}, r"decimal=.* must be '\.', ','"),
        ("", {"header": 3}, r"header=3 must be"),
        ("", {"skip_rows": -1}, r"skip_rows=-1"),
        ("", {"comment": "REM"}, r"comment='REM' must be one"),
        ("", {"max_bytes": 0}, r"max_bytes=0"),
    ],
)  # fmt: skip
def test_what_is_not_clear_is_asked(tmp_path, text, kwargs, match):
    file = tmp_path / "a.csv"
    file.write_text(text + table(columns=(T, U, Y, Y)))
    with pytest.raises(OptionError, match=match):
        read_record(file, **kwargs)


def test_missing_values_can_be_kept(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("t,u,y\n0,0,1\n1,,2\n2,1,NaN\n3,1,N/A\n4,1,5\n")
    record = read_record(file, missing="keep")
    assert_array_equal(record.input, [0, np.nan, 1, 1, 1])
    assert_array_equal(record.output, [1, 2, np.nan, np.nan, 5])
    with pytest.raises(DataError, match="line 3: '': a value is missing; missing='keep'"):
        read_record(file, missing="refuse")
    with pytest.raises(OptionError, match="missing='drop'"):
        read_record(file, missing="drop")
    with pytest.raises(OptionError, match="missing='keep' and resample=True"):
        read_record(file, missing="keep", resample=True)
    file.write_text("t,u,y\n0,0,1\n1,inf,2\n2,1,3\n3,1,4\n4,1,5\n")
    with pytest.raises(DataError, match="not finite"):
        read_record(file, missing="keep")
    file.write_text("t,u,y\n0,0,1\n,1,2\n2,1,3\n3,1,4\n4,1,5\n")
    with pytest.raises(DataError, match="column 't', line 3"):
        read_record(file, missing="keep")


@given(
    st.lists(st.tuples(*[st.floats(-1e70, 1e70)] * 2), min_size=3, max_size=20),
    st.sampled_from([",", ";", "\t", " ", "|"]),
    st.booleans(),
)
def test_every_double_comes_back_to_the_last_bit(tmp_path_factory, rows, delimiter, header):
    lines = ["u y".replace(" ", delimiter)] * header
    lines += [f"{u!r}{delimiter}{y!r}" for u, y in rows]
    file = tmp_path_factory.mktemp("bits") / "a.csv"
    file.write_text("\n".join(lines) + "\n")
    record = cr.read_record(file, dt=1.0)
    assert_array_equal(record.input, [u for u, _ in rows])
    assert_array_equal(record.output, [y for _, y in rows])


N = 12


def rows(count=N):
    return [[f"{0.1 * k:.1f}", f"{k % 2}", f"{k + 0.25:.2f}"] for k in range(count)]


FORMULA_SIGNS = "=+-@\t\r\n\uff1d\uff0b\uff0d\uff20"
NAMES = [
    "=cmd|'/c calc'!A1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "\uff1d1", "valve;=1+1",
    "valve\n=1", "'=1", "'", "", "NaN", "1e5", 'say "=1"', "a,b", "a\rb", "a\r\nb", "valve 16 mA",
]  # fmt: skip


def plain(text: str) -> str:
    """The name that a cell stands for: as the documentation says, without one apostrophe."""
    return re.sub(rf"(^|[;\t\r\n])'(?='*[{re.escape(FORMULA_SIGNS)}])", r"\1", text)


@pytest.mark.parametrize("name", NAMES)
def test_no_cell_of_a_spreadsheet_begins_as_a_formula(name):
    # also where the semicolon ends a cell, and where line ends are not in quotes
    for cell in re.split("[;\t\r\n]", as_text(name)):
        assert cell[:1] not in tuple(FORMULA_SIGNS)


def test_names_and_numbers_are_read_as_they_were_written(tmp_path):
    values = np.resize([0.1, 1 / 3, -5e-324, 1e300, np.inf, np.nan], len(NAMES))
    table = pd.DataFrame({"delay": values}, index=pd.Index(NAMES, name="record"))
    write_csv(tmp_path / "a.csv", table, index=True)
    again = pd.read_csv(tmp_path / "a.csv", keep_default_na=False, na_values={"delay": [""]})
    assert [plain(name) for name in again["record"]] == NAMES
    np.testing.assert_array_equal(again["delay"], values)


CHOSEN = {
    "mimo.csv": ("heater_1 heater_2", "temperature_1 temperature_2"),
    "prbs_irregular.csv": ("heater_percent", "temperature_degC"),
    "sugar_actuator_first_half.csv": ("command_percent", "flow"),
}
"""Measured files whose names do not tell input from output: the user does."""
IRREGULAR = {"apm_1.csv", "apm_2.csv", "mimo.csv", "prbs_irregular.csv"}
"""Measured files with time stamps a twentieth of a sample and more off the uniform grid."""
DATES = {"LIC-106_historian.csv"}


def test_every_measured_record_in_text_is_read_to_the_last_bit(shared_data):
    files = [f for f in shared_data.rglob("*.csv") if f.name not in IRREGULAR | DATES]
    files = [f for f in files if "frequency" not in f.read_text().partition("\n")[0]]
    assert len(files) >= 25
    for file in files:
        names = file.read_text().partition("\n")[0].split(",")
        inputs = [name for name in names if name.startswith("input") or name == "op"]
        outputs = [name for name in names if name.startswith("output") or name == "pv"]
        if file.name in CHOSEN:
            inputs, outputs = (chosen.split() for chosen in CHOSEN[file.name])
            with pytest.raises(OptionError, match="which column is the"):
                read_record(file)
            record = read_record(file, input=inputs, output=outputs)
        else:
            record = read_record(file)
        # NumPy's own reader is the second opinion
        table = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)
        assert_array_equal(record.time, table[0])
        assert_array_equal(np.atleast_2d(record.input), table[[names.index(n) for n in inputs]])
        assert_array_equal(np.atleast_2d(record.output), table[[names.index(n) for n in outputs]])


def test_measured_time_stamps_that_are_not_uniform_are_refused_with_the_place(shared_data):
    files = [f for f in shared_data.rglob("*.csv") if f.name in IRREGULAR]
    assert files
    for file in files:
        chosen = CHOSEN.get(file.name)
        columns = {} if chosen is None else {"input": chosen[0], "output": chosen[1]}
        columns = {name: names.split() for name, names in columns.items()}
        with pytest.raises(TimeAxisError, match=r"\(line \d+\): time"):
            read_record(file, **columns, missing="refuse")


def test_a_stray_quote_that_swallows_lines_is_told(tmp_path):
    lines = [",".join([*row, "note"]) for row in rows()]
    lines[4] = lines[4].replace("note", '"note')
    path = tmp_path / "a.csv"
    path.write_text("time_s,u,y,remark\n" + "\n".join(lines) + "\n")
    with pytest.raises(FileFormatError, match=r"are its quotes|is not a table"):
        read_record(path)


@pytest.mark.parametrize(
    ("header", "unit", "cells", "dt"),
    [
        ("time", "min", ["59:58", "59:59", "00:00"], 1.0),
        ("time", "h", ["23:58", "23:59", "00:00"], 60.0),
        ("time [mm:ss]", "auto", ["00:59.5", "01:00.0", "01:00.5"], 0.5),
        ("time [hh:mm]", "auto", ["99:58", "99:59", "100:00"], 60.0),
        ("time", "min", ["119:59", "120:00", "120:01"], 1.0),
        ("time", "auto", ["23:59:59.9", "00:00:00.0", "00:00:00.1"], 0.1),
        ("time", "auto", ["00:05", "00:05", "00:05"], r"line 2.*time_unit='h' or time_unit='min'"),
        ("time", "auto", ["12:34.5"] * 3, r"line 2.*time_unit='h' or time_unit='min'"),
        ("time", "min", ["59:58", "59:59", "1:00:00"], "two and three fields"),
    ],
)
def test_a_clock_runs_in_the_unit_that_was_said_or_is_asked_about(
    tmp_path, header, unit, cells, dt
):
    path = tmp_path / "a.csv"
    path.write_text(f"{header},u,y\n" + "".join(f"{cell},{k},1\n" for k, cell in enumerate(cells)))
    if isinstance(dt, float):
        assert read_record(path, time_unit=unit).dt == pytest.approx(dt, rel=1e-12)
    else:
        with pytest.raises((OptionError, DataError), match=dt):
            read_record(path, time_unit=unit)


@pytest.mark.parametrize(
    ("header", "cells", "quoted"),
    [
        ("Timestamp", ["Mar 04, 2025 23:57:00"] * 4, "'Mar 04, 2025 23:57:00' is neither"),
        ("Timestamp", ["03/04/2025, 11:57:00 PM"] * 4, "'03/04/2025, 11:57:00 PM' is neither"),
        ("time", ["12:34,5"] * 4, "'12:34,5' in line 2 may be"),
        ("time", ["12:34:56,5", "12:34,5"] * 2, "such as '12:34,5'; expected one kind"),
        ("Date;Time", ["1.2.2025;12:34:56,5"] * 3 + ["1.2.2025;noon,5"], "'1.2.2025 noon,5'"),
    ],
)
def test_a_time_that_is_none_is_quoted_as_it_stands_in_the_file(tmp_path, header, cells, quoted):
    path = tmp_path / "a.csv"
    path.write_text(f"{header};u;y\n" + "".join(f"{at};{k};1\n" for k, at in enumerate(cells)))
    with pytest.raises((OptionError, DataError), match=quoted):
        read_record(path)


@pytest.mark.parametrize(
    ("delimiters", "cells", "clear"),
    [
        (",", ["1,234", "2,345", "3,456"], False),
        (",", ["999", "1,001", "1,003"], False),
        (";\t", ["998", "999", "1,000"], False),
        (",;", ["1,234", "2,345", "0,456"], True),
        (",;", ["1,25", "2,345", "3,4"], True),
        (";", [f"{k + 1},125" for k in range(N)], True),
    ],
)
def test_commas_that_may_divide_thousands_are_asked_about(tmp_path, delimiters, cells, clear):
    path = tmp_path / "a.csv"
    for delimiter in delimiters:
        with path.open("w", newline="") as file:
            writer = csv.writer(file, delimiter=delimiter)
            writer.writerows([["time_s", "u", "y"], *([k, k, c] for k, c in enumerate(cells))])
        if not clear:
            with pytest.raises(
                FileFormatError, match=r"may be \d\.\d{3} or \d{4}; give decimal=','"
            ):
                read_record(path)
        read = read_record(path, **({} if clear else {"decimal": ","})).output
        np.testing.assert_array_equal(read, [float(c.replace(",", ".")) for c in cells])


def test_nanoseconds_since_1970_keep_their_steps(tmp_path):
    file = tmp_path / "a.csv"
    start = 1_774_000_000_123_456_789
    file.write_text("t_ns,u,y\n" + "".join(f"{start + 78_125 * k},{k},{k}\n" for k in range(50)))
    np.testing.assert_allclose(read_record(file).time, 78_125e-9 * np.arange(50), rtol=3e-16)


CLOCKS = {  # how the column of time is written, and what its sample time is in the unit asked for
    "ms since 1970": (lambda k: f"{1_770_000_000_000 + 100 * k}", "ms", 0.1, "time_ms"),
    "us since 1970": (lambda k: f"{1_770_000_000_000_000 + 100_000 * k}", "us", 0.1, "time_us"),
    "ns since 1970": (lambda k: f"{1_770_000_000 * 10**9 + 10**8 * k}", "ns", 0.1, "time_ns"),
    "Excel": (lambda k: f"{46085.5 + k / 86400:.9f}", "day", 1.0, "time [days]"),
    "Excel, every hour": (lambda k: f"{46085.5 + k / 24:.9f}", "day", 3600.0, "time [days]"),
    "datenum": (lambda k: f"{739000.25 + k / 86400:.9f}", "day", 1.0, "time [days]"),
}


@pytest.mark.parametrize("kind", CLOCKS)
def test_a_clock_since_1970_or_in_days_is_not_taken_for_seconds(tmp_path, kind):
    cell, unit, dt, header = CLOCKS[kind]
    file = tmp_path / "logger.csv"
    lines = "\n".join(f"{cell(k)},0,{k}" for k in range(5)) + "\n"
    file.write_text("time,u,y\n" + lines)
    taken = "days since" if unit == "day" else f"{unit} since 1970"
    with pytest.warns(DataWarning, match=f"is taken for {taken}.*time_unit= says otherwise"):
        assert read_record(file).dt == pytest.approx(dt, rel=1e-4)
    assert read_record(file, time_unit="s").dt != pytest.approx(dt, rel=1e-4)
    assert read_record(file, time_unit=unit).dt == pytest.approx(dt, rel=1e-4)  # nine decimals
    file.write_text(f"{header},u,y\n" + lines)
    assert read_record(file).dt == pytest.approx(dt, rel=1e-4)


def test_a_clock_of_seconds_may_show_what_a_day_count_shows_but_is_not_coarse(tmp_path):
    file = tmp_path / "uptime.csv"
    file.write_text("time,u,y\n" + "".join(f"{46085.5 + k / 1000:.3f},0,{k}\n" for k in range(50)))
    assert read_record(file).dt == pytest.approx(1e-3)
    file.write_text("time,u,y\n" + "".join(f"{k // 10},0,{k}\n" for k in range(40)))
    with pytest.raises(TimeAxisError, match="clock is coarser than the sample time, give dt="):
        read_record(file)
    assert read_record(file, dt=0.1).n_samples == 40


@pytest.mark.parametrize(
    ("header", "cells", "dt"),
    [
        ("time [s]", [f"{2 * k}" for k in range(30)], 2.0),
        ("time [ms]", [f"{2000 * k}" for k in range(30)], 2.0),
        ("time [s]", [f"{k / 3:.2f}" for k in range(30)], 1 / 3),
        ("time [s]", [f"{math.floor(1.25 * k)}" for k in range(101)], 1.25),
        ("time", [f"2026-03-04 09:{k // 30:02d}:{2 * (k % 30):02d}" for k in range(90)], 2.0),
    ],
)
def test_a_sample_time_other_than_that_of_the_time_column_is_refused(tmp_path, header, cells, dt):
    file = tmp_path / "log.csv"
    lines = "".join(f"{cell},{k % 2},{k}\n" for k, cell in enumerate(cells))
    file.write_text(f"{header},u,y\n{lines}")
    assert read_record(file, dt=dt).dt == dt
    with pytest.raises(OptionError, match=r"has times every [\d.]+ s, and dt=5 s .* omit dt="):
        read_record(file, dt=5.0)


def test_a_time_column_that_is_not_clear_leaves_the_sample_time(tmp_path):
    file = tmp_path / "log.csv"
    lines = "".join(f"{2 * k},{k % 2},{k}\n" for k in range(30))
    file.write_text("t,u,y\n" + lines)
    with pytest.warns(DataWarning, match="column 't' has times every 2, without a unit; dt=5 s"):
        assert read_record(file, dt=5.0).dt == 5.0
    assert read_record(file, dt=2.0).dt == 2.0
    file.write_text("t,u,y\n" + lines.replace("0,", "noon,", 1))
    assert read_record(file, dt=5.0).dt == 5.0
    file.write_text("time [s],u,y\n0,1,2\n")
    with pytest.raises(DataError, match=r"time has shape \(1,\)"):
        read_record(file, dt=5.0)


@pytest.mark.parametrize("start", ["2025-01-31 23:59:30", "2025-01-02 23:59:30"])
@pytest.mark.parametrize(
    "form",
    ["%Y-%m-%d %H:%M:%S", "%Y/%m/%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%y %H:%M:%S,%f",
     "%d/%m/%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%d-%b-%y %H:%M:%S"],
)  # fmt: skip
def test_dates_of_the_world_stand_beside_text_and_numbers(tmp_path, form, start):
    file = tmp_path / "a.csv"
    stamps = pd.date_range(start, periods=8, freq="10s").strftime(form)
    delimiter = ";" if "," in form else ","
    lines = [
        delimiter.join((stamp, "1.0", f"{k}.5", "Good", "x", "y", "z"))
        for k, stamp in enumerate(stamps)
    ]
    names = "date time,u,y,Quality,Unit,Operator,Remark".replace(",", delimiter)
    file.write_text("\n".join([names, *lines]) + "\n")
    assert_array_equal(read_record(file).time, 10.0 * np.arange(8))


def test_a_clock_of_half_days_needs_no_date(tmp_path):
    file = tmp_path / "a.csv"
    stamps = pd.date_range("2025-01-02 11:58:30", periods=8, freq="30s").strftime("%I:%M:%S %p")
    file.write_text("Time,u,y\n" + "".join(f"{one},{k},{k}\n" for k, one in enumerate(stamps)))
    assert_array_equal(read_record(file).time, 30.0 * np.arange(8))


def test_dates_whose_day_and_month_cannot_be_told_apart_are_asked_about(tmp_path):
    file = tmp_path / "a.csv"
    rows = [f"0{k}/02/2026 10:00:00,{k},{k}" for k in range(1, 5)]
    file.write_text("\n".join(["date time,u,y", *rows]) + "\n")
    with pytest.raises(OptionError, match=r"column 'date time'.*time_format='%d/%m/%Y.*'%m/%d/%Y"):
        read_record(file)
    with pytest.raises(OptionError, match="time_format='%' is not a time format"):
        read_record(file, time_format="%")
    record = read_record(file, time_format="%d/%m/%Y %H:%M:%S")
    assert_array_equal(record.time, 86400 * np.arange(4.0))


def test_bad_cells_are_named_by_their_line_and_only_where_they_are_used(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("t,u,y,z\n0,0,1,\n1,0,1,NaN\n2,0,1,x\n3,0,1,2\n")
    assert read_record(file).n_samples == 4
    file.write_text("# bench\n\nt,u,y\n0,0,1\n\n# restart\n1,0,bad\n2,0,1\n3,0,1\n4,0,1\n")
    with pytest.raises(DataError, match="line 7: 'bad'"):
        read_record(file, missing="refuse")
    # decimal commas between commas: nobody can tell
    file.write_text("t,u,y\n0,0,1,5,2,5\n0,1,1,5,2,5\n0,2,1,5,2,5\n")
    with pytest.raises(FileFormatError, match=r"line 1 .* has 3 cells, the lines below have 6"):
        read_record(file)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("empty", ["first", "last"])
@pytest.mark.parametrize("quote", ["", '"'])
def test_lines_with_an_empty_cell_at_an_end_are_read(tmp_path, delimiter, empty, quote):
    u, y = np.arange(60) > 9, np.arange(60) / 8
    rows = [("time_s", "OP", "PV"), *zip(range(60), u.astype(int), y, strict=True)]
    lines = [
        delimiter.join([f"{quote}{a}{quote}", str(b), f"{quote}{c}{quote}"]) for a, b, c in rows
    ]
    lines = [delimiter + line if empty == "first" else line + delimiter for line in lines]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    record = cr.read_record(path)
    np.testing.assert_array_equal([record.time, record.input, record.output], [np.arange(60), u, y])


def test_numbers_of_columns_may_be_numpys_and_other_kinds_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("a,b,c\n" + "".join(f"{k},{k > 9:d},{k / 8}\n" for k in range(60)))
    columns = dict(zip(["time", "input", "output"], np.arange(3), strict=True))
    assert_array_equal(read_record(path, **columns).output, np.arange(60) / 8)
    for odd in (3.5, {}, object(), [{}], [1.5], b"b"):
        with pytest.raises(OptionError, match="input="):
            read_record(path, time=0, input=odd, output=2)


@pytest.mark.parametrize("name", ["frequency_unit", "magnitude_unit", "phase_unit"])
@pytest.mark.parametrize("odd", [True, 3, None, b"Hz", "furlong"])
def test_a_unit_of_a_response_is_one_of_a_list(tmp_path, name, odd):
    path = tmp_path / "a.csv"
    path.write_text("f,m,p\n1,1,0\n2,0.5,-10\n")
    with pytest.raises(OptionError, match=f"{name}=.* must be one of"):
        cr.read_frf(path, frequency=0, magnitude=1, phase=2, **{name: odd})
