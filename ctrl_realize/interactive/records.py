"""Files of a session: how they are read, what is changed in them, and Python that does it."""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Record, StepEdge
from ..errors import CtrlRealizeError, FileFormatError, NoStepError
from ..identification.step.steps import detect_step
from ..io import read_frf, read_record
from ..io.checks import MAX_BYTES
from ..io.read import read_table
from ..io.signals.names import choose_columns
from ..io.tables import Table
from ..io.text_options import TextOptions
from ..numerics.arrays import FloatArray
from .drawing import JSON

SHOWN_ROWS = 6
ATTEMPTS: tuple[JSON, ...] = ({}, {"missing": "keep"}, {"resample": True})
"""Ways to read a file, of which the first that succeeds is the first guess."""
_ARRAYS = ("time", "input", "output")
_TEXT = ("delimiter", "decimal", "encoding", "comment", "header", "skip_rows")
NEW: JSON = {
    "options": {}, "used": True, "range": None, "rest": None, "shift": 0.0, "struck": [],
    "units": {},
}  # fmt: skip
"""What is known of a record whose file has just been opened."""


def given_content(record: Record) -> bytes:
    """Store a record that was given from Python like the content of a file, exactly."""
    arrays = {
        name: [None if np.isnan(one) else one for one in values.tolist()]
        for name, values in (("time", record.time), ("input", record.input),
                             ("output", record.output))
    }  # fmt: skip
    labels = {"name": record.name, "input_labels": record.input_labels,
              "output_labels": record.output_labels, "units": dict(record.units),
              "missing": record.missing}  # fmt: skip
    return json.dumps(arrays | labels).encode()


def read(content: bytes, row: Mapping[str, Any]) -> tuple[Record, list[str]]:
    """Read a record and what there is to say about it.

    Raises
    ------
    CtrlRealizeError
        As `read_record`, with the name of the file alone.
    """
    if row.get("given"):
        stored = json.loads(content)
        arrays = [
            np.array(stored.pop(key), dtype=np.float64) for key in ("time", "input", "output")
        ]
        return Record(*arrays, **stored), []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(row["name"]).name
        path.write_bytes(content)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                record = read_record(path, **row["options"])
            except CtrlRealizeError as error:
                raise type(error)(str(error).replace(f"{folder}/", "")) from error
        return record, [str(one.message).replace(f"{folder}/", "") for one in told]


def first_reading(content: bytes, name: str) -> tuple[JSON, str]:
    """Options with which a file can be read, and why it cannot if there are none."""
    reasons = []
    for options in ATTEMPTS:
        try:
            read(content, {"name": name, "options": options})
        except CtrlRealizeError as error:
            reasons.append(str(error))
        else:
            return dict(options), ""
    return {}, reasons[0]


