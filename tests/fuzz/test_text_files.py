"""Text tables, from nearly right to nonsense."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import event, given
from hypothesis import strategies as st

import ctrl_realize as cr
from ctrl_realize.io import read_frf, read_record
from tests.fuzz.lane import fuzz, good_end

KINDS = [
    st.integers(-1000, 1000).map(str),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.floats(-100, 100).map("{:.3f}".format),
    st.floats(-100, 100).map(lambda x: f"{x:.2f}".replace(".", ",")),
]
NUMBERS = st.one_of(
    *KINDS,
    st.sampled_from(["0", "-0", "+1", "1.", ".5", ",5", "1e5", "1E-300", "5e-324", "1.7e308"]),
)
ODD = st.one_of(
    st.sampled_from(
        ["", " ", "NaN", "nan", "inf", "-inf", "1e999", "-", "+", ".", "e5", "1e", "0x1F", "1_0",
         "1.2.3", "1,2,3", "1 000", "TRUE", "false", "#N/A", "null", "2026-03-01", "12:30:01.5",
         "2026-03-01T12:00:00Z", "9" * 400, "1" * 25, "²", "−1", "１", "\0", "\x1a", '"', '""', "'",
         "=1+1", "1;2", "1\t2", "t", "time", "u", "y", "[s]", "(V)", "#", "%", "\ufeff", "\u2028"]
    ),
    st.text(max_size=8),
)  # fmt: skip
HEADERS = st.sampled_from(
    ["time,input,output", "t;u;y", "t\tu\ty", "t u y", "Zeit [ms];Eingang;Ausgang", "f,re,im",
     "frequency_hz,magnitude_db,phase_deg", "omega mag phase_rad", "a,b,c", "# t,u,y", "u,y", "",
     "t,u,y,", "t,u1,u2,y1,y2", '"t","u","y"', "t,u,y\ns,V,V", "t,t,u,y", "1,2,3", "date time,u,y"]
)  # fmt: skip
ENDS = st.sampled_from(["\n", "\r\n", "\r", "\n\n"])
ENCODINGS = st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])


@st.composite
def tables(draw):
    """Tables whose rows are regular, with single cells and lines put out of order."""
    delimiter = draw(st.sampled_from([",", ";", "\t", " ", "|", ", ", "  "]))
    regular = draw(st.booleans())
    width = 3 if regular else draw(st.integers(1, 5))
    kind = draw(st.sampled_from(KINDS)) if regular else NUMBERS
    rows = [
        [f"{k / 8}", *(draw(kind) for _ in range(width - 1))]
        for k in range(draw(st.integers(3 * regular, 12)))
    ]
    for _ in range(draw(st.integers(0, 3 - 2 * regular))):
        if rows:
            row = draw(st.sampled_from(rows))
            if row and draw(st.booleans()):
                row[draw(st.integers(0, len(row) - 1))] = draw(ODD)
            elif draw(st.booleans()):
                row.append(draw(ODD))
            elif row:
                row.pop()
    header = delimiter.join("tuy") if regular else draw(HEADERS)
    lines = [header, *(delimiter.join(row) for row in rows)]
    for _ in range(draw(st.integers(0, 2 - 2 * regular))):
        lines.insert(draw(st.integers(0, len(lines))), draw(st.one_of(ODD, st.text(max_size=30))))
    text = draw(ENDS).join(lines) + draw(st.sampled_from(["", "\n", "\r\n", "\0\0\0"]))
    return text.encode(draw(ENCODINGS), errors="replace")


BYTES = st.integers(0, 255)


@st.composite
def mutations(draw):
    """A good file with some bytes changed, taken out, or doubled."""
    content = bytearray(
        b"time_s,input,output\n" + b"".join(b"%g,%d,%.3f\n" % (k / 8, k > 3, k) for k in range(12))
    )
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(content) - 1))
        length = draw(st.integers(1, 12))
        kind = draw(st.sampled_from(["change", "cut", "double", "insert"]))
        if kind == "change":
            content[place] = draw(st.one_of(st.sampled_from(b"0123456789.,;-e\n "), BYTES))
        elif kind == "cut" and len(content) > 2 * length:
            del content[place : place + length]
        elif kind == "double":
            content[place:place] = content[place : place + length]
        else:
            content[place:place] = draw(st.binary(min_size=1, max_size=length))
    return bytes(content)


CHOICES = st.fixed_dictionaries(
    {},
    optional={
        "time": st.sampled_from([0, 1, "t", "time"]),
        "input": st.sampled_from([0, 1, "u", [1, 2], "b"]),
        "output": st.sampled_from([0, 2, "y", "c", -1]),
        "dt": st.sampled_from([1.0, 1e-9, 0, -1, float("nan"), 1e300, 5e-324]),
        "time_unit": st.sampled_from(["auto", "ms", "h", "fortnight"]),
        "time_format": st.sampled_from(["%d.%m.%Y", "%", ""]),
        "delimiter": st.sampled_from([",", ";", " ", ".", "1", "ab"]),
        "decimal": st.sampled_from([".", ","]),
        "encoding": st.sampled_from(["utf-8", "utf-16", "ascii", "idna", "rot13", "zlib"]),
        "comment": st.sampled_from(["#", None, "1", ","]),
        "header": st.booleans(),
        "skip_rows": st.integers(0, 20),
        "missing": st.sampled_from(["refuse", "keep"]),
        "resample": st.booleans(),
        "variable": st.just("x"),
    },
)


def numbers_in(content: bytes) -> set[float]:
    """All numbers that any reading of the file could find, whatever the signs in it mean."""
    found = {0.0, 1.0}
    for encoding in ("utf-8", "utf-16-le", "utf-16-be", "latin-1"):
        text = content.decode(encoding, errors="replace")
        for delimiters in (r"[\s;|,\"]+", r"[\s;|\"]+"):
            for token in re.split(delimiters, text):
                try:
                    found.add(float(token.replace(",", ".").strip("\0")))
                except ValueError:
                    continue
    return found


def check(record: cr.Record, content: bytes) -> None:
    """A record is in order, and holds no number that the file does not."""
    event("read")
    assert record.n_samples >= 3
    assert 0 < record.dt < np.inf
    assert np.isfinite(record.time).all()
    known = np.array(sorted(numbers_in(content)))
    values = np.concatenate([np.ravel(record.input), np.ravel(record.output)])
    assert np.isin(values[~np.isnan(values)], known).all()


@fuzz(150)
@given(tables())
def test_any_table_is_read_or_refused(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "fuzzed.csv"
    file.write_bytes(content)
    with good_end() as records:
        records.append(read_record(file))
    for record in records:
        check(record, content)


@fuzz(100)
@given(mutations())
def test_a_damaged_table_is_read_or_refused(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "damaged.csv"
    file.write_bytes(content)
    with good_end() as records:
        records.append(read_record(file))
    for record in records:
        check(record, content)


@fuzz(100)
@given(st.one_of(tables(), mutations()), CHOICES)
def test_any_choice_of_arguments_is_followed_or_refused(tmp_path_factory, content, choice):
    file = tmp_path_factory.getbasetemp() / "chosen.csv"
    file.write_bytes(content)
    with good_end() as records:
        records.append(read_record(file, **choice))
    for record in records:
        assert np.isfinite(record.time).all()
        if not choice.get("resample") and "encoding" not in choice and "delimiter" not in choice:
            check(record, content)


@fuzz(80)
@given(tables())
def test_any_table_is_a_frequency_response_or_refused(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "frf.csv"
    file.write_bytes(content)
    with good_end() as responses:
        responses.append(read_frf(file))
    for frf in responses:
        assert np.isfinite(frf.frdata).all()
        assert (frf.frequency_hz >= 0).all()


@fuzz(60)
@given(st.binary(max_size=600), st.sampled_from([".csv", ".mat", ".npz", ""]))
def test_any_bytes_are_refused_or_read(tmp_path_factory, content, ending):
    file = tmp_path_factory.getbasetemp() / f"bytes{ending}"
    file.write_bytes(content)
    for read in (read_record, read_frf):
        with good_end():
            read(file)
