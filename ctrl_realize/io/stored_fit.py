"""What stays of a fit in a model file."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeGuard, get_args

import numpy as np

from ..errors import FileFormatError
from ..results import INTERVAL_LABELS, Flag, IntervalKind, ModelFit
from .json_content import MAX_TEXT, field

_METHODS = {
    "OutputErrorFit": "output-error fit of the raw record",
    "StateSpaceFit": "state-space fit of all channels",
    "DelayScan": "delay scan by approximate realization",
    "Realization": "approximate realization",
}
"""The methods behind stored fits, in words."""
_MAX_ROWS = 200

Plain = float | int | str | bool | None | tuple["Plain", ...]


@dataclass(frozen=True, eq=False, repr=False)
class FitSummary(ModelFit):
    """Report of a fit, without its curves, as a model file keeps it.

    ``summary[key]`` is what ``fit.key`` was, for the main numbers of a fit (`delay`, `order`,
    `dead_time`, `interval`, ...) that are there; what all fits have in common is there as
    attributes as well, but for the records. ``report()`` is the text that the fit had.

    Attributes
    ----------
    kind : str
        Class of the fit: ``"DelayScan"``.
    title : str
    rows : tuple of (label, value)
    values : tuple of (key, value)
    flags : tuple of Flag
    choices : tuple of str

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
    values: tuple[tuple[str, Plain], ...] = ()
    flags: tuple[Flag, ...] = ()
    choices: tuple[str, ...] = ()
    records = ()

    def __getitem__(self, key: str) -> Plain:
        return dict(self.values)[key]

    @property
    def dead_time(self) -> float | None:
        """Dead time in s, as the fit had it; None if it had none."""
        return self._time("dead_time")

    @property
    def dead_time_interval(self) -> tuple[float, float] | None:
        """Interval of the dead time in s, for the functions of `design`; None if it is open."""
        match self._value("dead_time_interval"):
            case (low, high) if _is_time(low) and _is_time(high) and low <= high:
                return float(low), float(high)
        return None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Interval as the fit had it, in s; None if it had none."""
        return self._times("interval")

    @property
    def interval_kind(self) -> IntervalKind | None:
        """What `interval` is; None where the file does not tell."""
        value = self._value("interval_kind")
        return next((kind for kind in get_args(IntervalKind) if kind == value), None)

    @property
    def interval_label(self) -> str:
        """What `interval` is, in words."""
        if self.interval_kind is None and self.kind == "DelayScan":  # of an older file
            return INTERVAL_LABELS["flatness"]
        return super().interval_label

    @property
    def delay(self) -> float | None:
        """Dead time in samples."""
        return self._time("delay")

    @property
    def delay_interval(self) -> tuple[float, float] | None:
        """Interval of the dead time in samples."""
        return self._times("delay_interval")

    @property
    def total_delay(self) -> float | None:
        """Delay at zero frequency in s."""
        return self._number("total_delay")

    @property
    def total_delay_interval(self) -> tuple[float, float] | None:
        """95 % interval of the total delay in s."""
        return self._pair("total_delay_interval")

    @property
    def onset(self) -> float | None:
        """First motion after a step of the input, in s; NaN where it was no step."""
        return self._number("onset")

    @property
    def order(self) -> int | None:
        """States of the core."""
        value = self._value("order")
        return value if isinstance(value, int) and not isinstance(value, bool) else None

    @property
    def gain(self) -> float | None:
        """Gain at zero frequency."""
        return self._number("gain")

    @property
    def gain_interval(self) -> tuple[float, float] | None:
        """95 % interval of the gain."""
        return self._pair("gain_interval")

    @property
    def gain_std_given_structure(self) -> float | None:
        """Standard error of the gain if the chosen structure is the plant's."""
        return self._number("gain_std_given_structure")

    @property
    def residual_std(self) -> float | None:
        """Standard deviation of what the model leaves of its one output."""
        return self._time("residual_std")

    @property
    def sampling(self) -> str | None:
        """How the impulse response was sampled that the model was realized from."""
        value = self._value("sampling")
        return value if isinstance(value, str) else None

    def _std(self) -> float | None:
        return self._time("std_given_structure")

    def _value(self, key: str) -> Plain:
        return dict(self.values).get(key)

    def _time(self, key: str) -> float | None:
        value = self._value(key)
        return float(value) if _is_time(value) else None

    def _times(self, key: str) -> tuple[float, float] | None:
        match self._value(key):
            case (low, high) if _is_end(low) and _is_end(high) and float(low) <= float(high):
                return float(low), float(high)
        return None

    def _number(self, key: str) -> float | None:
        return _as_number(self._value(key))

    def _pair(self, key: str) -> tuple[float, float] | None:
        match self._value(key):
            case (first, last):
                low, high = _as_number(first), _as_number(last)
                return None if low is None or high is None else (low, high)
        return None

    def _method(self) -> str:
        return _METHODS.get(self.kind, super()._method())

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


