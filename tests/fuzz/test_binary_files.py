"""Damaged .npz, .npy, .mat and Parquet files."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import event, given
from hypothesis import strategies as st

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
    pytest.importorskip("pyarrow")
    buffer = io.BytesIO()
    pd.DataFrame(ARRAYS).to_parquet(buffer)
    return buffer.getvalue()


FILES = {
    ".npz": [npz(packed=False), npz(packed=True)],
    ".npy": [npy()],
    ".mat": [mat(), mat(do_compression=True), mat(format="4")],
    ".parquet": [parquet()],
}


@st.composite
def damages(draw, content: bytes) -> bytes:
    """Bytes changed (most often where sizes and types stand), cut out, doubled, cut off."""
    damaged = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(damaged) - 1))
        length = draw(st.integers(1, 16))
        kind = draw(st.sampled_from(["change", "size", "cut", "double", "end"]))
        if kind == "change":
            damaged[place] = draw(st.integers(0, 255))
        elif kind == "size":
            size = draw(st.sampled_from([b"\xff" * 4, b"\0" * 4, b"\x7f" * 4, b"\0\0\0\x7f"]))
            damaged[place : place + 4] = size
        elif kind == "cut":
            del damaged[place : place + length]
        elif kind == "double":
            damaged[place:place] = damaged[place : place + 4 * length]
        elif kind == "end" and draw(st.booleans()):
            del damaged[place:]
        if not damaged:
            damaged = bytearray(b"\0")
    return bytes(damaged)


@pytest.mark.parametrize("ending", FILES)
def test_a_damaged_file_is_read_or_refused(tmp_path, ending):
    file = tmp_path / f"damaged{ending}"

    @fuzz(60)
    @given(st.sampled_from(FILES[ending]).flatmap(damages))
    def run(content):
        file.write_bytes(content)
        with good_end() as records:
            records.append(read_record(file))
        for record in records:
            event("read")
            assert np.isfinite(record.time).all()
            assert np.isfinite(record.output).all()
        with good_end():
            read_frf(file, max_bytes=1e8)

    run()
