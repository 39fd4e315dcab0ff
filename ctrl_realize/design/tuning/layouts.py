"""How controllers and PLC blocks write PID parameters: structure, units, filter, scaling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..._facts import facts


@dataclass(frozen=True)
class Layout:
    """The parameters that one kind of controller asks for.

    Attributes
    ----------
    title : str
    structure : {"ideal", "series", "parallel"}
    gain, integral, derivative : str
        Labels of the parameters.
    band : bool
        The gain is a proportional band in percent, 100 / gain.
    rate : bool
        The integral is in repeats per unit of time, the inverse of the integral time.
    unit : str or None
        Unit of time, ``"s"`` or ``"min"``; None where the user chooses.
    filter_label : str or None
        Label of the derivative filter; None if it cannot be set.
    filter_kind : {"time", "ratio", "fixed", "none"}
        A time constant; its ratio to the derivative time; `filter_ratio`; no filter.
    filter_ratio : float
        If it is fixed.
    added : bool
        In series form, the derivative factor is ``1 + td s / (tf s + 1)`` and not
        ``(td s + 1) / (tf s + 1)``.
    percent : {"none", "output", "both"}
        Which signals the gain refers to in percent of their range.
    signed : bool
        A negative gain can be entered; otherwise the action is reversed.
    derivative_allowed : bool
        False where no description of the derivative was available.
    weights : tuple of str
        Labels of the set-point weights of the proportional and derivative action, if there are any.
    source : str
        Where this is documented.
    """

    title: str
    structure: Literal["ideal", "series", "parallel"]
    gain: str
    integral: str
    derivative: str
    unit: str | None
    source: str
    band: bool = False
    rate: bool = False
    filter_label: str | None = None
    filter_kind: Literal["time", "ratio", "fixed", "none"] = "none"
    filter_ratio: float = 0.0
    added: bool = False
    percent: Literal["none", "output", "both"] = "none"
    signed: bool = False
    derivative_allowed: bool = True
    weights: tuple[str, ...] = ()


LAYOUTS = {
    name: Layout(**{"unit": None, **row})
    for name, row in facts("design/tuning/layouts.toml").items()
}
"""Name -> parameters of a form. Forms of which no description was found are left out."""
