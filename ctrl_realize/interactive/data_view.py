"""How records are drawn: their signals with range, rest and step to drag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from .._wording import in_time
from ..data import Record
from ..numerics.arrays import FloatArray
from .drawing import JSON, axis, handle, level, line, number, panel, span, time_axis
from .records import edge_of, shifted

Row: TypeAlias = tuple[Mapping[str, Any], Record | None, Sequence[str], Record | None]
"""State of a record, the record as it was read, what was said about it, and as it is used."""


def data_view(rows: Sequence[Row], selected: int) -> JSON:
    """List records, and draw the one that is selected with the others as layers behind it."""
    listed = [
        {
            "name": row["name"], "used": row["used"], "notes": list(said),
            "facts": "" if record is None else facts(record), "bad": record is None,
        }
        for row, record, said, _ in rows
    ]  # fmt: skip
    panels: list[JSON] = []
    if rows and rows[selected][1] is not None:
        row, raw, _, used = rows[selected]
        behind = [one for k, (_, _, _, one) in enumerate(rows) if k != selected and one is not None]
        assert raw is not None
        panels = _panels(row, raw, used, behind)
    return {"records": listed, "panels": panels}


def facts(record: Record) -> str:
    """One line about a record."""
    gaps = f", {record.n_missing} missing values" if record.n_missing else ""
    return (
        f"{record.n_samples} samples of {in_time(record.dt, 4)}, "
        f"{in_time(record.time[-1] - record.time[0], 4)} long{gaps}"
    )


def _panels(
    row: Mapping[str, Any], raw: Record, used: Record | None, behind: Sequence[Record]
) -> list[JSON]:
    time = raw.time
    factor, across = time_axis(float(np.abs(time[[0, -1]]).max()))
    across["ends"] = [factor * float(time[0]), factor * float(time[-1])]
    start, stop = row["range"] or (float(time[0]), float(time[-1]))
    edge = None if used is None else edge_of(used)
    layers = [
        *[line(factor * one.time, one.output, "plausible") for one in behind],
        *_left_out(row, raw, factor),
        line(factor * time, raw.output, "measured", raw.output_labels[0]),
    ]
    ends: JSON = {"ends": tuple(across["ends"]), "per_unit": factor}
    step = factor * max(raw.dt, (time[-1] - time[0]) / 400)
    handles = [
        handle("start", "start of the range", factor * start, in_time(start, 4), step=step, **ends),
        handle("stop", "end of the range", factor * stop, in_time(stop, 4), step=step, **ends),
    ]
    rest = _rest_level(row, raw, None if edge is None else edge.time)
    low, high = float(np.nanmin(raw.output)), float(np.nanmax(raw.output))
    if rest is not None and low < high:
        layers.append(level(rest, "input", "level at rest"))
        reach = 0.5 * (high - low)
        handles.append(
            handle("rest", "level at rest", rest, number(rest), ends=(low - reach, high + reach),
                   along="y")
        )  # fmt: skip
    more = {
        "strike": True,
        "rest_input": None if edge is None else edge.baseline,
        "step_time": None if edge is None else edge.time,
    }
    signal = raw.input
    if row["shift"]:
        signal = shifted(time, signal, row["shift"])
    below = [line(factor * time, signal, "input", raw.input_labels[0])]
    driven = []
    if edge is not None:
        at = factor * edge.time
        driven = [
            handle("step", "time of the step", at, in_time(edge.time, 4), per_unit=factor,
                   ends=(across["ends"][0], across["ends"][1]), step=factor * raw.dt)
        ]  # fmt: skip
    names = {
        key: row["units"].get(key, dict(raw.units).get(label, ""))
        for key, label in (("input", raw.input_labels[0]), ("output", raw.output_labels[0]))
    }
    y = axis(_named(raw.output_labels[0], "y", "output"), names["output"])
    u = axis(_named(raw.input_labels[0], "u", "input"), names["input"])
    return [
        panel("record-output", "Output", dict(across), y, layers, handles, units=names, **more),
        panel("record-input", "Input", dict(across), u, below, driven, short=True,
              shift=row["shift"]),
    ]  # fmt: skip


def _named(label: str, plain: str, word: str) -> str:
    return word if label == plain else label


def _left_out(row: Mapping[str, Any], raw: Record, factor: float) -> list[JSON]:
    first, last = factor * float(raw.time[0]), factor * float(raw.time[-1])
    found = [span(factor * start, factor * stop, "out", "struck out") for start, stop in
             row["struck"]]  # fmt: skip
    if row["range"]:
        start, stop = (factor * end for end in row["range"])
        found += [span(first, start, "out"), span(stop, last, "out")]
    return [one for one in found if one["low"] < one["high"]]


def _rest_level(row: Mapping[str, Any], raw: Record, step: float | None) -> float | None:
    if row["rest"]:
        return float(row["rest"][1])
    before: FloatArray = raw.output[raw.time < (raw.time[0] if step is None else step)]
    before = before[~np.isnan(before)]
    return float(np.median(before)) if before.size else float(raw.output[~np.isnan(raw.output)][0])
