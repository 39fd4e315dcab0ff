"""Checks of arguments, and rules for names, that many public functions share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import Any

from .errors import OptionError

MOST = 10**12
"""No count of samples, lags or states is larger."""


def positive(value: Any, name: str, what: str) -> float:
    """Return `value` as a float when it is a finite number above zero.

    Raises
    ------
    OptionError
        Anything else; `what` says in the message what the number is.
    """
    number = real(value, name, what)
    if number <= 0:
        raise OptionError(f"{name}={value!r}; needed is a positive {what}")
    return number


def real(value: Any, name: str, what: str) -> float:
    """Return `value` as a float when it is a finite real number."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise OptionError(f"{name}={value!r}; needed is a finite number: {what}")
    return float(value)


def band(value: Any, name: str, what: str) -> tuple[float, float]:
    """Return the two ends of a band."""
    ends = tuple(value) if isinstance(value, Iterable) else ()
    if len(ends) != 2:
        raise OptionError(f"{name}={value!r}; needed are two numbers, the ends: {what}")
    return real(ends[0], name, what), real(ends[1], name, what)


def whole(value: Any, name: str, low: int, high: int | None = None) -> int:
    """Return `value` as an int when it is a whole number in low...high."""
    limits = f">= {low}" if high is None else f"in {low}...{high}"
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise OptionError(f"{name}={value!r}; needed is a whole number {limits}")
    number = int(value)
    if abs(number) > MOST:
        raise OptionError(f"{name} is beyond {MOST:.0e}; needed is a whole number {limits}")
    if number < low or (high is not None and number > high):
        raise OptionError(f"{name}={number}; needed is a whole number {limits}")
    return number


def one_of(value: Any, name: str, choices: tuple[str, ...]) -> str:
    """Return `value` when it is one of the choices."""
    # an array would compare one by one
    if not isinstance(value, str) or value not in choices:
        raise OptionError(f"{name}={value!r}; choose one of {', '.join(map(repr, choices))}")
    return str(value)


def spelled_out(text: str) -> str:
    """Make a text that can be written: file names that are no UTF-8 hold lone surrogates."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def system_name(name: str) -> str:
    """Make a name that python-control takes: a dot stands between system and signal there."""
    return name.replace(".", "_")


def system_names(names: Sequence[str]) -> list[str]:
    """Make names of signals that python-control takes, different ones where the given ones are.

    Examples
    --------
    >>> from ctrl_realize.checks import system_names
    >>> system_names(["FIC101.OP", "FIC101_OP", "TIC7.PV"])
    ['FIC101_OP_2', 'FIC101_OP', 'TIC7_PV']
    """
    made = [system_name(name) for name in names]
    taken = {name for name in names if "." not in name}
    for position, (name, wish) in enumerate(zip(names, made, strict=True)):
        if name == wish:
            continue
        number = 2
        while made[position] in taken:
            made[position] = f"{wish}_{number}"
            number += 1
        taken.add(made[position])
    return made
