"""Checks of arguments and names shared by many public functions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain, count
from numbers import Integral, Real
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError, OptionError, UnsuitableSystemError

Choice = TypeVar("Choice")

MOST = 10**12
"""Upper limit of any number of samples, lags or states."""


def positive(value: Any, name: str, what: str) -> float:
    """Return `value` as a float; it must be a finite number above zero.

    Raises
    ------
    OptionError
        Anything else; `what` describes the number in the message.
    """
    number = real(value, name, what)
    if number <= 0:
        raise OptionError(f"{name}={value!r}; expected a positive {what}")
    return number


def not_negative(value: Any, name: str, what: str) -> float:
    """Return `value` as a float; it must be a finite number, 0 or above."""
    number = real(value, name, what)
    if number < 0:
        raise OptionError(f"{name}={value!r}; expected a value >= 0: {what}")
    return number


def within(value: Any, name: str, what: str, low: float, high: float) -> float:
    """Return `value` as a float; it must be a number in low...high."""
    number = real(value, name, what)
    if not low <= number <= high:
        raise OptionError(f"{name}={value!r}; expected {what} in {low:g}...{high:g}")
    return number


def real(value: Any, name: str, what: str) -> float:
    """Return `value` as a float; it must be a finite real number."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise OptionError(f"{name}={value!r}; expected a finite number: {what}")
    return float(value)


def band(value: Any, name: str, what: str) -> tuple[float, float]:
    """Return the two ends of a band."""
    ends = tuple(value) if isinstance(value, Iterable) else ()
    if len(ends) != 2:
        raise OptionError(
            f"{name}={value!r}; expected two numbers, the lower and the upper end: {what}"
        )
    return real(ends[0], name, what), real(ends[1], name, what)


def rising(value: Any, name: str, what: str) -> tuple[float, float]:
    """Return the two ends of a band, the lower of which must come first."""
    low, high = band(value, name, what)
    if not low < high:
        raise OptionError(f"{name}=({low:g}, {high:g}); expected the lower end first")
    return low, high


def integer(value: Any, name: str, low: int, high: int | None = None) -> int:
    """Return `value` as an int; it must be a whole number in low...high."""
    limits = f">= {low}" if high is None else f"in {low}...{high}"
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise OptionError(f"{name}={value!r}; expected a whole number {limits}")
    number = int(value)
    if abs(number) > MOST:
        raise OptionError(f"{name} is larger than {MOST:.0e}; expected a whole number {limits}")
    if number < low or (high is not None and number > high):
        raise OptionError(f"{name}={number}; expected a whole number {limits}")
    return number


def integers(
    given: int | Iterable[int], name: str, low: int, high: int | None = None
) -> tuple[int, ...]:
    """Return a whole number, or several different ones in rising order, in low...high."""
    several = given if isinstance(given, Iterable) else (given,)
    found = tuple(sorted({integer(one, name, low, high) for one in several}))
    if not found:
        raise OptionError(f"{name} is empty; expected at least one number")
    return found


