"""Text tables, from nearly right to nonsense."""

import csv
import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.io import read_frf, read_record
from ctrl_realize.plots.names import plain, wrapped
from ctrl_realize.report.svg import inline_svg, laid_out
from tests.fuzz.draws import any_bytes, any_float, any_name, any_text, chosen, of, sometimes
from tests.fuzz.lane import fuzz, good_end

KINDS = [
    lambda rng: str(rng.randint(-1000, 1000)),
    lambda rng: repr(any_float(rng, finite=True)),
    lambda rng: f"{rng.uniform(-100, 100):.3f}",
    lambda rng: f"{rng.uniform(-100, 100):.2f}".replace(".", ","),
]
SPELLINGS = ["0", "-0", "+1", "1.", ".5", ",5", "1e5", "1E-300", "5e-324", "1.7e308"]
ODD = (
        ["", " ", "NaN", "nan", "inf", "-inf", "1e999", "-", "+", ".", "e5", "1e", "0x1F", "1_0",
         "1.2.3", "1,2,3", "1 000", "TRUE", "false", "#N/A", "null", "2026-03-01", "12:30:01.5",
         "2026-03-01T12:00:00Z", "9" * 400, "1" * 25, "²", "−1", "１", "\0", "\x1a", '"', '""', "'",
         "=1+1", "1;2", "1\t2", "t", "time", "u", "y", "[s]", "(V)", "#", "%", "\ufeff", "\u2028"]
)  # fmt: skip
HEADERS = (
    ["time,input,output", "t;u;y", "t\tu\ty", "t u y", "Zeit [ms];Eingang;Ausgang", "f,re,im",
     "frequency_hz,magnitude_db,phase_deg", "omega mag phase_rad", "a,b,c", "# t,u,y", "u,y", "",
     "t,u,y,", "t,u1,u2,y1,y2", '"t","u","y"', "t,u,y\ns,V,V", "t,t,u,y", "1,2,3", "date time,u,y"]
)  # fmt: skip
ENDS = ["\n", "\r\n", "\r", "\n\n"]
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"]


def any_number(rng):
    return rng.choice(SPELLINGS) if sometimes(rng, 5) else rng.choice(KINDS)(rng)


def any_cell(rng):
    return rng.choice(ODD) if rng.randrange(3) else any_text(rng, 8)


def any_table(rng) -> bytes:
    """A table whose rows are regular, with single cells and lines put out of order."""
    delimiter = rng.choice([",", ";", "\t", " ", "|", ", ", "  ", "·"])
    regular = rng.randrange(2)
    width = 3 if regular else rng.randint(1, 5)
    kind = rng.choice(KINDS) if regular else any_number
    rows = [
        [f"{k / 8}", *(kind(rng) for _ in range(width - 1))]
        for k in range(rng.randint(3 * regular, 12))
    ]
    for _ in range(rng.randint(0, 3 - 2 * regular) if rows else 0):
        row = rng.choice(rows)
        if row and rng.randrange(2):
            row[rng.randrange(len(row))] = any_cell(rng)
        elif rng.randrange(2):
            row.append(any_cell(rng))
        elif row:
            row.pop()
    header = delimiter.join("tuy") if regular else rng.choice(HEADERS)
    lines = [header, *(delimiter.join(row) for row in rows)]
    for _ in range(rng.randint(0, 2 - 2 * regular)):
        lines.insert(rng.randint(0, len(lines)), rng.choice([any_cell(rng), any_text(rng, 30)]))
    text = rng.choice(ENDS).join(lines) + rng.choice(["", "\n", "\r\n", "\0\0\0"])
    return text.encode(rng.choice(ENCODINGS), errors="replace")


GOOD = b"time_s,input,output\n" + b"".join(b"%g,%d,%.3f\n" % (k / 8, k > 3, k) for k in range(12))


def mutated(rng) -> bytes:
    """A good file with some bytes changed, taken out, or doubled."""
    content = bytearray(GOOD)
    for _ in range(rng.randint(1, 3)):
        place = rng.randrange(len(content))
        length = rng.randint(1, 12)
        kind = rng.choice(["change", "cut", "double", "insert"])
        if kind == "change":
            common = rng.randrange(2)
            content[place] = rng.choice(b"0123456789.,;-e\n ") if common else rng.randrange(256)
        elif kind == "cut" and len(content) > 2 * length:
            del content[place : place + length]
        elif kind == "double":
            content[place:place] = content[place : place + length]
        else:
            content[place:place] = any_bytes(rng, length)
    return bytes(content)


OPTIONS = {
    "time": of(0, 1, "t", "time"),
    "input": of(0, 1, "u", [1, 2], "b"),
    "output": of(0, 2, "y", "c", -1),
    "dt": of(1.0, 1e-9, 0, -1, float("nan"), 1e300, 5e-324),
    "time_unit": of("auto", "ms", "h", "fortnight"),
    "time_format": of("%d.%m.%Y", "%", ""),
    "delimiter": of(",", ";", " ", ".", "1", "ab", "·", "\U0001f600"),
    "decimal": of(".", ","),
    "encoding": of("utf-8", "utf-16", "ascii", "idna", "rot13", "zlib"),
    "comment": of("#", None, "1", ",", "§"),
    "header": of(True, False),
    "skip_rows": lambda rng: rng.randint(0, 20),
    "missing": of("refuse", "keep"),
    "resample": of(True, False),
    "variable": of("x"),
    "max_bytes": of(1e9, 10, -1, float("nan")),
}
ODD_KINDS = (None, True, 3, -7, 1.5, "", b"t", [], {}, object, float("nan"))
"""What none of the arguments, or nearly none, should be."""


