"""Records in .npz, .npy, .mat and Parquet files."""

import datetime
import inspect
import pickle
import struct
import sys
import tracemalloc
import zipfile

import numpy as np
import pandas as pd
import pytest
import scipy.io
from numpy.testing import assert_array_equal

from ctrl_realize.errors import DataError, FileFormatError, OptionError
from ctrl_realize.io import read_record

N = 40
T = 0.25 * np.arange(N)
U = (T > 2).astype(float)
Y = np.cumsum(U)


def check(record, *, time=T, input=U, output=Y):
    assert_array_equal(record.time, time)
    assert_array_equal(record.input, input)
    assert_array_equal(record.output, output)


ARRAYS = {
    "time and signals": {"t": T, "u": U, "y": Y},
    "sample time": {"u": U, "y": Y, "dt": 0.25},
    "sample rate": {"u": U, "y": Y, "fs": 4},
    "columns": {"time": T[:, None], "input": U[:, None], "output": Y[None]},
    "other arrays beside": {"t": T, "u": U, "y": Y, "period": 10, "note": "bench", "x": T[:7]},
    "whole numbers": {"t": T, "u": U.astype(np.int16), "y": Y.astype(np.uint8)},
    "single precision": {"t": T.astype(np.float32), "u": U.astype(">f4"), "y": Y},
    "Fortran order": {"x": np.asfortranarray(np.stack([T, U, Y], axis=1))},
    "one matrix": {"data": np.stack([T, U, Y], axis=1)},
    "one matrix, turned": {"data": np.stack([T, U, Y])},
}


# arrays are looked up alike whatever they come from; of .mat the types that its reader makes
WRITTEN = [("npz", name) for name in ARRAYS] + [
    ("packed npz", "columns"),
    # each in a process of its own
    *(("mat", name) for name in ("whole numbers", "one matrix, turned")),
    ("packed mat", "single precision"),
    ("old mat", "columns"),
]


@pytest.mark.parametrize(("kind", "name"), WRITTEN)
def test_arrays_are_found_by_their_names(tmp_path, kind, name):
    arrays = ARRAYS[name]
    file = tmp_path / ("a.mat" if "mat" in kind else "a.npz")
    if "mat" in kind:
        old = kind == "old mat"
        native = {
            name: np.asarray(a).astype(float) if old and np.asarray(a).dtype.kind in "iub" else a
            for name, a in arrays.items()
        }
        scipy.io.savemat(
            file, native, do_compression=kind.startswith("packed"), format="4" if old else "5"
        )
    else:
        (np.savez if kind == "npz" else np.savez_compressed)(file, **arrays)
    check(read_record(file))


def test_channels_are_the_shorter_side(tmp_path):
    file = tmp_path / "a.npz"
    np.savez(file, u=np.stack([U, -U], axis=1), y=np.stack([Y, 2 * Y, 3 * Y]), dt=0.25)
    record = read_record(file)
    check(record, input=[U, -U], output=[Y, 2 * Y, 3 * Y])
    assert record.input_labels == ("u[0]", "u[1]")
    check(read_record(file, input="u[1]", output=["y[0]", "y[2]"]), input=-U, output=[Y, 3 * Y])


def test_npy_files_and_structured_arrays_are_read(tmp_path):
    np.save(tmp_path / "plain.npy", np.stack([T, U, Y], axis=1))
    check(read_record(tmp_path / "plain.npy"))
    table = np.rec.fromarrays([Y, U, T], names="y,u,t")
    np.save(tmp_path / "named.npy", table)
    check(read_record(tmp_path / "named.npy"))


def test_cells_and_structs_of_matlab_are_read_field_by_field(tmp_path):
    file = tmp_path / "a.mat"
    runs = np.array([(T, U, Y), (T, U, 2 * Y)], dtype=[("t", "O"), ("u", "O"), ("y", "O")])
    cells = np.empty(2, dtype=object)
    cells[:] = [Y, 3 * Y]
    simulink = {"time": T, "signals": {"values": Y, "label": "level"}}
    scipy.io.savemat(file, {"runs": runs, "cells": cells, "scope": simulink})
    check(read_record(file, variable="runs[1]"), output=2 * Y)
    check(read_record(file, time="scope.time", input="runs[0].u", output="cells[1]"), output=3 * Y)
    check(read_record(file, time="scope.time", input="runs[0].u", output="scope.signals.values"))
    with pytest.raises(OptionError, match=r"3 columns that could be time.*'runs.*'scope.time'"):
        read_record(file)


