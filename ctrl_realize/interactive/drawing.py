"""What a page draws, as data: panels with axes, layers and handles.

Lines are thinned as those of reports (`report.svg`), and the looks are names of the colours that
the style of reports gives.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._wording import in_digits, time_unit
from ..numerics.arrays import FloatArray
from ..report.svg import envelope, path_of

JSON: TypeAlias = dict[str, Any]
POINTS = 900
"""Points of a line, of which a page has fewer columns."""
_DIGITS = 7
_ROOM = 0.05  # of a range, left free at its ends


def numbers(values: ArrayLike) -> list[float | None]:
    """Numbers for JSON, rounded to what a drawing shows; None where there is none."""
    given = np.asarray(values, dtype=np.float64)
    size = np.abs(np.where(np.isfinite(given) & (given != 0), given, 1.0))
    digits = 10.0 ** (_DIGITS - 1 - np.floor(np.log10(size)))
    finite = np.isfinite(given)
    rounded = np.where(finite, np.round(np.where(finite, given, 0.0) * digits) / digits, np.nan)
    return [value if ok else None for value, ok in zip(rounded.tolist(), finite, strict=True)]


def line(x: FloatArray, y: FloatArray, look: str, name: str = "", **more: Any) -> JSON:
    """Line through points; of many, the envelope."""
    if x.size > POINTS:
        x, y = envelope(x, y, POINTS) if (np.diff(x) >= 0).all() else path_of(x, y)
    return {"kind": "line", "look": look, "name": name, "x": numbers(x), "y": numbers(y), **more}


def lines(x: FloatArray, many: Iterable[FloatArray], look: str, name: str = "") -> JSON:
    """Many curves over the same points, alike."""
    return {"kind": "lines", "look": look, "name": name, "x": numbers(x),
            "many": [numbers(y) for y in many]}  # fmt: skip


def band(x: FloatArray, low: FloatArray, high: FloatArray, look: str, name: str = "") -> JSON:
    """Area between two curves."""
    return {
        "kind": "band", "look": look, "name": name,
        "x": numbers(x), "low": numbers(low), "high": numbers(high),
    }  # fmt: skip


def span(low: float, high: float, look: str, name: str = "") -> JSON:
    """Interval on the horizontal axis, at full height."""
    return {"kind": "span", "look": look, "name": name, "low": float(low), "high": float(high)}


def level(y: float, look: str, name: str = "") -> JSON:
    """Horizontal line."""
    return {"kind": "level", "look": look, "name": name, "y": float(y)}


def axis(label: str, unit: str = "", ends: Sequence[float] | None = None) -> JSON:
    """Axis; its ends are those of the layers if they are not given."""
    return {"label": label, "unit": unit, "ends": None if ends is None else [*map(float, ends)]}


def handle(
    name: str, label: str, value: float, text: str, *, ends: tuple[float, float],
    along: str = "x", per_unit: float = 1.0, offset: float = 0.0, step: float | None = None,
) -> JSON:  # fmt: skip
    """Something to take hold of; a command gets ``(position - offset) / per_unit``."""
    low, high = ends
    return {
        "name": name, "label": label, "value": float(value), "text": text, "along": along,
        "low": float(low), "high": float(high), "per_unit": per_unit, "offset": float(offset),
        "step": float((high - low) / 200 if step is None else step),
    }  # fmt: skip


def panel(
    key: str, title: str, x: JSON, y: JSON, layers: Iterable[JSON], handles: Iterable[JSON] = (),
    **more: Any,
) -> JSON:  # fmt: skip
    """Axes with what is drawn in them."""
    drawn = [one for one in layers if one]
    for one, keys in ((x, ("x",)), (y, ("y", "low", "high"))):
        if one["ends"] is None:
            one["ends"] = _ends(drawn, keys, x["ends"] if one is y else None)
    return {
        "key": key, "title": title, "x": x, "y": y, "layers": drawn, "handles": [*handles], **more,
    }  # fmt: skip


def _ends(layers: Sequence[JSON], keys: Sequence[str], within: list[float] | None) -> list[float]:
    """Smallest and largest value of curves, for the part that is shown."""
    found: list[float] = []
    for one in layers:
        for key in keys:
            if key not in one or (one["kind"] == "span" and key != "x"):
                continue
            values = np.ravel(np.asarray(one[key], dtype=np.float64))
            if one["kind"] in ("line", "band") and within is not None:
                across = np.asarray(one["x"], dtype=np.float64)
                values = values[(across >= within[0]) & (across <= within[1])]
            values = values[np.isfinite(values)]
            found += [float(values.min()), float(values.max())] if values.size else []
    if not found:
        return [0.0, 1.0]
    low, high = min(found), max(found)
    if low == high:
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    room = 0.0 if keys[0] == "x" else _ROOM * (high - low)
    return [low - room, high + room]


def time_axis(largest: float, label: str = "time") -> tuple[float, JSON]:
    """Units per second, and an axis of time in the unit of the record."""
    factor, unit = time_unit(largest)
    return factor, axis(label, unit)


def number(value: float) -> str:
    """Write a number as on a card."""
    return in_digits(value)
