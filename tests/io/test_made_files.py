"""Files of many kinds with known truth: read right with no argument, or not at all."""

import warnings
from contextlib import nullcontext

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import (
    CtrlRealizeError,
    DataError,
    DataWarning,
    FileFormatError,
    OptionError,
    TimeAxisError,
)
from tests.io.made_files import MADE


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("made")


def same_samples(record, truth):
    """Whether a record holds the samples of a file at their times, and no others."""
    at = np.searchsorted(record.time - record.time[0], truth.t - 0.25 * record.dt)
    others = np.setdiff1d(np.arange(record.n_samples), at)
    np.testing.assert_allclose(
        record.time[at] - record.time[at[0]], truth.t, atol=0.05 * np.diff(truth.t).min()
    )
    np.testing.assert_allclose(record.output[at], truth.y, rtol=1e-12)
    assert np.isnan(record.output[others]).all()
    np.testing.assert_allclose(record.input[at], truth.u, rtol=1e-12)


def test_most_files_need_no_argument():
    assert len(MADE) >= 24
    assert sum(not file.asked for file in MADE) >= len(MADE) - 4


@pytest.mark.parametrize("file", MADE, ids=lambda file: file.name)
def test_a_file_is_read_right_and_what_is_guessed_is_told(folder, file):
    path = folder / file.name
    truth = file.write(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        record = cr.read_record(path, **file.asked)
    said = [str(one.message) for one in caught if one.category is DataWarning]
    assert len(said) == len(caught)
    assert any(file.told in one for one in said) if file.told else not said
    if file.name == "plotjuggler.csv":  # each signal at its own stamps, on one axis
        seen = ~np.isnan(record.output)
        np.testing.assert_allclose(record.output[seen], truth.y)
        np.testing.assert_allclose(np.diff(record.time[seen]), np.diff(truth.t), atol=1e-6)
        assert set(record.input) == {0.0, 1.0}
        return
    same_samples(record, truth)
    if file.asked:
        with pytest.raises(CtrlRealizeError, match="give time=name or number, or dt="):
            cr.read_record(path)


def test_a_gap_in_which_the_input_moved_is_refused_and_others_are_kept_and_told(tmp_path):
    t = np.r_[0:20.0, 30:60.0]
    path = tmp_path / "a.csv"

    def wrote(u):
        rows = [f"{a},{b},{k}" for k, (a, b) in enumerate(zip(t, u, strict=True))]
        path.write_text("\n".join(["t_s,u,y", *rows]) + "\n")
        return path

    with pytest.warns(DataWarning, match="stamps are irregular; they are kept as they are"):
        record = cr.read_record(wrote(np.where(t < 40, 0.0, 1.0)))
    assert record.n_samples == 60
    assert np.isnan(record.output[20:30]).all()
    with pytest.raises(TimeAxisError, match=r"no values between 19 s and 30 s \(line 22\).*hold"):
        cr.read_record(wrote(np.where(t < 25, 0.0, 1.0)))
    t = np.r_[0:20.0, 21:60.0]
    with pytest.warns(DataWarning, match="moved in the gap before line 22, up to 1 s before the"):
        cr.read_record(wrote(np.where(t < 20, 0.0, 1.0)))
    with pytest.warns(DataWarning) as told:
        cr.read_record(wrote(np.where(t < 40, 0.0, 1.0)))
    assert "moved" not in str(told[0].message)
    # of irregular stamps nobody can tell when it moved between two of them
    t = np.r_[0:20.0, 20.3:60.0]
    with pytest.warns(DataWarning, match="moved in the gap before line 42, up to 1 s before the"):
        cr.read_record(wrote(np.where(t < 40, 0.0, 1.0)))


@pytest.mark.parametrize(
    ("head", "names"),
    [
        ("temps (s) entrée [%] sortie [°C]", ("entrée [%]", "sortie [°C]")),
        ("temps  (s)  entrée  sortie", ("entrée", "sortie")),
        ('"time" "u 1" "y"', ("u 1", "y")),
        ("time u y\n[s] [%] [K]", ("u", "y")),
    ],
)
def test_names_above_columns_between_blanks(tmp_path, head, names):
    """A unit behind a blank once shifted the names: input and output were exchanged."""
    path = tmp_path / "a.txt"
    rows = [f"{0.5 * k} {40 + 20 * (k > 9)} {300.1 + k}" for k in range(40)]
    # the mark of DOS at the end of a file, or zeros of a writer without power
    for end in ("\n", "\n\x1a", "\x1a", "\0\0"):
        path.write_text("\n".join([head, *rows]) + end, encoding="utf-8")
        with pytest.warns(DataWarning) if end == "\n\x1a" else nullcontext():
            record = cr.read_record(path)
        assert (record.input_labels, record.output_labels) == ((names[0],), (names[1],))
        np.testing.assert_array_equal(record.output, 300.1 + np.arange(40))
    path.write_text("\n".join(["time valve opening output", *rows]), encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"line 1 of .* has 4 cells, the lines below have 3"):
        cr.read_record(path)


def test_thousands_separators_are_told_apart_from_decimal_signs(tmp_path):
    path = tmp_path / "a.csv"

    def read(cells, **options):
        rows = [f"{k};{k % 2};{cell}" for k, cell in enumerate(cells)]
        path.write_text("\n".join(["t;u;y", *rows]) + "\n", encoding="utf-8")
        return cr.read_record(path, **options).output

    expected = [999.5, 1200.25, 1000000.5, 2000.0]
    for cells in (
        ["999,5", "1.200,25", "1.000.000,5", "2.000,0"],
        ["999.5", "1,200.25", "1,000,000.5", "2,000.0"],
        ["999.5", "1'200.25", "1'000'000.5", "2'000.0"],
        ["999,5", "1\u202f200,25", "1 000 000,5", "2 000,0"],
    ):
        np.testing.assert_array_equal(read(cells), expected)
    with pytest.raises(DataError, match="line 4: '12,5': is not a number"):  # and not 125
        read(["999.5", "1,200.5", "12,5", "2,000.5"])
    unclear = ["999", "1,200", "1,300", "2,000"]
    with pytest.raises(CtrlRealizeError, match=r"may be 1\.200 or 1200; give decimal=',' .*thousa"):
        read(unclear)
    np.testing.assert_array_equal(read(unclear, thousands=","), [999, 1200, 1300, 2000])
    np.testing.assert_array_equal(read(unclear, thousands=None, decimal=","), [999, 1.2, 1.3, 2])
    with pytest.raises(OptionError, match="another sign than the decimal one"):
        read(unclear, thousands=",", decimal=",")
    # it was a jump from 999 to 1.2
    unclear = [cell.replace(",", ".") for cell in unclear]
    with pytest.raises(CtrlRealizeError, match=r"may be 1\.200 or 1200; .*decimal=',' and thousa"):
        read(unclear)
    np.testing.assert_array_equal(
        read(unclear, thousands=".", decimal=","), [999, 1200, 1300, 2000]
    )
    np.testing.assert_array_equal(read(unclear, decimal="."), [999, 1.2, 1.3, 2])
    np.testing.assert_array_equal(read(["1", "1.125", "1.250", "2"]), [1, 1.125, 1.25, 2])


def test_columns_that_no_name_and_no_step_tell_are_asked_for(tmp_path):
    """Two smooth signals, two that move in steps, and three of which two follow."""
    t = np.arange(100.0)
    step, smooth = 1.0 * (t > 20), 1 - np.exp(-np.maximum(t - 25, 0) / 10)
    for signals in ((smooth, 2 * smooth), (step, 1.0 * (t > 30)), (step, smooth, 3 * smooth)):
        path = tmp_path / "a.csv"
        table = np.column_stack([t, *signals])
        np.savetxt(path, table, delimiter=",", header="t_s,a,b,c"[: 3 + 2 * len(signals)],
                   comments="")  # fmt: skip
        with pytest.raises(OptionError, match="cannot tell which column is the"):
            cr.read_record(path)


def test_units_in_cells_are_units_of_the_column_and_two_of_them_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,u,y\n" + "".join(f"{k} s,{k % 2},{20 + k}.5 °C\n" for k in range(6)))
    record = cr.read_record(path)
    assert (record.units["time"], record.output_units) == ("s", ("°C",))
    path.write_text(path.read_text().replace("24.5 °C", "24.5 °F"))
    with pytest.raises(DataError, match=r"'y' has 1 cells with the unit '°F' and 5 without"):
        cr.read_record(path)


@pytest.mark.parametrize("first", [700_000_000_000, 20250201081500])
def test_numbers_that_are_no_clock_in_seconds_nor_since_1970_are_asked_about(tmp_path, first):
    """Nanoseconds since a device was started, and dates without marks."""
    path = tmp_path / "a.csv"
    rows = [f"{first + 10**9 * k},{k % 2},{k}" for k in range(9)]
    path.write_text("\n".join(["timestamp,u,y", *rows]) + "\n")
    with pytest.raises(OptionError, match=r"no clock in s; give time_unit='ms'.* or time_format="):
        cr.read_record(path)
    assert cr.read_record(path, time_unit="ns").dt == 1.0


@pytest.mark.parametrize("decimal", [".", ","])
def test_a_typesetter_s_minus_is_one(tmp_path, decimal):
    y = np.linspace(-20, 13, 100).round(2)
    cells = [f"{value:.2f}".replace("-", "\u2212").replace(".", decimal) for value in y]
    rows = [f"{k};{int(k > 20)};{cell}" for k, cell in enumerate(cells)]
    (tmp_path / "a.csv").write_text("\n".join(["time_s;OP;PV", *rows]) + "\n", encoding="utf-8")
    np.testing.assert_array_equal(cr.read_record(tmp_path / "a.csv").output, y)
