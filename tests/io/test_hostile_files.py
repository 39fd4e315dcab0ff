"""Files that nobody meant well: every one ends in one of our errors, soon and without memory."""

import io
import os
import socket
import struct
import tracemalloc
import zlib

import control as ct
import numpy as np
import pytest

from ctrl_realize.errors import (
    CtrlRealizeError,
    DataError,
    FileFormatError,
    MissingFileError,
    OptionError,
)
from ctrl_realize.io import load_model, read_frf, read_record, save_model

READERS = [read_record, read_frf, load_model]
JUNK = np.random.default_rng(7).bytes(100_000)

CONTENT = {
    "nothing": b"",
    "zeros": bytes(100_000),
    "junk": JUNK,
    "junk behind numbers": b"t,u,y\n0,1,2\n1,2,3\n" + JUNK,
    "a picture": b"\x89PNG\r\n\x1a\n" + JUNK,
    "a web page": b"<!DOCTYPE html><html><body><p>404, not found</p></body></html>\n" * 20,
    "gzip": b"\x1f\x8b\x08\x00" + JUNK,
    "HDF5": b"\x89HDF\r\n\x1a\n" + JUNK,
    "half a mark": b"\xff\xfe\x00",
    "utf-16 with half a character": "t,u,y\n0,1,2\n".encode("utf-16") + b"\x31",
    "a zip that is none": b"PK\x03\x04" + JUNK,
    "an npy that is none": b"\x93NUMPY\x01\x00" + JUNK,
    "a mat that is none": b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + JUNK,
    "a parquet that is none": b"PAR1" + JUNK + b"PAR1",
    "words": b"hello world\nthis is not a table\n" * 50,
    "one long line": b"1" * 1_000_000,
    "ten million columns": b"," * 10_000_000,
    "ten million numbers in a line": b"1," * 10_000_000,
    "ten million columns further down": b"t,u,y\n0,1,2\n1,2,3\n2,3,4\n" + b"1," * 10_000_000,
    "a quote that never ends": b't,u,y\n0,1,2\n1,2,3\n2,"' + b"3" * 1_000_000,
    "only quotes": b'"' * 100_000,
    "only delimiters": b",,,,\n" * 1000,
    "two rows": b"t,u,y\n0,1,2\n1,2,3\n",
    "infinities": b"t,u,y\n" + b"inf,inf,inf\n" * 10,
    "too large for doubles": b"t,u,y\n" + b"1e999,-1e999,1e99999999999\n" * 10,
    "digits without end": b"t,u,y\n" + (b"9" * 5000 + b",1,2\n") * 5,
    "the largest doubles": b"t,u,y\n-1.7e308,1,2\n0,1,2\n1.7e308,1,2\n",
    "time that stands": b"t,u,y\n" + b"1,1,2\n" * 50,
    "zero bytes in cells": b"t,u,y\n0,1\0,2\n1,2\0,3\n2,2\0,3\n3,3\0,3\n",
    "every byte": bytes(range(256)) * 20,
    "control characters": bytes(range(1, 32)) * 100,
    "formulas": b"t,u,y\n" + b"=1+1,@SUM(A1),2\n" * 10,
    "brackets": b"[" * 100_000,
}


AS_MAT = ("nothing", "junk", "a mat that is none", "HDF5", "words", "two rows", "brackets")
CASES = [(name, ".csv") for name in CONTENT] + [(name, ".mat") for name in AS_MAT]


@pytest.mark.parametrize(("name", "ending"), CASES)
def test_no_content_leads_to_anything_but_our_errors(tmp_path, name, ending):
    file = tmp_path / f"a{ending}"
    file.write_bytes(CONTENT[name])
    for read in READERS:
        with pytest.raises(CtrlRealizeError) as caught:
            read(file)
        assert str(file) in str(caught.value)
        # a message is to be read, also when the file is one long line
        assert len(str(caught.value)) < 2000