def _as_number(value: Plain) -> float | None:
    """Take a number of either sign, which stands in a file as text where it is not finite."""
    if isinstance(value, str):
        return float(value) if value in ("inf", "-inf", "nan") else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) <= sys.float_info.max else None


def _is_end(value: Plain) -> TypeGuard[float | str]:
    """Tell the end of an interval; one that is open stands in a file as text."""
    return value in ("inf", "-inf") or _is_time(value)


def summary_of(fit: ModelFit | None) -> FitSummary | None:
    """Reduce any fit to plain numbers and text."""
    if fit is None or isinstance(fit, FitSummary):
        return fit
    values: dict[str, Plain] = {
        "delay": _plain(fit.delay),
        "order": fit.order,
        "dead_time": fit.dead_time,
        "dead_time_interval": fit.dead_time_interval,
        "std_given_structure": fit._std(),
        "interval": fit.interval,
        "delay_interval": fit.delay_interval,
        "total_delay": fit.total_delay,
        "total_delay_interval": fit.total_delay_interval,
        "gain": fit.gain,
        "gain_interval": fit.gain_interval,
        "gain_std_given_structure": fit.gain_std_given_structure,
        "onset": fit.onset,
        "interval_kind": fit.interval_kind,
        "residual_std": fit.residual_std,
        "sampling": fit.sampling,
    }
    return FitSummary(
        kind=type(fit).__name__,
        title=fit._title(),
        rows=tuple((str(label), str(value)) for label, value in fit._rows()),
        values=tuple((key, _plain(value)) for key, value in values.items() if value is not None),
        flags=fit.flags,
        choices=fit.choices,
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
        **({"choices": list(summary.choices)} if summary.choices else {}),
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
        raise FileFormatError("'fit' has the wrong type")
    values = field(content, "values", dict)
    return FitSummary(
        kind=field(content, "kind", str),
        title=field(content, "title", str),
        rows=_pairs(content, "rows"),
        values=tuple((str(key), _tupled(value)) for key, value in values.items()),
        flags=tuple(Flag(code, message) for code, message in _pairs(content, "flags")),
        choices=_texts(content, "choices"),
    )


def _pairs(content: Mapping[str, Any], key: str) -> tuple[tuple[str, str], ...]:
    rows = field(content, key, list)
    good = len(rows) <= _MAX_ROWS and all(
        isinstance(row, list) and len(row) == 2 and all(isinstance(text, str) for text in row)
        for row in rows
    )
    if not good or any(len(text) > 10 * MAX_TEXT for row in rows for text in row):
        raise FileFormatError(f"{key!r} must contain pairs of texts, at most {_MAX_ROWS}")
    return tuple((row[0], row[1]) for row in rows)


def _texts(content: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Texts that an older file does not have."""
    rows = field(content, key, list) if key in content else []
    if len(rows) > _MAX_ROWS or any(not isinstance(text, str) for text in rows):
        raise FileFormatError(f"{key!r} must hold texts, at most {_MAX_ROWS}")
    return tuple(rows)


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
        raise FileFormatError("'values' of 'fit' contains more than numbers and text")
    plain: Plain = value
    return plain
