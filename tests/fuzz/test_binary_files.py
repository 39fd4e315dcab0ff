"""Damaged .npz, .npy, .mat and Parquet files."""

import io
from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest
import scipy.io

from ctrl_realize.io import read_frf, read_record
from tests.fuzz.lane import fuzz, good_end

T = np.arange(12.0) / 8
ARRAYS = {"t": T, "u": (T > 0.5).astype(float), "y": T**2}


def npz(packed: bool) -> bytes:
    buffer = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(buffer, **ARRAYS)
    return buffer.getvalue()


def npy() -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.stack(list(ARRAYS.values())))
    return buffer.getvalue()


def mat(**options) -> bytes:
    buffer = io.BytesIO()
    nested = {} if options.get("format") == "4" else {"run": {"a": T, "b": {"c": T}}}
    scipy.io.savemat(buffer, {**ARRAYS, **nested}, **options)
    return buffer.getvalue()


def parquet() -> bytes:
    buffer = io.BytesIO()
    pd.DataFrame(ARRAYS).to_parquet(buffer)
    return buffer.getvalue()


FILES = {
    ".npz": [npz(packed=False), npz(packed=True)],
    ".npy": [npy()],
    ".mat": [mat(), mat(do_compression=True), mat(format="4")],
    **({".parquet": [parquet()]} if find_spec("pyarrow") else {}),
}
SIZES = [b"\xff" * 4, b"\0" * 4, b"\x7f" * 4, b"\0\0\0\x7f"]


def damaged(rng, content: bytes) -> bytes:
    """Bytes changed (most often where sizes and types stand), cut out, doubled, cut off."""
    changed = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(len(changed))
        length = rng.randint(1, 16)
        kind = rng.choice(["change", "bit", "size", "cut", "double", "end"])
        if kind == "change":
            changed[place] = rng.randrange(256)
        elif kind == "bit":
            changed[place] ^= 1 << rng.randrange(8)
        elif kind == "size":
            changed[place : place + 4] = rng.choice(SIZES)
        elif kind == "cut":
            del changed[place : place + length]
        elif kind == "double":
            changed[place:place] = changed[place : place + 4 * length]
        elif rng.randrange(2):
            del changed[place:]
        if not changed:
            changed = bytearray(b"\0")
    return bytes(changed)


def read_damaged(rng, tmp_path, ending):
    file = tmp_path / f"damaged{ending}"
    file.write_bytes(damaged(rng, rng.choice(FILES[ending])))
    if rng.randrange(4) == 0:
        with good_end():
            read_frf(file, max_bytes=1e8)
        return
    with good_end() as records:
        records.append(read_record(file))
    for record in records:
        assert np.isfinite(record.time).all()
        # what is missing is told: a DataWarning is one of the good ends
        assert not np.isinf(record.output).any()
        assert record.n_missing or np.isfinite(record.output).all()


@pytest.mark.parametrize("ending", sorted(set(FILES) - {".mat"}))
@fuzz(80)
def test_a_damaged_file_is_read_or_refused(rng, tmp_path, ending):
    read_damaged(rng, tmp_path, ending)


@fuzz(10)  # each one starts a process, 0.4 s
def test_a_damaged_mat_file_is_read_or_refused(rng, tmp_path):
    read_damaged(rng, tmp_path, ".mat")
