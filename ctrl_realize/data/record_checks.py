"""Checks of measured data: text, wrong shapes, implausible values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._checks import check_finite, first_index, numbers, spelled_out
from ..errors import DataError, OptionError, TimeAxisError
from ..numerics.arrays import FloatArray, read_only
from ..numerics.constants import LARGEST
from ..numerics.signals.time_axis import UNIFORM_WITHIN, AxisFault, axis_fault


def check_shape(values: FloatArray, what: str, samples: int) -> None:
    """Refuse a signal that is not (N,) or (signals, N) with the N of the time axis."""
    if values.ndim not in (1, 2) or values.size == 0:
        raise DataError(f"{what} has shape {values.shape}; expected ({samples},) or (signals, N)")
    if values.shape[-1] != samples:
        turned = values.ndim == 2 and values.shape[0] == samples
        hint = f"; it looks transposed, pass {what}.T" if turned else ""
        raise DataError(f"{what} has {values.shape[-1]} samples, time has {samples}{hint}")


def checked_signal(
    given: ArrayLike, what: str, samples: int, *, allow_nan: bool = False
) -> FloatArray:
    """Return a signal (samples,) or (signals, samples) of plausible numbers."""
    values = numbers(given, what)
    check_shape(values, what, samples)
    check_finite(values, what, allow_nan=allow_nan)
    check_size(values, what)
    return values


def increasing_stamps(time: ArrayLike, what: str, least: int) -> FloatArray:
    """Return time stamps (N,), at least so many, that increase from row to row."""
    stamps = numbers(time, what)
    if stamps.ndim != 1 or stamps.size < least:
        raise DataError(f"{what} has shape {stamps.shape}; expected (N,), N >= {least}")
    check_finite(stamps, what)
    check_size(stamps, what)
    fault = axis_fault(stamps) if np.any(np.diff(stamps) <= 0) else None
    if fault is not None:
        raise TimeAxisError(f"{axis_words(fault)}; {what} must increase from row to row")
    return stamps


def check_size(values: FloatArray, what: str) -> None:
    """Refuse numbers that are implausible for a measurement and whose squares overflow."""
    # NaN marks a missing sample here, and no comparison with it is true
    large = np.abs(values) > LARGEST
    if large.any():
        raise DataError(
            f"{what} is larger than {LARGEST:g} at index {first_index(large)}; check the file and "
            "the unit"
        )


def checked_reference(given: Any, output: FloatArray) -> FloatArray | None:
    """Return the set point of every output, NaN where it is not in force."""
    if given is None:
        return None
    if np.shape(given) != output.shape:
        raise DataError(
            f"reference has shape {np.shape(given)}; expected that of the output, {output.shape}: "
            "the set point at every sample"
        )
    return read_only(checked_signal(given, "reference", output.shape[-1], allow_nan=True))


def labelled(
    given: Sequence[str] | None, count: int, letter: str, argument: str
) -> tuple[str, ...]:
    """Return one name for each of `count` signals, made from `letter` if none are given."""
    if given is None:
        return (letter,) if count == 1 else tuple(f"{letter}[{i}]" for i in range(count))
    if not isinstance(given, Sequence):
        raise OptionError(f"{argument} is a {type(given).__name__}; expected {count} names")
    labels = (given,) if isinstance(given, str) else tuple(given)
    labels = tuple(spelled_out(str(label)) for label in labels)
    if len(labels) != count or len(set(labels)) != count:
        raise OptionError(f"{argument}={labels!r}; expected {count} different names")
    return labels


def checked_units(given: Any, labels: Sequence[str]) -> dict[str, str]:
    """Return the units of signals by label, and that of time."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise OptionError(
            f"units={given!r}; expected units by label, such as {{{labels[0]!r}: '%'}}"
        )
    strange = [name for name in given if name not in (*labels, "time")]
    if strange:
        raise OptionError(
            f"units has the names {', '.join(map(repr, strange[:5]))}; expected "
            f"{', '.join(map(repr, labels[:20]))} or 'time'"
        )
    return {str(name): spelled_out(str(unit)) for name, unit in given.items() if str(unit)}


def axis_words(fault: AxisFault) -> str:
    """Describe what is wrong with a time axis, and where."""
    kind, row, value, usual, worst = fault
    missing = value / usual - 1 if kind == "gap" else 0.0  # of other faults it may overflow
    return {
        "extreme": f"time is {value:g} s at row {row}",
        "tiny_steps": f"time runs in steps of {value:g} s",
        "backwards": f"time runs backwards: row 1 is at {value:g} s, row 0 at {usual:g} s (the "
        "newest sample is first: reverse time, input and output)",
        "repeated": f"time repeats at row {row}: {value:.9g} s after {usual:.9g} s",
        "jumps_back": f"time jumps back at row {row}: {value:.9g} s after {usual:.9g} s",
        "gap": f"time has a gap at row {row}: {value:.6g} s where {usual:.6g} s is usual "
        f"(about {missing:.0f} sample(s) missing)",
        "not_uniform": f"time is not uniform: row {row} is {value:.2g} samples off the uniform "
        f"grid of {usual:.6g} s (worst: {worst:.2f}; allowed: {UNIFORM_WITHIN})",
    }[kind]