def numbers_in(content: bytes) -> set[float]:
    """All numbers that any reading of the file could find, whatever the signs in it mean."""
    found = {0.0, 1.0}
    for encoding in ("utf-8", "utf-16-le", "utf-16-be", "latin-1"):
        text = content.decode(encoding, errors="replace")
        for delimiters in (r"[\s;|,\"·§]+", r"[\s;|\"·§]+"):
            for token in re.split(delimiters, text):
                try:
                    found.add(float(token.replace(",", ".").strip("\0")))
                except ValueError:
                    continue
    return found


def check(record: cr.Record, content: bytes) -> None:
    """A record is in order, and holds no number that the file does not."""
    assert record.n_samples >= 3
    assert 0 < record.dt < np.inf
    assert np.isfinite(record.time).all()
    known = np.array(sorted(numbers_in(content)))
    values = np.concatenate([np.ravel(record.input), np.ravel(record.output)])
    assert np.isin(values[~np.isnan(values)], known).all()


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("text") / "fuzzed.csv"


def read_and_check(file, content: bytes) -> None:
    file.write_bytes(content)
    with good_end() as records:
        records.append(read_record(file))
    for record in records:
        check(record, content)


@fuzz(150)
def test_any_table_is_read_or_refused(rng, file):
    read_and_check(file, any_table(rng))


BREAKS = ["\n", "\r\n", "\r", "\r\r\n"]


@fuzz(60)
def test_names_come_back_and_no_sample_is_lost_whatever_the_lines_end_in(rng, file):
    count, delimiter, end = rng.randint(3, 12), rng.choice(",;\t"), rng.choice(BREAKS)
    names = [any_name(rng), any_name(rng) + "2"]
    broken = [name.replace(" ", rng.choice([" ", "\n", " \r\n "])) for name in names]
    buffer = io.StringIO()
    writer = csv.writer(
        buffer, delimiter=delimiter, lineterminator=end, quoting=csv.QUOTE_NONNUMERIC
    )
    writer.writerow(["time_s", *broken])
    blank = [end * rng.randrange(3) for _ in range(3)]
    rows = [delimiter.join([f"{k / 8}", f"{k % 2}", f"{k}.25"]) + end for k in range(count)]
    text = blank[0] + buffer.getvalue() + blank[1] + "".join(rows) + blank[2]
    file.write_bytes(text.encode())
    with good_end() as records:
        records.append(read_record(file, input=1, output=2))
    (record,) = records
    assert record.n_samples == count
    assert record.output.tolist() == [k + 0.25 for k in range(count)]
    labels = [" ".join(label.split()) for label in record.input_labels + record.output_labels]
    assert labels == [" ".join(name.split()) for name in names]


@fuzz(15)
def test_any_name_is_shown_in_a_figure_as_it_is_written(rng):
    name = any_name(rng)

    def draw(figure):
        figure.subplots().set_axis_off()
        figure.text(0, 0, plain(name))
        figure.text(0, 0.5, wrapped(name, rng.randint(3, 80)))

    with good_end() as drawn:
        drawn.append(inline_svg(laid_out(draw, (3, 2)), "k", name))
    svg = drawn[0]
    shown = plain(name).replace(r"\$", "$")
    texts = [text for text in ElementTree.fromstring(svg).itertext() if text.strip()]
    assert " ".join(texts[0].split()) == " ".join(shown.split())


@fuzz(100)
def test_a_damaged_table_is_read_or_refused(rng, file):
    read_and_check(file, mutated(rng))


@fuzz(100)
def test_any_choice_of_arguments_is_followed_or_refused(rng, file):
    content, choice = rng.choice([any_table, mutated])(rng), chosen(rng, OPTIONS)
    if choice and sometimes(rng, 10):
        choice[rng.choice(sorted(choice))] = rng.choice(ODD_KINDS)
    file.write_bytes(content)
    with good_end() as records:
        records.append(read_record(file, **choice))
    for record in records:
        assert np.isfinite(record.time).all()
        if not choice.get("resample") and "encoding" not in choice and "delimiter" not in choice:
            check(record, content)


FRF_HEADERS = ["f,re,im", "frequency_hz,magnitude_db,phase_deg", "omega mag phase_rad", "f,mag"]


def frf_table(rng) -> bytes:
    """A frequency response, mostly in order."""
    delimiter = rng.choice([",", ";", "\t"])
    header = re.sub("[ ,]", lambda _: delimiter, rng.choice(FRF_HEADERS))
    rows = [
        [f"{(k + 1) / 4}", f"{rng.uniform(0, 2):.3f}", f"{rng.uniform(-3, 3):.3f}"]
        for k in range(rng.randint(2, 12))
    ]
    for _ in range(rng.randint(0, 2)):
        rng.choice(rows)[rng.randrange(3)] = rng.choice([any_cell, any_number])(rng)
    width = header.count(delimiter) + 1
    lines = [header, *(delimiter.join(row[:width]) for row in rows)]
    return "\n".join(lines).encode(rng.choice(ENCODINGS), errors="replace")


@fuzz(80)
def test_any_table_is_a_frequency_response_or_refused(rng, file):
    file.write_bytes(rng.choice([any_table, frf_table, frf_table])(rng))
    with good_end() as responses:
        responses.append(read_frf(file))
    for frf in responses:
        assert np.isfinite(frf.frdata).all()
        assert (frf.frequency_hz >= 0).all()


@fuzz(60)
def test_any_bytes_are_refused_or_read(rng, file):
    other = file.with_suffix(rng.choice([".csv", ".mat", ".npz", ""]))
    other.write_bytes(any_bytes(rng, 600))
    for read in (read_record, read_frf):
        with good_end():
            read(other)
