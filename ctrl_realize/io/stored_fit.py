"""Summary of a fit in a model file."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from .._parameters import Parameter
from .._wording import times_in
from ..actuators.plain import Plain, from_plain, to_plain
from ..errors import FileFormatError
from ..identification.output_error.actuated.result import ActuatorFit
from ..results import INTERVAL_LABELS, Flag, IntervalKind, ModelFit
from .json_content import MAX_TEXT, field

_MAX_ROWS = 200


def _text(value: Plain) -> str | None:
    return value if isinstance(value, str) else None


def _number(value: Plain) -> float | None:
    """Accept a number of either sign; one that is not finite is stored as text."""
    if isinstance(value, str):
        return float(value) if value in ("inf", "-inf", "nan") else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    # a whole number in a file may exceed the range of doubles
    return float(value) if abs(value) <= sys.float_info.max else None


def _count(value: Plain) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _time(value: Plain) -> float | None:
    """Accept a time; anything else in its place gives None."""
    time = _number(value)
    return time if time is not None and 0 <= time < math.inf else None


def _pair(value: Plain) -> tuple[float, float] | None:
    match value:
        case (first, last):
            low, high = _number(first), _number(last)
            return None if low is None or high is None else (low, high)
    return None


def _times(value: Plain) -> tuple[float, float] | None:
    """Accept an interval of times, which may be infinite."""
    ends = _pair(value)
    if ends is None or any(-math.inf < end < 0 for end in ends) or not ends[0] <= ends[1]:
        return None
    return ends


def _parameter(row: Plain) -> Parameter | None:
    """Accept the fields of a parameter in their order."""
    match row:
        case (str(name), *numbers, bool(all_structures), str(unit), int(times)) if len(
            numbers
        ) == 4 and times in (-1, 0, 1):
            value, *others = (_number(number) for number in numbers)
            std, low, high = (np.nan if number is None else number for number in others)
            if value is not None:
                return Parameter(name, value, std, low, high, all_structures, unit, times)
    return None


def _closed(value: Plain) -> tuple[float, float] | None:
    ends = _times(value)
    return ends if ends is not None and np.isfinite(ends).all() else None


@dataclass(frozen=True, eq=False, repr=False)
class FitSummary(ModelFit):
    """Report of a fit without its curves, as stored in a model file.

    ``summary[key]`` is the stored ``fit.key``, for the main numbers of a fit (`delay`, `order`,
    `dead_time`, `interval`, ...); the common attributes of all fits are attributes as well, except
    the records. ``report()`` is the text of the original fit.

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
    def _record_unit(self) -> str:
        return _text(self._value("time_unit")) or "s"

    @property
    def interval_label(self) -> str:
        """Kind of `interval`, in words."""
        if self.interval_kind is None and self.kind == "DelayScan":  # of an older file
            return INTERVAL_LABELS["flatness"]
        return super().interval_label

    def _value(self, key: str) -> Plain:
        return dict(self.values).get(key)

    @property
    def _method(self) -> str:
        return _text(self._value("method")) or "model with dead time"

    def __repr__(self) -> str:
        return f"<FitSummary of a {self.kind}>"

    def _title(self) -> str:
        return self.title

    def _rows(self) -> list[tuple[str, str]]:
        return list(self.rows)


def _interval_kind(value: Plain) -> IntervalKind | None:
    return next((kind for kind in get_args(IntervalKind) if kind == value), None)


def _parameters(value: Plain) -> tuple[Parameter, ...]:
    read = [_parameter(row) for row in value] if isinstance(value, tuple) else []
    return tuple(parameter for parameter in read if parameter is not None)


_KEPT: dict[str, Callable[[Plain], object]] = {
    "delay": _time, "order": _count, "dead_time": _time, "dead_time_interval": _closed,
    "interval": _times, "delay_interval": _times, "total_delay": _number,
    "total_delay_interval": _pair, "gain": _number, "gain_interval": _pair,
    "gain_std_given_structure": _number, "onset": _number, "interval_kind": _interval_kind,
    "residual_std": _time, "sampling": _text, "integrators": lambda value: _count(value) or 0,
    "input_unit": lambda value: _text(value) or "", "output_unit": lambda value: _text(value) or "",
    "parameters": _parameters,
    "actuator": lambda value: None if value is None else _actuator(value),
}  # fmt: skip
"""Attributes of a `ModelFit` that are stored -> what accepts the value in a file."""


