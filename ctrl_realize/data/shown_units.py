"""Unit of time in which texts and plots about records and models are written."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from .._parameters import SECONDS
from .._wording import shown_unit, times_in
from .record import Record

P = ParamSpec("P")
T = TypeVar("T")


def shown_time_unit(given: Any) -> str:
    """Unit of time of a record, of the records of a result or model, or of the first of several.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.data.shown_units import shown_time_unit
    >>> record = cr.Record([0, 60, 120], [0, 1, 1], [0, 0, 1], units={"time": "min"})
    >>> shown_time_unit(record), shown_time_unit([record]), shown_time_unit(None)
    ('min', 'min', 's')
    """
    if isinstance(given, Record):
        return shown_unit(given.units.get("time", "s"))
    if isinstance(given, list | tuple):
        return shown_time_unit(given[0]) if given else "s"
    own = getattr(given, "time_unit", None)
    if isinstance(own, str):
        return own if own in SECONDS else "s"
    for name in ("fit", "record", "records"):
        held = getattr(given, name, None)
        if held is not None and not callable(held):
            return shown_time_unit(held)
    return "s"


def unit_among(*given: Any) -> str:
    """Unit of time of the first that has another one than the second.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.data.shown_units import unit_among
    >>> record = cr.Record([0, 60, 120], [0, 1, 1], [0, 0, 1], units={"time": "min"})
    >>> unit_among(0.5, record), unit_among()
    ('min', 's')
    """
    return next((unit for unit in map(shown_time_unit, given) if unit != "s"), "s")


def in_shown_units(function: Callable[P, T]) -> Callable[P, T]:
    """Write times in the unit of the first argument that has one while a function runs."""

    @functools.wraps(function)
    def writing(*args: P.args, **kwargs: P.kwargs) -> T:
        with times_in(unit_among(*args, *kwargs.values())):
            return function(*args, **kwargs)

    return writing