def write_v73(h5py, file, arrays):
    """A file as MATLAB's ``save -v7.3`` lays it out: a block of text, then HDF5."""
    with h5py.File(file, "w", userblock_size=512) as content:
        for name, value in arrays.items():
            fields = value if isinstance(value, dict) else {"": value}
            for field, numbers in fields.items():
                path = f"{name}/{field}" if field else name
                if isinstance(numbers, str):
                    codes = np.array([[ord(letter)] for letter in numbers], dtype=np.uint16)
                    content[path] = codes
                    content[path].attrs["MATLAB_class"] = np.bytes_("char")
                else:
                    content[path] = np.atleast_2d(numbers).T
                    content[path].attrs["MATLAB_class"] = np.bytes_("double")
        cells = content.create_dataset("cells", (2, 1), h5py.ref_dtype)
        for k in range(2):
            place = content.create_dataset(f"#refs#/{k}", data=np.atleast_2d((k + 1) * Y).T)
            place.attrs["MATLAB_class"] = np.bytes_("double")
            cells[k, 0] = place.ref
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
    with file.open("r+b") as head:
        head.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def test_files_of_version_7_3_are_read_by_h5py(tmp_path):
    h5py = pytest.importorskip("h5py")
    file = tmp_path / "a.mat"
    write_v73(h5py, file, {"run": {"t": T, "u": U, "y": Y}, "note": "bench", "x": np.ones((3, 2))})
    check(read_record(file, variable="run"))
    check(read_record(file, time="run.t", input="run.u", output="cells[1]"), output=2 * Y)
    file.write_bytes(file.read_bytes()[:700])
    with pytest.raises(FileFormatError, match="damaged"):
        read_record(file)


def test_a_matrix_with_the_type_of_a_number_out_of_range_is_refused(tmp_path):
    file = tmp_path / "a.mat"
    scipy.io.savemat(file, {"t": T, "u": U, "y": Y})
    whole = bytearray(file.read_bytes())
    start = whole.index(T.tobytes())
    whole[start - 8 : start - 4] = b"\xff\xff\x00\x00"
    file.write_bytes(whole)
    # this one crashes the compiled reader, which must not end the caller's process
    with pytest.raises(FileFormatError, match="damaged one"):
        read_record(file)


class Boom:
    """Something that would act if it were unpickled."""

    def __reduce__(self):
        return (sys.exit, ("a pickle was loaded",))


def test_pickles_are_never_loaded(tmp_path):
    bomb = np.array([Boom()], dtype=object)
    np.savez(tmp_path / "a.npz", t=T, u=U, y=bomb)
    np.save(tmp_path / "b.npy", bomb, allow_pickle=True)
    (tmp_path / "c.npz").write_bytes(pickle.dumps(Boom()))
    for name, match in [
        ("a.npz", "Python objects"),
        ("b.npy", "Python objects"),
        ("c.npz", "pickle"),
    ]:
        with pytest.raises(FileFormatError, match=match):
            read_record(tmp_path / name)


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path):
    file = tmp_path / "a.npz"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.writestr("u.npy", bytes(80 * 2**20))
    assert file.stat().st_size < 2**20
    with pytest.raises(FileFormatError, match=r"unpacked, is 80 MiB, max_bytes="):
        read_record(file, max_bytes=20 * 2**20)


@pytest.mark.parametrize("shape", ["(4000000000000,)", "(40, 2000000000)", "(9999,)"])
def test_a_size_that_is_only_announced_takes_no_memory(tmp_path, shape):
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    npy = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(80)
    (tmp_path / "a.npy").write_bytes(npy)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("u.npy", npy)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(FileFormatError, match=r"max_bytes|truncated"):
            read_record(tmp_path / name)


def test_a_mat_file_that_is_too_large_when_unpacked_is_refused(tmp_path):
    file = tmp_path / "a.mat"
    scipy.io.savemat(file, {"t": np.zeros(400_000)}, do_compression=True)
    assert file.stat().st_size < 10_000
    with pytest.raises(FileFormatError, match="unpacked, it has more than max_bytes=1000000"):
        read_record(file, max_bytes=1e6)