@pytest.mark.parametrize("read", READERS)
def test_pipes_devices_sockets_and_folders_are_not_waited_for(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        # the address of a socket may only be short
        home = os.getcwd()
        os.chdir(tmp_path)
        server.bind("socket")
        os.chdir(home)
        for path in (tmp_path / "pipe", tmp_path / "socket", "/dev/zero"):
            with pytest.raises(FileFormatError, match="device or a pipe"):
                read(path)
    with pytest.raises(FileFormatError, match="is a folder"):
        read(tmp_path)


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("path", ["", "no/such/file", "a\0b", "x" * 5000, "a.csv/b.csv"])
def test_paths_that_lead_nowhere_are_missing_files(tmp_path, monkeypatch, read, path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("1,2,3\n")
    error = FileFormatError if path == "" else MissingFileError
    with pytest.raises(error):
        read(path)


def test_a_huge_file_is_refused_by_its_size_alone(tmp_path):
    file = tmp_path / "a.csv"
    with file.open("wb") as sparse:
        sparse.write(b"t,u,y\n0,1,2\n")
        sparse.truncate(3 * 2**30)
    with pytest.raises(FileFormatError, match=r"is 3072 MiB, max_bytes=2147483648 allows 2048 MiB"):
        read_record(file)
    with pytest.raises(FileFormatError, match="max_bytes"):
        load_model(file)


def test_a_line_of_ten_million_columns_is_not_split(tmp_path):
    file = tmp_path / "a.csv"
    file.write_bytes(b"1," * 10_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(FileFormatError, match=r"first line .* longer than 262144 bytes"):
            read_record(file)
        # a few copies of the head of the file
        assert tracemalloc.get_traced_memory()[1] < 20 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("kind", "packed"),
    [(15, bytes(50 << 20)), (15, struct.pack("<II", 14, 64) + bytes(50 << 20)), (0, b"")],
    ids=["zeros", "a matrix and zeros", "empty elements"],
)
def test_a_mat_file_of_zeros_is_refused_with_little_memory(tmp_path, kind, packed):
    body = zlib.compress(packed) if packed else bytes(8 * 200_001)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    file = tmp_path / "zeros.mat"
    file.write_bytes(head + struct.pack("<II", kind, len(body)) + body)
    tracemalloc.start()
    with pytest.raises(FileFormatError):
        read_record(file)
    assert tracemalloc.get_traced_memory()[1] < 10e6
    tracemalloc.stop()


def elsewhere(h5py, file, other):
    layout = h5py.VirtualLayout(shape=(10,), dtype="f8")
    layout[:] = h5py.VirtualSource(other, "y", shape=(10,))
    file.create_virtual_dataset("y", layout)


HDF5 = {  # a dataset y that is not in the file, or larger than it, and what is said
    "an unwritten dataset": (
        lambda h5py, file, other: file.create_dataset("y", (2 * 10**9,), "f8", chunks=(2**20,)),
        r"unpacked, it has more than max_bytes=\d+, or a thousand times its size",
    ),
    "zeros below max_bytes": (
        lambda h5py, file, other: file.create_dataset(
            "y", (10**8,), "f8", chunks=(2**20,), compression="gzip"
        ),
        r"unpacked, it has more than max_bytes=67108864",
    ),
    "a link": (
        lambda h5py, file, other: file.__setitem__("y", h5py.ExternalLink(other, "y")),
        r"'y' is a link to another file; other files are not opened: copy",
    ),
    "raw storage": (
        lambda h5py, file, other: file.create_dataset("y", (10,), "f8", external=[(other, 0, 80)]),
        r"dataset '/y' is stored outside; other files",
    ),
    "a virtual dataset": (elsewhere, r"dataset '/y' is virtual; other files"),
}


@pytest.mark.parametrize("kind", HDF5)
@pytest.mark.parametrize("ending", [".h5", ".mat"])
def test_hdf5_neither_opens_other_files_nor_believes_their_sizes(tmp_path, kind, ending):
    h5py = pytest.importorskip("h5py")
    write, said = HDF5[kind]
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["y"] = np.arange(10.0)
    path = tmp_path / f"a{ending}"
    with h5py.File(path, "w", userblock_size=512 * (ending == ".mat")) as file:
        file["t"], file["u"] = np.arange(10.0), np.arange(10.0) > 3
        write(h5py, file, str(other))
    if ending == ".mat":
        with path.open("r+b") as head:
            head.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    with pytest.raises(FileFormatError, match=rf"a\{ending}: .*{said}"):
        read_record(path)


def test_links_inside_a_file_of_hdf5_are_followed(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"], file["u"], file["raw"] = np.arange(10.0), np.zeros(10), np.arange(10.0)
        file["y"] = h5py.SoftLink("/raw")
    assert list(read_record(tmp_path / "a.h5", output="y").output) == list(range(10))


def test_text_that_would_be_cut_wrongly_is_refused(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("t|u|y\n0|-526|410\n0.125|-822|610\n0.25|-339|361\n")
    for options in ({"comment": "1"}, {"comment": "e"}, {"delimiter": "4"}):
        with pytest.raises(OptionError, match="would split numbers"):
            read_record(file, **options)
    rows = [f"{k},{k},{k}" for k in range(50_000)]
    rows[49_000] = "49000,49000,oops"
    file.write_text("t,u,y\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match="line 49002: 'oops'"):
        read_record(file)


def test_line_ends_in_quotes_and_wide_letters_shift_no_columns(tmp_path):
    file = tmp_path / "a.csv"
    text = 't,u,y,note\n0,1,2,"a\nb"\n1,2,3,"c"\n2,3,4,"d,e"\n'
    for encoding in ("utf-8", "utf-8-sig", "utf-16", "utf-32"):
        file.write_bytes(text.encode(encoding))
        assert read_record(file).input.tolist() == [1, 2, 3]


@pytest.mark.parametrize("read", READERS)
def test_what_is_no_name_of_a_file_is_refused(tmp_path, read):
    for path in (None, 3, b"a.csv", io.StringIO("t,u,y\n")):
        with pytest.raises(OptionError, match=f"path is a {type(path).__name__}; expected"):
            read(path)
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(MissingFileError):
        read(tmp_path / "a")


def test_a_model_is_not_saved_under_a_name_that_no_file_can_have(tmp_path):
    with pytest.raises(OSError, match="null"):
        save_model(tmp_path / "a\0b.json", ct.ss(0.9, 1, 1, 0, 0.1))
