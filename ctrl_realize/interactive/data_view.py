"""How records are drawn: their signals with range, rest and step to drag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from .._wording import count_of, in_time
from ..data import Record
from .drawing import JSON, axis, handle, layer, line, panel, time_axis
from .records import edge_of, shifted

Row: TypeAlias = tuple[Mapping[str, Any], Record | None, Sequence[str], Record | None]
"""State of a record, the record as it was read, what was said about it, and as it is used."""


def data_view(rows: Sequence[Row], selected: int) -> JSON:
    """List records, and draw the one that is selected with the others as layers behind it."""
    listed = [
        {"name": row["name"], "used": row["used"], "notes": [*said], "bad": record is None,
         "facts": "" if record is None else _facts(record)}
        for row, record, said, _ in rows
    ]  # fmt: skip
    panels: list[JSON] = []
    if rows:
        row, raw, _, used = rows[selected]
        behind = [each[3] for k, each in enumerate(rows) if k != selected]
        if raw is not None and used is not None:
            panels = _panels(row, raw, used, [one for one in behind if one is not None])
    return {"records": listed, "panels": panels}


def _facts(record: Record) -> str:
    """One line about a record."""
    length = in_time(record.time[-1] - record.time[0], 4)
    if record.irregular:
        usual = in_time(record.sample_time, 4)
        return f"{np.count_nonzero(record.seen)} samples about {usual} apart, {length} long"
    gaps = f", {count_of(record.n_missing, 'missing value')}" if record.n_missing else ""
    return f"{record.n_samples} samples of {in_time(record.dt, 4)}, {length} long{gaps}"


def _panels(
    row: Mapping[str, Any], raw: Record, used: Record, behind: Sequence[Record]
) -> list[JSON]:
    factor, across = time_axis(raw.time)
    time, edge = factor * raw.time, edge_of(used)
    first, last = raw.time[[0, -1]].tolist()
    start, stop = row["range"] or (first, last)
    out = [(*ends, "struck out") for ends in row["struck"]]
    out += [(first, start, ""), (stop, last, "")]
    there = ~np.isnan(raw.output)
    begin = first if edge is None else edge.time
    seen, before = raw.output[there], raw.output[there & (raw.time < begin)]
    rest = row["rest"][1] if row["rest"] else float(np.median(before if before.size else seen[:1]))
    layers = [line(factor * one.time, one.output, "plausible") for one in behind]
    layers += [layer("span", "out", said, low=factor * a, high=factor * b)
               for a, b, said in out if a < b]  # fmt: skip
    layers.append(line(time, raw.output, "measured", raw.output_labels[0]))
    if raw.reference is not None:
        layers.append(line(time, raw.reference, "input", "set point"))
    layers.append(layer("level", "input", "level at rest", y=rest))
    step, reach = max(raw.dt, (last - first) / 400), 0.5 * float(np.ptp(seen) or 1.0)
    ends, whole = (float(seen.min()) - reach, float(seen.max()) + reach), (first, last)
    place: JSON = {"per_unit": factor}
    handles = [
        handle("start", "start of the range", start, in_time(start, 4), whole, step, **place),
        handle("stop", "end of the range", stop, in_time(stop, 4), whole, step, **place),
        handle("rest", "level at rest", rest, f"{rest:.4g}", ends, reach / 100, along="y"),
    ]
    signal = shifted(raw, row["shift"]) if row["shift"] else raw.input
    below = [line(time, signal, "input", raw.input_labels[0])]
    at, level = (None, float(raw.input[0])) if edge is None else (edge.time, edge.baseline)
    said = in_time(begin, 4)
    driven = [handle("step", "time of the step", begin, said, whole, raw.dt, per_unit=factor)]
    labels = {"input": raw.input_labels[0], "output": raw.output_labels[0]}
    units = {key: row["units"].get(key, raw.units.get(label, "")) for key, label in labels.items()}
    u, y = (axis(key if labels[key] in "uy" else labels[key], units[key]) for key in labels)
    more: JSON = {"strike": True, "units": units, "rest_input": level, "step_time": at}
    return [
        panel("record-output", "Output", across, y, layers, handles, **more),
        panel("record-input", "Input", across, u, below, [] if at is None else driven, short=True),
    ]
