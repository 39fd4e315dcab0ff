"""What a page draws, as data: panels with axes, layers and handles.

Lines are thinned as those of reports (`report.svg`), and the looks are names of the colours that
the style of reports gives. The kinds of layers are ``"line"`` (x, y), ``"lines"`` (x, many),
``"band"`` (x, low, high), ``"span"`` (an interval of x: low, high) and ``"level"`` (y).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._wording import time_unit
from ..numerics.arrays import FloatArray
from ..report.svg import thinned

JSON: TypeAlias = dict[str, Any]
POINTS = 900
"""Points of a line, of which a page has fewer columns."""
_DIGITS = 7


def numbers(values: ArrayLike) -> Any:
    """Numbers for JSON, nested as they are, rounded to what is seen; None where there is none."""
    given = np.asarray(values, dtype=np.float64)
    with np.errstate(all="ignore"):
        digits = 10.0 ** (_DIGITS - 1 - np.floor(np.log10(np.abs(given))))
        rounded = np.where(given == 0, 0.0, np.round(given * digits) / digits).astype(object)
    rounded[~np.isfinite(given)] = None
    return rounded.tolist()


def layer(kind: str, look: str, name: str = "", **shape: ArrayLike) -> JSON:
    """Something that is drawn; its `name` is told in the legend."""
    return {"kind": kind, "look": look, "name": name} | {k: numbers(v) for k, v in shape.items()}


def line(x: FloatArray, y: FloatArray, look: str, name: str = "") -> JSON:
    """Line through points; of many, the envelope."""
    if x.size > POINTS:
        x, y = thinned(x, y, POINTS)
    return layer("line", look, name, x=x, y=y)


def axis(label: str, unit: str = "", ends: Sequence[float] | None = None) -> JSON:
    """Axis; without ends it is as long as what is drawn."""
    return {"label": label, "unit": unit, "ends": None if ends is None else [*map(float, ends)]}


def time_axis(time: FloatArray, label: str = "time") -> tuple[float, JSON]:
    """Units per second, and an axis of time from its first to its last, in the unit of the record.

    Parameters
    ----------
    time : ndarray, shape (N,)
        In s.
    """
    factor, unit = time_unit(float(np.abs(time).max()))
    return factor, axis(label, unit, (factor * time[[0, -1]]).tolist())


def handle(
    name: str, label: str, value: float, text: str, ends: tuple[float, float], step: float,
    *, along: str = "x", per_unit: float = 1.0, offset: float = 0.0,
) -> JSON:  # fmt: skip
    """Something to take hold of, at `value` between `ends`, that keys move by `step`.

    A command gets ``value``, which stands at ``offset + per_unit value`` on its axis.
    """
    at = {"value": value, "low": ends[0], "high": ends[1], "step": step}
    return {"name": name, "label": label, "text": text, "along": along, "offset": float(offset),
            "per_unit": float(per_unit)} | {key: float(one) for key, one in at.items()}  # fmt: skip


def panel(
    key: str, title: str, x: JSON, y: JSON, layers: Sequence[JSON], handles: Sequence[JSON] = (),
    **more: Any,
) -> JSON:  # fmt: skip
    """Axes with what is drawn in them."""
    drawn = {"x": x, "y": y, "layers": [*layers], "handles": [*handles]}
    return {"key": key, "title": title, **drawn, **more}