def numbers(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Convert real numbers to an array; masked values become NaN.

    Raises
    ------
    DataError
        Text, complex values, dates, or rows of different lengths.
    """
    array = _array(values, what)
    if array.dtype.kind in "mM":
        raise DataError(
            f"{what} holds {array.dtype} values; expected seconds, for instance (stamps - "
            "stamps[0]) / np.timedelta64(1, 's')"
        )
    if array.dtype.kind not in "biuf":
        raise DataError(
            f"{what} holds {array.dtype} values; expected real numbers (a ragged list, text "
            "or complex values cannot be used)"
        )
    return np.asarray(array, dtype=np.float64)


def complex_numbers(values: ArrayLike, what: str) -> NDArray[np.complex128]:
    """Convert real or complex numbers to an array; masked values become NaN."""
    array = _array(values, what)
    if array.dtype.kind not in "biufc":
        raise DataError(f"{what} holds {array.dtype} values; expected complex numbers")
    return np.asarray(array, dtype=np.complex128)


def finite(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Convert finite real numbers to an array."""
    array = numbers(values, what)
    check_finite(array, what)
    return array


def check_finite(values: NDArray[Any], what: str, *, allow_nan: bool = False) -> None:
    """Refuse infinities, and NaN unless it marks a missing sample; the last axis is time."""
    bad = np.isinf(values) if allow_nan else ~np.isfinite(values)
    if bad.any():
        count = int(bad.sum())
        missing = not allow_nan and np.isnan(values).any() and what in ("input", "output")
        hint = "; missing='keep' takes NaN as missing samples" if missing else ""
        raise DataError(
            f"{what} has {count} non-finite value{'s' if count > 1 else ''}, "
            f"the first at index {first_index(bad)}{hint}"
        )


def first_index(marked: NDArray[np.bool_]) -> int:
    """Return the first sample (last axis) that is marked in any channel."""
    along = np.atleast_1d(marked)
    return int(np.flatnonzero(along.reshape(-1, along.shape[-1]).any(axis=0))[0])


def _array(values: Any, what: str) -> NDArray[Any]:
    try:
        return np.asarray(_unmasked(values))
    except ValueError as error:
        raise DataError(f"{what} is not an array: its rows have different lengths") from error


def _unmasked(given: Any) -> Any:
    """Replace masked values by NaN, also in lists; the data under a mask are arbitrary."""
    if isinstance(given, np.ma.MaskedArray):
        mask = np.ma.getmaskarray(given)
        if given.dtype.kind not in "biufc" or not mask.any():
            return given.data
        return np.where(mask, np.nan, given.data)
    if isinstance(given, list | tuple) and any(
        isinstance(part, list | tuple | np.ma.MaskedArray) for part in given
    ):
        return [_unmasked(part) for part in given]
    return given


def one_of(value: Choice, name: str, choices: tuple[str, ...]) -> Choice:
    """Return the choice that `value` names, ignoring case."""
    # an array would be compared element by element
    if isinstance(value, str):
        for choice in choices:
            if value.casefold() == choice.casefold():
                return cast(Choice, choice)
        value = cast(Choice, str(value))  # without the type of NumPy's text in the message
    raise OptionError(f"{name}={value!r}; choose one of {', '.join(map(repr, choices))}")


def each_of(values: Any, name: str, choices: tuple[str, ...]) -> list[str]:
    """Return the choices that one name, or each of several, names, ignoring case."""
    several = isinstance(values, Iterable) and not isinstance(values, str)
    return [one_of(value, name, choices) for value in (values if several else [values])]


def check_type(
    value: object, kind: Any, name: str, expected: str, error: type[Exception] = DataError
) -> None:
    """Refuse a value that is not of a type, or of one of several."""
    if not isinstance(value, kind):
        raise error(f"{name} is a {type(value).__name__}; expected {expected}")


def sample_time_of(system: Any) -> float | None:
    """Sample time of a system in s, 0 if it is continuous; None for a gain of any time base.

    Raises
    ------
    UnsuitableSystemError
        ``dt=True``: discrete, without a sample time.
    """
    if system.dt is True:
        raise UnsuitableSystemError(
            f"{system.name!r} is discrete without a sample time (dt=True); set its dt in s"
        )
    return None if system.dt is None else float(system.dt)


def spelled_out(text: str) -> str:
    """Escape lone surrogates, as in file names that are not UTF-8, so that the text is writable."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def system_name(name: str) -> str:
    """Replace dots, which python-control reserves for ``system.signal``."""
    check_type(name, str, "name", "text", OptionError)
    return name.replace(".", "_")


def system_names(names: Sequence[str]) -> list[str]:
    """Make valid signal names for python-control; different names stay different.

    Examples
    --------
    >>> from ctrl_realize._checks import system_names
    >>> system_names(["FIC101.OP", "FIC101_OP", "TIC7.PV"])
    ['FIC101_OP_2', 'FIC101_OP', 'TIC7_PV']
    """
    made: list[str] = []
    wishes = [system_name(name) for name in names]
    taken = {name for name in names if "." not in name}
    for name, wish in zip(names, wishes, strict=True):
        tries = chain([wish], (f"{wish}_{number}" for number in count(2)))
        made.append(name if name == wish else next(one for one in tries if one not in taken))
        taken.add(made[-1])
    return made