def read_response(content: bytes, name: str) -> Any:
    """Read a measured frequency response."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(name).name
        path.write_bytes(content)
        return read_frf(path)


def preview(content: bytes, row: Mapping[str, Any]) -> JSON:
    """First rows of a file with its columns, and what they are taken for."""
    if row.get("given"):
        return {"columns": [], "taken": {}}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(row["name"]).name
        path.write_bytes(content)
        options = row["options"]
        how = TextOptions(**{key: options[key] for key in _TEXT if key in options})
        try:
            table = read_table(path, how, variable=options.get("variable"), max_bytes=MAX_BYTES)
        except CtrlRealizeError:
            return {"columns": [], "taken": {}}
    columns = [
        {"name": one.name or f"column {k}", "unit": one.unit,
         "cells": [_cell(cell) for cell in one.first(SHOWN_ROWS)]}
        for k, one in enumerate(table.columns)
    ]  # fmt: skip
    return {"columns": columns, "taken": _taken(table, options)}


def _cell(cell: Any) -> str:
    return f"{cell:.6g}" if isinstance(cell, float | np.floating) else str(cell)[:24]


def _taken(table: Table, options: Mapping[str, Any]) -> JSON:
    asked: Any = [options.get(key) for key in ("time", "input", "output", "dt")]
    try:
        parts = choose_columns(table, *asked[:4])
    except CtrlRealizeError:
        return dict(zip(("time", "input", "output"), asked, strict=False))
    return {"time": parts.time, "input": parts.inputs[0], "output": parts.outputs[0]}


def edited(record: Record, row: Mapping[str, Any]) -> Record:
    """Make the changes that were asked for: units, shift of the input, range, gaps, rest."""
    labels: JSON = {
        "name": record.name, "input_labels": record.input_labels,
        "output_labels": record.output_labels, "units": dict(record.units),
        "missing": record.missing,
    }  # fmt: skip
    output, signal = record.output.copy(), record.input
    named = {"input": record.input_labels[0], "output": record.output_labels[0]}
    labels["units"] |= {named[key]: unit for key, unit in row["units"].items() if key in named}
    if row["shift"]:
        signal = shifted(record.time, signal, row["shift"])
    for start, stop in row["struck"]:
        output[..., (record.time >= start) & (record.time <= stop)] = np.nan
        labels["missing"] = "keep"
    found = Record(record.time, signal, output, **labels)
    if row["range"]:
        found = found[row["range"][0] : row["range"][1]]
    if row["rest"]:
        *levels, start = row["rest"]
        found = (found if start is None else found[start:]).with_baseline(*levels)
    return found


def shifted(time: FloatArray, signal: FloatArray, shift: float) -> FloatArray:
    """Input that acts later by a time in s, held between its samples."""
    at = np.searchsorted(time, time - shift + 1e-9 * (time[1] - time[0]), side="right") - 1
    return np.asarray(signal[..., np.clip(at, 0, time.size - 1)])


def edge_of(record: Record) -> StepEdge | None:
    """The first large step of the input, if it steps."""
    try:
        return detect_step(record)
    except (NoStepError, CtrlRealizeError):
        return None


def python_lines(row: Mapping[str, Any], name: str) -> list[str]:
    """Lines of Python that read a record and change it likewise."""
    if row.get("given"):
        lines = [f"# {name}: the record that was given to cr.app"]
    else:
        options = "".join(f", {key}={value!r}" for key, value in row["options"].items())
        lines = [f"{name} = cr.read_record({row.get('path') or row['name']!r}{options})"]
    if row["units"] or row["shift"] or row["struck"]:
        lines += [f"signal, output = {name}.input, {name}.output.copy()",
                  f"units = dict({name}.units)"]  # fmt: skip
        lines += [f"units[{name}.{key}_labels[0]] = {unit!r}" for key, unit in row["units"].items()]
        if row["shift"]:
            lines += [
                f"late = {name}.time - {row['shift']!r} + 1e-9 * {name}.dt",
                f"at = np.searchsorted({name}.time, late, side='right') - 1",
                "signal = signal[np.clip(at, 0, None)]",
            ]
        for start, stop in row["struck"]:
            lines.append(f"output[({name}.time >= {start!r}) & ({name}.time <= {stop!r})] = np.nan")
        missing = "'keep'" if row["struck"] else f"{name}.missing"
        lines += [
            f"{name} = cr.Record(",
            f"    {name}.time, signal, output, name={name}.name, units=units,",
            f"    input_labels={name}.input_labels, output_labels={name}.output_labels,",
            f"    missing={missing},",
            ")",
        ]
    if row["range"]:
        lines.append(f"{name} = {name}[{row['range'][0]!r}:{row['range'][1]!r}]")
    if row["rest"]:
        *levels, start = row["rest"]
        begun = name if start is None else f"{name}[{start!r}:]"
        lines.append(f"{name} = {begun}.with_baseline({levels[0]!r}, {levels[1]!r})")
    return lines


def checked_siso(record: Record) -> Record:
    """Refuse a record of several channels.

    Raises
    ------
    FileFormatError
    """
    if not record.issiso():
        raise FileFormatError(
            f"the record has {record.ninputs} inputs and {record.noutputs} outputs; expected one "
            "of each: choose the columns"
        )
    return record
