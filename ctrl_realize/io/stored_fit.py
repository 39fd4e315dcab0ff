"""Summary of a fit in a model file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from typing import Any

import numpy as np

from .._parameters import Parameter
from .._wording import times_in
from ..actuators.plain import Plain, to_plain
from ..errors import FileFormatError
from ..identification.output_error.actuated.result import ActuatorFit
from ..identification.plausible import PlausibleModels
from ..identification.verdicts import Verdict
from ..numerics.engine.plausible_models import PlausibleModel
from ..results import INTERVAL_LABELS, Flag, IntervalKind, ModelFit
from .json_content import field, of_kind

Ends = tuple[float, float]
Numbers = tuple[float, ...]
_KEPT: dict[str, Any] = {
    "delay": float, "order": int, "dead_time": float, "dead_time_interval": Ends, "interval": Ends,
    "delay_interval": Ends, "total_delay": float, "total_delay_interval": Ends, "gain": float,
    "gain_interval": Ends, "gain_std_given_structure": float, "onset": float,
    "interval_kind": IntervalKind, "residual_std": float, "sampling": str, "integrators": int,
    "input_unit": str, "output_unit": str, "parameters": tuple[Parameter, ...],
    "actuator": ActuatorFit, "verdicts": tuple[Verdict, ...],
    "plausible_models": tuple[float, tuple[tuple[float, Numbers, Numbers, Numbers], ...]],
}  # fmt: skip
"""Attributes of a `ModelFit` that are stored -> their kinds; also the keys in the file."""
_ABSENT = {"integrators": 0, "input_unit": "", "output_unit": "", "parameters": (), "verdicts": ()}
_TIMES = ("delay", "dead_time", "dead_time_interval", "residual_std")
_OPEN_TIMES = ("interval", "delay_interval")
"""Never negative, and intervals of them that may have no upper end."""


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
        return str(self._value("time_unit") or "s")

    @property
    def interval_label(self) -> str:
        """Kind of `interval`, in words."""
        older = self.interval_kind is None and self.kind == "DelayScan"
        return INTERVAL_LABELS["flatness"] if older else super().interval_label

    def _value(self, key: str) -> Plain:
        return dict(self.values).get(key)

    @property
    def _method(self) -> str:
        return str(self._value("method") or "model with dead time")

    def __repr__(self) -> str:
        return f"<FitSummary of {self.kind}>"

    def _title(self) -> str:
        return self.title

    def _of_clock(self) -> list[str]:
        return list(self._value("clock") or ())  # type: ignore[arg-type]

    def _rows(self) -> list[tuple[str, str]]:
        return list(self.rows)


def _read(summary: FitSummary, key: str) -> Any:
    """Value of an attribute; what a file has in its place gives the value of a fit without it."""
    absent, value = _ABSENT.get(key), summary._value(key)
    if value is None:
        return absent
    try:
        found = of_kind(value, _KEPT[key])
        if key == "plausible_models":
            return _drawn(summary.time_unit, *found)
    except (TypeError, ValueError) as error:
        if key == "actuator":  # without it the model would be simulated as another one
            raise FileFormatError(f"'actuator' of 'fit': {error}; save the model again") from error
        return absent
    if key in (*_TIMES, *_OPEN_TIMES):
        first, last = np.ravel(found)[[0, -1]]
        if not 0 <= first <= last or (key in _TIMES and last == math.inf):
            return absent
    return found


def _drawn(time_unit: str, dt: float, models: tuple[tuple[Any, ...], ...]) -> Any:
    """Models of dead time, poles (real and imaginary parts) and numerator."""
    every = [
        PlausibleModel(dead_time, np.array(real) + 1j * np.array(imag), np.array(numerator))
        for dead_time, real, imag, numerator in models
    ]
    return PlausibleModels(tuple(every), dt, time_unit)


def _stored(key: str) -> property:
    # numpydoc wants the line of a def
    def stored(summary: FitSummary) -> Any:
        return _read(summary, key)

    return property(stored, doc=f"`ModelFit.{key}`, as the file has it.")


for _key in _KEPT:
    setattr(FitSummary, _key, _stored(_key))


def summary_of(fit: ModelFit | None) -> FitSummary | None:
    """Reduce any fit to plain numbers and text."""
    if fit is None or isinstance(fit, FitSummary):
        return fit
    apart = ("actuator", "plausible_models")
    values = {key: _plain(getattr(fit, key)) for key in _KEPT if key not in apart}
    for key in ("std_given_structure", "fit_percent"):  # of some fits
        values[key] = _plain(getattr(fit, key, None))
    values["time_unit"], values["method"] = fit._record_unit, fit._method
    values["clock"] = tuple(fit._of_clock())
    if fit.parameters:
        values["formula"] = fit.formula
    if (own := fit.actuator) is not None:  # its fields in order, without what records do not tell
        told = (to_plain(own.model), own.actuator_at, own.parameters, own.starts, own.evidence)
        values["actuator"] = _plain(told)
    if (drawn := fit.plausible_models) is not None:
        every = [
            (one.dead_time, one.poles.real, one.poles.imag, one.numerator) for one in drawn.models
        ]
        values["plausible_models"] = _plain((drawn.dt, every))
    with times_in(fit.time_unit):
        rows = tuple((str(label), str(value)) for label, value in fit._rows())
        title = fit._title()
    known = tuple(pair for pair in values.items() if pair[1] not in (None, ()))
    return FitSummary(type(fit).__name__, title, rows, known, fit.flags, fit.choices)


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
        rows=_texts(content, "rows", tuple[tuple[str, str], ...]),
        values=tuple((str(key), _tupled(value)) for key, value in values.items()),
        flags=_texts(content, "flags", tuple[Flag, ...]),
        choices=_texts(content, "choices", tuple[str, ...]) if "choices" in content else (),
    )
    _ = summary.actuator  # refused here, if at all, and not where it is used
    return summary


def _texts(content: Mapping[str, Any], key: str, kind: Any) -> Any:
    try:
        return of_kind(content.get(key), kind)
    except (TypeError, ValueError) as error:
        raise FileFormatError(f"{key!r}: {error}") from error


def _plain(value: Any) -> Plain:
    """Numbers and text as Python's own, fields of a dataclass in order; None for anything else."""
    if is_dataclass(value):
        value = tuple(vars(value).values())
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