@pytest.mark.parametrize(("cut", "packed"), [(135, True), (400, False)])
def test_damaged_mat_files_are_refused(tmp_path, cut, packed):
    file = tmp_path / "a.mat"
    scipy.io.savemat(file, {"t": T, "u": U, "y": Y}, do_compression=packed)
    whole = file.read_bytes()
    file.write_bytes(whole[:cut])
    with pytest.raises((FileFormatError, OptionError)):
        read_record(file)
    damaged = whole[: cut + 130] + b"\xff" * 8 + whole[cut + 138 :]
    file.write_bytes(damaged)
    with pytest.raises((FileFormatError, OptionError, DataError)):
        read_record(file)


@pytest.mark.parametrize("kind", ["csv", "zip", "mat", "parquet"])
def test_files_without_a_record_say_what_they_have(tmp_path, kind):
    file = tmp_path / f"a.{kind}"
    if kind == "csv":
        file.write_text("only\nwords\nhere\n")
    elif kind == "zip":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("readme.txt", "hello")
    elif kind == "mat":
        scipy.io.savemat(file, {"title": "nothing but words"})
    else:
        pytest.importorskip("pyarrow")
        file.write_bytes(b"PAR1" + bytes(100) + b"PAR1")
    with pytest.raises(FileFormatError, match=r"numeric columns|unpack it first|damaged"):
        read_record(file)


def test_parquet_files_are_read(tmp_path):
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame({"time_ms": 1000 * T, "u": U, "y": Y, "who": ["me"] * N})
    frame.to_parquet(tmp_path / "a.parquet")
    check(read_record(tmp_path / "a.parquet"))
    frame.set_index("time_ms").to_parquet(tmp_path / "indexed.parquet")
    check(read_record(tmp_path / "indexed.parquet"))
    frame["time_ms"] = pd.Timestamp("2026-03-01") + pd.to_timedelta(T, unit="s")
    frame.to_parquet(tmp_path / "b.parquet")
    check(read_record(tmp_path / "b.parquet", time="time_ms"))


def test_complex_signals_and_unequal_lengths_are_refused(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U * 1j, "y": Y})
    np.savez(tmp_path / "a.npz", t=T, u=U * 1j, y=Y)
    for name in ("a.npz", "a.mat"):
        with pytest.raises(DataError, match="column 'u' is complex"):
            read_record(tmp_path / name)
    np.savez(tmp_path / "a.npz", t=T, u=U[:-1], y=Y)
    with pytest.raises(DataError, match=r"different lengths: column 'u' 39, column 'y' 40"):
        read_record(tmp_path / "a.npz")


