"""What stays of a fit in a model file."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from ..errors import FileFormatError
from ..results import Flag, Result
from .json_content import MAX_TEXT, field

_KEPT = (
    "delay", "order", "dead_time", "dead_time_interval", "std_given_structure", "interval",
    "delay_interval", "total_delay", "total_delay_interval", "gain", "gain_interval",
    "gain_std_given_structure", "onset", "method",
)  # fmt: skip
_MAX_ROWS = 200

Plain = float | int | str | bool | None | tuple["Plain", ...]


@dataclass(frozen=True, eq=False, repr=False)
class FitSummary(Result):
    """Report of a fit, without its curves, as a model file keeps it.

    ``summary[key]`` is what ``fit.key`` was, for the main numbers of a fit (`delay`, `order`,
    `dead_time`, `interval`, ...) that are there; the dead time and its interval are
    attributes as well. ``report()`` is the text that the fit had.

    Attributes
    ----------
    kind : str
        Class of the fit: ``"DelayScan"``.
    title : str
    rows : tuple of (label, value)
    values : tuple of (key, value)
    flags : tuple of Flag

    Examples
    --------
    >>> from ctrl_realize.io import FitSummary
    >>> rows = (("delay", "37 samples"),)
    >>> summary = FitSummary("DelayScan", "Delay scan", rows, values=(("delay", 37),))
    >>> summary["delay"]
    37
    >>> print(summary.report())
    Delay scan
      delay  37 samples
    """

    kind: str
    title: str
    rows: tuple[tuple[str, str], ...]
    values: tuple[tuple[str, Plain], ...]
    flags: tuple[Flag, ...] = ()

    def __getitem__(self, key: str) -> Plain:
        return dict(self.values)[key]

    @property
    def dead_time(self) -> float | None:
        """Dead time in s, as the fit had it; None if it had none."""
        value = dict(self.values).get("dead_time")
        return float(value) if _is_time(value) else None

    @property
    def dead_time_interval(self) -> tuple[float, float] | None:
        """Interval of the dead time in s, for the functions of `design`; None if it is open."""
        match dict(self.values).get("dead_time_interval"):
            case (low, high) if _is_time(low) and _is_time(high) and low <= high:
                return float(low), float(high)
        return None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Interval as the fit had it, in s; None if it had none."""
        match dict(self.values).get("interval"):
            case (low, high) if _is_end(low) and _is_end(high) and float(low) <= float(high):
                return float(low), float(high)
        return None

    def __repr__(self) -> str:
        return f"<FitSummary of a {self.kind}>"

    def _title(self) -> str:
        return self.title

    def _rows(self) -> list[tuple[str, str]]:
        return list(self.rows)


def _is_time(value: Plain) -> TypeGuard[float]:
    """Tell a time from whatever else a file may hold in its place."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return 0 <= value <= sys.float_info.max  # a whole number in a file may be larger than that


def _is_end(value: Plain) -> TypeGuard[float | str]:
    """Tell the end of an interval; one that is open stands in a file as text."""
    return value in ("inf", "-inf") or _is_time(value)


def summary_of(fit: Any) -> FitSummary | None:
    """Reduce any fit to plain numbers and text."""
    if fit is None or isinstance(fit, FitSummary):
        return fit
    values = {key: _plain(getattr(fit, key, None)) for key in _KEPT}
    is_result = isinstance(fit, Result)
    return FitSummary(
        kind=type(fit).__name__,
        title=fit._title() if is_result else type(fit).__name__,
        rows=tuple((str(label), str(value)) for label, value in fit._rows()) if is_result else (),
        values=tuple((key, value) for key, value in values.items() if value is not None),
        flags=tuple(fit.flags) if is_result else (),
    )


def summary_to_json(summary: FitSummary | None) -> dict[str, Any] | None:
    """Lay out a summary for JSON."""
    if summary is None:
        return None
    return {
        "kind": summary.kind,
        "title": summary.title,
        "rows": [list(row) for row in summary.rows],
        "values": dict(summary.values),
        "flags": [[flag.code, flag.message] for flag in summary.flags],
    }


def summary_from_json(content: Any) -> FitSummary | None:
    """Build a summary from parsed JSON that may hold anything.

    Raises
    ------
    FileFormatError
    """
    if content is None:
        return None
    if not isinstance(content, Mapping):
        raise FileFormatError("'fit' is not of its kind")
    values = field(content, "values", dict)
    return FitSummary(
        kind=field(content, "kind", str),
        title=field(content, "title", str),
        rows=_pairs(content, "rows"),
        values=tuple((str(key), _tupled(value)) for key, value in values.items()),
        flags=tuple(Flag(code, message) for code, message in _pairs(content, "flags")),
    )


def _pairs(content: Mapping[str, Any], key: str) -> tuple[tuple[str, str], ...]:
    rows = field(content, key, list)
    good = len(rows) <= _MAX_ROWS and all(
        isinstance(row, list) and len(row) == 2 and all(isinstance(text, str) for text in row)
        for row in rows
    )
    if not good or any(len(text) > 10 * MAX_TEXT for row in rows for text in row):
        raise FileFormatError(f"{key!r} must hold pairs of texts, at most {_MAX_ROWS}")
    return tuple((row[0], row[1]) for row in rows)


def _plain(value: Any) -> Plain:
    """Numbers and text as Python's own; None for what is neither."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray) and value.size <= 100:
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(_plain(entry) for entry in value)
    if isinstance(value, float):
        # JSON has no infinity; an open interval is kept as text
        return value if math.isfinite(value) else str(value)
    return value if isinstance(value, int | str | bool) else None


def _tupled(value: Any) -> Plain:
    if isinstance(value, list):
        return tuple(_tupled(entry) for entry in value)
    if isinstance(value, dict):
        raise FileFormatError("'values' of 'fit' holds more than numbers and text")
    plain: Plain = value
    return plain
