"""Text tables that two readers may understand in two ways: understood in one, or refused."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ctrl_realize.errors import DataError, FileFormatError, OptionError
from ctrl_realize.io import read_record

N = 12
ENDS = ["\n", "\r\n", "\r", "\r\r\n"]


def rows(count=N):
    return [[f"{0.1 * k:.1f}", f"{k % 2}", f"{k + 0.25:.2f}"] for k in range(count)]


def is_whole(record):
    assert record.n_samples == N
    np.testing.assert_array_equal(record.output, np.arange(N) + 0.25)


@given(
    st.lists(st.sampled_from(["", "[°C]", "\n[°C]", "\r\n", " \n\n of ", '""', ", ;"]), max_size=3),
    st.sampled_from(ENDS),
    st.sampled_from([0, 1, 2]),
    st.sampled_from([0, 1, 3]),
    st.sampled_from([",", ";", "\t"]),
)
def test_no_sample_is_lost_whatever_the_line_ends_and_the_header(
    tmp_path_factory, parts, end, titles, blank, delimiter
):
    header = ["time_s", "u", "y" + "".join(parts) + "."]
    buffer = io.StringIO()
    csv.writer(buffer, csv.unix_dialect, delimiter=delimiter, lineterminator=end).writerow(header)
    body = end.join([delimiter.join(row) for row in rows()] + [""])
    text = f"A title{end}" * titles + end * blank + buffer.getvalue() + end * blank + body
    path = tmp_path_factory.mktemp("text") / "a.csv"
    path.write_bytes((text + end * blank).encode())
    record = read_record(path, input=1, output=2)
    is_whole(record)
    assert "".join(record.output_labels[0].split()) == "".join(header[2].split())


def test_a_header_with_line_breaks_is_one_name(tmp_path):
    path = tmp_path / "a.csv"
    text = '"Time\n[s]","Valve\nposition\n[%]","Temp\r\n[°C]"\n'
    path.write_text(text + "\n".join(",".join(row) for row in rows()), encoding="utf-8", newline="")
    record = read_record(path, input="Valve position", output=2)
    is_whole(record)
    assert record.input_labels == ("Valve position [%]",)
    assert record.output_labels == ("Temp [°C]",)


def test_a_stray_quote_that_swallows_lines_is_told(tmp_path):
    lines = [",".join([*row, "note"]) for row in rows()]
    lines[4] = lines[4].replace("note", '"note')
    path = tmp_path / "a.csv"
    path.write_text("time_s,u,y,remark\n" + "\n".join(lines) + "\n")
    with pytest.raises(FileFormatError, match=r"are its quotes|is not a table"):
        read_record(path)


@pytest.mark.parametrize("cell", ["00:05", "12:34.5"])
def test_a_clock_of_two_numbers_is_asked_about(tmp_path, cell):
    path = tmp_path / "a.csv"
    path.write_text("time,u,y\n" + "".join(f"{cell},{k},{k}\n" for k in range(5)))
    with pytest.raises(OptionError, match=r"line 2.*time_unit='h' or time_unit='min'"):
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
    ],
)
def test_a_clock_runs_in_the_unit_that_was_said(tmp_path, header, unit, cells, dt):
    path = tmp_path / "a.csv"
    path.write_text(f"{header},u,y\n" + "".join(f"{cell},{k},1\n" for k, cell in enumerate(cells)))
    record = read_record(path, time_unit=unit)
    assert record.dt == pytest.approx(dt, rel=1e-12)


def test_a_clock_of_two_numbers_and_of_three_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,u,y\n59:58,0,1\n59:59,0,1\n1:00:00,0,1\n1:00:01,0,1\n")
    with pytest.raises(DataError, match="of two numbers and of three"):
        read_record(path, time_unit="min")


@pytest.mark.parametrize(
    ("delimiter", "cells"),
    [
        (",", ["1,234", "2,345", "3,456"]),
        (",", ["999", "1,001", "1,003"]),
        (";", ["998", "999", "1,000"]),
        ("\t", ["998", "999", "1,000"]),
    ],
)
def test_commas_that_may_divide_thousands_are_asked_about(tmp_path, delimiter, cells):
    path = tmp_path / "a.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerows([["time_s", "u", "y"], *([k, k, c] for k, c in enumerate(cells))])
    with pytest.raises(FileFormatError, match=r"may be \d\.\d{3} or \d{4}; say decimal"):
        read_record(path)
    assert read_record(path, decimal=",").output[2] == float(cells[2].replace(",", "."))


@pytest.mark.parametrize("cells", [["1,234", "2,345", "0,456"], ["1,25", "2,345", "3,4"]])
def test_commas_that_can_only_mark_decimals_do(tmp_path, cells):
    path = tmp_path / "a.csv"
    for delimiter in (";", ","):
        with path.open("w", newline="") as file:
            writer = csv.writer(file, delimiter=delimiter)
            writer.writerows([["time_s", "u", "y"], *([k, k, c] for k, c in enumerate(cells))])
        read = read_record(path).output
        np.testing.assert_array_equal(read, [float(c.replace(",", ".")) for c in cells])


def test_decimals_of_a_fixed_number_are_decimals(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s;u;y\n" + "".join(f"{k};{k};{k + 1},125\n" for k in range(N)))
    np.testing.assert_array_equal(read_record(path).output, np.arange(N) + 1.125)