def test_a_few_kilobytes_of_parquet_do_not_fill_the_memory(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    zeros = pa.array(np.zeros(20_000_000))
    table = pa.table({"time_s": zeros, "u": zeros, "y": zeros})  # 480 MB, less than max_bytes
    long = {"row_group_size": 2**30, "data_page_size": 2**30, "max_rows_per_page": 2**30}
    known = inspect.signature(pq.write_table).parameters  # pages of older versions are so anyway
    chosen = {name: value for name, value in long.items() if name in known}
    pq.write_table(table, tmp_path / "a", compression="zstd", **chosen)
    assert (tmp_path / "a").stat().st_size < 10_000
    with pytest.raises(FileFormatError, match=r"unpacked, is 152\.6 MiB"):
        read_record(tmp_path / "a")


def test_numbers_of_any_parquet_type_are_read(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    values = np.arange(6) % 3
    for y in (
        pa.array(values).cast(pa.decimal128(30, 4)),
        pa.array(values.astype(np.float16)),
        pa.array(values, pa.int32()),
        pa.array(values.astype(str)).dictionary_encode(),
        pa.array([None, 1, 2, 0, 1, 2], pa.int64()),
    ):
        table = pa.table({"time_s": 0.1 * np.arange(6), "u": values, "y": y})
        pq.write_table(table, tmp_path / "a")
        record = read_record(tmp_path / "a", missing="keep")
        assert record.output[1:].tolist() == values[1:].tolist(), y.type
        assert record.n_missing == y.null_count


def test_only_the_wanted_columns_of_a_parquet_file_are_read(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    long = pa.DictionaryArray.from_arrays(np.zeros(N, dtype=np.int32), ["x" * 1_000_000])
    columns = {"time_s": T, "u": U, "y": Y, "note": long, "matrix": [[1.0, 2.0]] * N}
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(columns), path, store_schema=False)
    tracemalloc.start()
    try:
        check(read_record(path))
        with pytest.raises(DataError, match=r"'note', row 0: 'xxx"):
            read_record(path, output="note")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 5e6  # N texts of a million letters would be 200 MB
    with pytest.raises(FileFormatError, match=r"column 'matrix' holds list"):
        read_record(path, output="matrix")


@pytest.mark.parametrize(
    ("header", "match"),
    [
        (b"{'descr': '|O', 'fortran_order': False, 'shape': (3,)}", "Python objects"),
        (b"{'descr': '<f8', 'fortran_order': False, 'shape': (-3,)}", "damaged|cut off"),
        (b"{'descr': '<f8', 'shape': (3,)}", "damaged"),
        (b"__import__('os').system('true')", "damaged"),
        (b"[" * 5000, "damaged"),
        (b"\xff\xfe\xfd", "damaged"),
    ],
)
def test_npy_headers_that_are_wrong_are_refused(tmp_path, header, match):
    content = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(24)
    (tmp_path / "a.npy").write_bytes(content)
    with pytest.raises(FileFormatError, match=match):
        read_record(tmp_path / "a.npy")


def test_times_of_numpy_and_stored_sample_times(tmp_path):
    stamps = np.datetime64("2026-03-01T00:00") + 250 * np.arange(N).astype("m8[ms]")
    np.savez(tmp_path / "a.npz", timestamp=stamps, u=U, y=Y)
    check(read_record(tmp_path / "a.npz"))
    for constants, match in (({"dt": 0.0}, "dt=0.0"), ({"fs": 0}, "fs=0.0"), ({"Ts": -1}, "Ts=-1")):
        np.savez(tmp_path / "a.npz", u=U, y=Y, **constants)
        with pytest.raises(DataError, match=match):
            read_record(tmp_path / "a.npz")


def test_what_cannot_be_opened_says_what_to_do(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "<xml/>")
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(100))
    (tmp_path / "a.tdms").write_bytes(b"TDSm" + np.random.default_rng(0).bytes(1000))
    for name, package in (("xlsx", "openpyxl"), ("tdms", "npTDMS")):
        with pytest.raises(FileFormatError, match=f"a.{name} is a damaged|pip install.*{package}"):
            read_record(tmp_path / f"a.{name}")
    for package in ("pyarrow", "openpyxl", "nptdms"):
        monkeypatch.setitem(sys.modules, package, None)  # not installed
    for name, match in (
        ("a.parquet", r"a Parquet file.*ctrl-realize\[parquet\]"),
        ("a.xlsx", r"an Excel workbook.*ctrl-realize\[excel\].* save it as CSV"),
        ("a.tdms", r"TDMS file.*ctrl-realize\[tdms\].*as CSV"),
    ):
        with pytest.raises(FileFormatError, match=match):
            read_record(tmp_path / name)


def test_a_sheet_is_read_like_a_text_table(tmp_path):
    """Titles above the header, a unit line, dates, percentages, switches, and a column of text."""
    openpyxl = pytest.importorskip("openpyxl")
    sheet = openpyxl.Workbook().active
    sheet.title = "Run 1"
    for row in (["Oven 3"], [], [None, "Date", "MV", "Istwert", "Fan", "Remark"],
                [None, None, "%", "°C", None, None]):  # fmt: skip
        sheet.append(row)
    noon = datetime.datetime(2025, 2, 1, 23, 59, 59, 500_000)
    for k in range(6):
        sheet.append([None, noon + datetime.timedelta(seconds=k / 2), k / 10, 20.5 + k, k > 2, "x"])
        sheet.cell(sheet.max_row, 3).number_format = "0%"
    path = tmp_path / "a.xlsx"
    sheet.parent.save(path)
    record = read_record(path)
    assert_array_equal(record.time, 0.5 * np.arange(6))
    np.testing.assert_allclose(record.input, 10.0 * np.arange(6), rtol=1e-15)
    assert_array_equal(record.output, 20.5 + np.arange(6))
    assert (record.input_units, record.output_units) == (("%",), ("°C",))
    assert_array_equal(read_record(path, input="Fan").input, [0, 0, 0, 1, 1, 1])
    sheet.cell(7, 4).value = "Bad"
    sheet.parent.save(path)
    with pytest.raises(DataError, match="column 'Istwert', row 7: 'Bad': a value is missing"):
        read_record(path, missing="refuse")
    assert read_record(path, missing="keep").n_missing == 1
    sheet.parent.copy_worksheet(sheet)
    sheet.parent.save(path)
    with pytest.raises(OptionError, match="2 sheets with data; give variable= one of 'Run 1', 'R"):
        read_record(path)
    assert read_record(path, variable="Run 1", missing="keep").n_samples == 6
    with pytest.raises(OptionError, match="has the sheets"):
        read_record(path, variable="Run 2")
    with pytest.raises(FileFormatError, match="unpacked"):
        read_record(path, max_bytes=7000)


@pytest.mark.parametrize("time", ["numbers", "text"])
def test_numbers_that_are_stored_as_text_may_have_a_comma(tmp_path, time):
    """Beside cells that are numbers: a point there does not tell the sign of the others."""
    sheet = pytest.importorskip("openpyxl").Workbook().active
    sheet.append(["time_s", "u", "y"])
    path, output = tmp_path / "a.xlsx", 12.5 + 0.125 * np.arange(9)
    for k in range(9):
        at = 0.001 * k if time == "numbers" else f"{0.001 * k:.3f}".replace(".", ",")
        sheet.append([at, k // 4, f"{output[k]:.3f}".replace(".", ",")])
    sheet.parent.save(path)
    if time == "numbers":  # 12,500 to 13,500 may be thousands
        with pytest.raises(FileFormatError, match=r"'12,500' may be 12.500 or 12500; give decimal"):
            read_record(path)
        assert_array_equal(read_record(path, thousands=",").output, 1000 * output)
    for given in ({"decimal": ","}, {} if time == "text" else {"decimal": ",", "thousands": None}):
        record = read_record(path, **given)
        assert_array_equal(record.output, output)
        assert record.dt == pytest.approx(0.001)


@pytest.mark.parametrize("shown", ["h:mm:ss", "[h]:mm:ss", "mm:ss.0"])
@pytest.mark.parametrize("first", [0.0, 0.9])
def test_clocks_of_excel_go_on_after_a_day(tmp_path, shown, first):
    """Times are fractions of a day, 1.5 is shown as 12:00: beyond a day openpyxl has a date."""
    openpyxl = pytest.importorskip("openpyxl")
    sheet = openpyxl.Workbook().active
    sheet.append(["time", "u", "y"])
    for k in range(100):
        sheet.append([first + k / 2, float(k > 5), 0.1 * k])
        sheet.cell(sheet.max_row, 1).number_format = shown
    sheet.parent.save(tmp_path / "a.xlsx")
    assert_array_equal(read_record(tmp_path / "a.xlsx").time, 43200.0 * np.arange(100))


def test_hdf5_files_of_others_are_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, values in (("time", T), ("u", U), ("y", Y)):
            file[f"run/{name}"] = values
        file["run/y"].attrs["units"] = "bar"
        file["note"] = "bench 3"
    check(read_record(path))
    assert read_record(path, variable="run").output_units == ("bar",)
    stamps = [f"2025-02-01 08:15:{t:05.2f}" for t in T]
    kinds = [("timestamp", "S30"), ("u", "f8"), ("y", "f8")]
    rows = np.array(list(zip(stamps, U, Y, strict=True)), kinds)
    with h5py.File(path, "w") as file:
        file["table"] = rows
    check(read_record(path))


def test_tdms_files_are_read(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    waveform = {"wf_increment": T[1], "unit_string": "V"}
    for channels in (
        [("time", T, {}), ("u", U, {}), ("y", Y, {})],
        [("u", U, waveform), ("y", Y, waveform)],
    ):
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment([nptdms.ChannelObject("run", *channel) for channel in channels])
        check(read_record(path))
    assert read_record(path).input_units == ("V",)