def _stored(key: str, read: Callable[[Plain], object]) -> property:
    # numpydoc wants the line of a def
    def stored(summary: FitSummary) -> Any:
        return read(summary._value(key))

    return property(stored, doc=f"`ModelFit.{key}`, as the file has it.")


for _key, _read in _KEPT.items():
    setattr(FitSummary, _key, _stored(_key, _read))


def summary_of(fit: ModelFit | None) -> FitSummary | None:
    """Reduce any fit to plain numbers and text."""
    if fit is None or isinstance(fit, FitSummary):
        return fit
    # all are attributes of a ModelFit; the list is also that of the keys in the file
    values = {
        key: _plain(getattr(fit, key)) for key in _KEPT if key not in ("parameters", "actuator")
    }
    for key in ("std_given_structure", "fit_percent"):  # of some fits
        values[key] = _plain(getattr(fit, key, None))
    values["time_unit"], values["method"] = fit._record_unit, fit._method
    if fit.parameters:
        values["formula"] = fit.formula
        values["parameters"] = _parameter_rows(fit.parameters)
    if fit.actuator is not None:
        values["actuator"] = _actuator_row(fit.actuator)
    with times_in(fit.time_unit):
        rows = tuple((str(label), str(value)) for label, value in fit._rows())
        title = fit._title()
    return FitSummary(
        kind=type(fit).__name__,
        title=title,
        rows=rows,
        values=tuple(pair for pair in values.items() if pair[1] is not None),
        flags=fit.flags,
        choices=fit.choices,
    )


def _parameter_rows(parameters: Iterable[Parameter]) -> Plain:
    return _plain([tuple(vars(one).values()) for one in parameters])


def _actuator_row(fit: ActuatorFit) -> Plain:
    """Return the fields of an actuator in their order, without what the records cannot tell."""
    model, rows = to_plain(fit.model), _parameter_rows(fit.parameters)
    return _plain((model, fit.actuator_at, rows, fit.starts, fit.evidence))


def _actuator(row: Plain) -> ActuatorFit:
    """Accept the fields of an actuator; a model without it would be simulated as another one."""
    match row:
        case (model, ("input" | "stem") as place, tuple() as rows, tuple() as begun, evidence):
            parameters = [one for one in map(_parameter, rows) if one is not None]
            starts = [one for one in map(_number, begun) if one is not None]
            try:
                found = from_plain(model)
            except (TypeError, ValueError) as error:
                raise FileFormatError(f"'actuator' of 'fit': {error}") from error
            for_it = _number(evidence)
            return ActuatorFit(
                found, place, tuple(parameters), tuple(starts), np.nan if for_it is None else for_it
            )
    raise FileFormatError("'actuator' of 'fit' is not as it was written; save the model again")


def summary_to_json(summary: FitSummary | None) -> dict[str, Any] | None:
    """Convert a summary for JSON."""
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
    """Make a summary from parsed JSON with unknown content.

    Raises
    ------
    FileFormatError
    """
    if content is None:
        return None
    if not isinstance(content, Mapping):
        raise FileFormatError("'fit' has the wrong type")
    values = field(content, "values", dict)
    summary = FitSummary(
        kind=field(content, "kind", str),
        title=field(content, "title", str),
        rows=_pairs(content, "rows"),
        values=tuple((str(key), _tupled(value)) for key, value in values.items()),
        flags=tuple(Flag(code, message) for code, message in _pairs(content, "flags")),
        choices=_texts(content, "choices"),
    )
    _ = summary.actuator  # refused here, if at all, and not where it is used
    return summary


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
    """Texts that are missing in an older file."""
    rows = field(content, key, list) if key in content else []
    if len(rows) > _MAX_ROWS or any(not isinstance(text, str) for text in rows):
        raise FileFormatError(f"{key!r} must hold texts, at most {_MAX_ROWS}")
    return tuple(rows)


def _plain(value: Any) -> Plain:
    """Numbers and text as Python's own; None for anything else."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray) and value.size <= 100:
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(_plain(entry) for entry in value)
    if isinstance(value, float):
        # JSON has no infinity; an infinite interval is stored as text
        return value if math.isfinite(value) else str(value)
    return value if isinstance(value, int | str | bool) else None


def _tupled(value: Any) -> Plain:
    if isinstance(value, list):
        return tuple(_tupled(entry) for entry in value)
    if isinstance(value, dict):
        raise FileFormatError("'values' of 'fit' contains more than numbers and text")
    plain: Plain = value
    return plain
