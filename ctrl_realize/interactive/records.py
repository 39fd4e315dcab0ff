"""Files of a session: how they are read, what is changed in them, and Python that does it."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..data import MeasuredFRF, Record, StepEdge
from ..errors import CtrlRealizeError, DataError
from ..identification.step.steps import detect_step
from ..io import read_frf, read_record
from ..io.checks import MAX_BYTES
from ..io.read import read_table
from ..io.signals.names import choose_columns
from ..io.text_options import TextOptions
from ..numerics.arrays import FloatArray
from .drawing import JSON

SHOWN_ROWS, MOST_COLUMNS = 6, 60
_ARRAYS = ("time", "input", "output")
_SAMPLES = (*_ARRAYS, "reference")


@contextmanager
def _file(content: bytes, name: str) -> Iterator[Path]:
    """File with some content and its name; errors tell the name alone."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(name).name
        path.write_bytes(content)
        try:
            yield path
        except CtrlRealizeError as error:
            raise type(error)(str(error).replace(f"{path.parent}{os.sep}", "")) from error


def given_content(record: Record) -> bytes:
    """Store a record that was given from Python like the content of a file, exactly."""

    def listed(values: Any) -> Any:
        return [None if np.isnan(one) else one for one in values.tolist()]

    given = record._arguments()
    arrays = {key: one for key, one in given.items() if isinstance(one, np.ndarray)}
    return json.dumps(given | {key: listed(one) for key, one in arrays.items()}).encode()


def read(content: bytes, row: Mapping[str, Any]) -> tuple[Record, list[str]]:
    """Read a record and what there is to say about it.

    Raises
    ------
    CtrlRealizeError
        As `read_record`.
    """
    with _file(content, row["name"]) as path, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        if row["given"]:
            stored = json.loads(content)
            samples = {key: one for key, one in stored.items() if key in _SAMPLES and one}
            arrays = {key: np.array(one, dtype=np.float64) for key, one in samples.items()}
            record = Record(**stored | arrays)
        else:
            record = read_record(path, **row["options"])
        said = [str(one.message).replace(f"{path.parent}{os.sep}", "") for one in told]
    if not record.issiso():
        numbers = f"{record.ninputs} inputs and {record.noutputs} outputs"
        raise DataError(f"the record has {numbers}; expected one of each: choose the columns")
    return record, said


def why_unreadable(content: bytes, name: str) -> str:
    """Why a file is no record as it stands; empty if it is one."""
    try:
        read(content, {"name": name, "options": {}, "given": None})
    except CtrlRealizeError as error:
        return str(error)
    return ""


def read_response(content: bytes, name: str) -> MeasuredFRF:
    """Read a measured frequency response."""
    with _file(content, name) as path:
        return read_frf(path)


def preview(content: bytes, row: Mapping[str, Any]) -> JSON:
    """First rows of a file with its columns, and what they are taken for."""
    options = row["options"]
    how = TextOptions.among(options)
    try:
        with _file(content, row["name"]) as path:
            table = read_table(path, how, variable=options.get("variable"), max_bytes=MAX_BYTES)
    except CtrlRealizeError:
        return {"columns": [], "taken": {}}
    asked: Any = [options.get(key) for key in (*_ARRAYS, "dt")]
    taken = asked[:3]
    # What is guessed is told by `read`.
    with suppress(CtrlRealizeError), warnings.catch_warnings(action="ignore"):
        parts = choose_columns(table, *asked)
        taken = [parts.time, parts.inputs[0], parts.outputs[0]]
    columns = [
        {"name": one.name or f"column {k}", "unit": one.unit,
         "cells": [f"{cell:.6g}" if isinstance(cell, float) else str(cell)[:24]
                   for cell in one.first(SHOWN_ROWS).tolist()]}
        for k, one in enumerate(table.columns[:MOST_COLUMNS])
    ]  # fmt: skip
    return {"columns": columns, "taken": dict(zip(_ARRAYS, taken, strict=True))}


def edited(record: Record, row: Mapping[str, Any]) -> Record:
    """Make the changes that were asked for: units, shift of the input, range, gaps, rest."""
    output = record.output.copy()
    named = {"input": record.input_labels[0], "output": record.output_labels[0]}
    units = dict(record.units) | {named[key]: unit for key, unit in row["units"].items()}
    for start, stop in row["struck"]:
        output[(record.time >= start) & (record.time <= stop)] = np.nan
    missing = "keep" if row["struck"] else record.missing
    signal = shifted(record, row["shift"]) if row["shift"] else record.input
    found = record.__replace__(input=signal, output=output, units=units, missing=missing)
    if row["range"]:
        found = found[slice(*row["range"])]
    if row["rest"]:
        *levels, start = row["rest"]
        found = (found if start is None else found[start:]).with_baseline(*levels)
    return found


def shifted(record: Record, shift: float) -> FloatArray:
    """Input (N,) that acts later by a time in s, held between its samples."""
    late = record.time - shift + 1e-9 * record.dt
    at = np.searchsorted(record.time, late, side="right") - 1
    return np.asarray(record.input[np.clip(at, 0, None)])


def edge_of(record: Record) -> StepEdge | None:
    """The first large step of the input, if it steps."""
    with suppress(CtrlRealizeError):
        return detect_step(record)
    return None


def python_lines(row: Mapping[str, Any], name: str) -> list[str]:
    """Lines of Python that read a record and change it likewise."""
    options = "".join(f", {key}={value!r}" for key, value in row["options"].items())
    lines = [f"{name} = cr.read_record({row['path'] or row['name']!r}{options})"]
    if row["given"]:
        lines = [f"# {name}: the record that was given to cr.app"]
    if row["units"] or row["shift"] or row["struck"]:
        lines.append(f"signal, output, units = {name}.input, {name}.output.copy(), {{}}")
        lines += [f"units[{name}.{key}_labels[0]] = {unit!r}" for key, unit in row["units"].items()]
        if row["shift"]:
            late = f"{name}.time - {row['shift']!r} + 1e-9 * {name}.dt"
            lines += [f"at = np.searchsorted({name}.time, {late}, side='right') - 1",
                      "signal = signal[np.clip(at, 0, None)]"]  # fmt: skip
        lines += [
            f"output[({name}.time >= {start!r}) & ({name}.time <= {stop!r})] = np.nan"
            for start, stop in row["struck"]
        ]
        missing = "'keep'" if row["struck"] else f"{name}.missing"
        lines += [
            f"{name} = cr.Record(",
            f"    {name}.time, signal, output, units={{**{name}.units, **units}},",
            f"    name={name}.name, missing={missing}, reference={name}.reference,",
            f"    input_labels={name}.input_labels, output_labels={name}.output_labels,",
            f"    sample_time={name}.sample_time,",
            ")",
        ]
    if row["range"]:
        lines.append(f"{name} = {name}[{row['range'][0]!r}:{row['range'][1]!r}]")
    if row["rest"]:
        *levels, start = row["rest"]
        begun = name if start is None else f"{name}[{start!r}:]"
        lines.append(f"{name} = {begun}.with_baseline({levels[0]!r}, {levels[1]!r})")
    return lines
