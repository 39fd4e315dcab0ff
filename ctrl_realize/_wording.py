"""Numbers as text: times in a suitable unit, a sensible number of digits; and words of choices."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np

from ._facts import facts
from .numerics.arrays import FloatArray

UNITS = {"s": 1.0, "ms": 1e3, "µs": 1e6, "min": 1 / 60, "h": 1 / 3600, "day": 1 / 86400}
"""Name of a unit of time -> number of it in a second."""

_SHOWN: ContextVar[str] = ContextVar("unit of time in which texts are written", default="s")

ASSUMED = "s (assumed)"
"""Unit of time of a record from a file that does not name one."""

_SLOW = ("min", "h", "day")
_SLOW_HZ = 1e-3  # below which a frequency tells less than its period


def shown_unit(unit: str) -> str:
    """Unit in which times of a record are written: a slow one stays, others are s, by size.

    Examples
    --------
    >>> from ctrl_realize._wording import shown_unit
    >>> shown_unit("min"), shown_unit("ms"), shown_unit("s (assumed)")
    ('min', 's', 's')
    """
    return unit if unit in _SLOW else "s"


@contextmanager
def times_in(unit: str | None) -> Iterator[None]:
    """Write times in a unit, such as that of a record, in the block; s is s, ms or µs by size.

    None leaves the unit of the block around it.

    Examples
    --------
    >>> from ctrl_realize._wording import in_time, times_in
    >>> with times_in("min"):
    ...     in_time(2700.0), in_time(3.0)
    ('45 min', '0.05 min')
    """
    token = _SHOWN.set(unit or _SHOWN.get())
    try:
        yield
    finally:
        _SHOWN.reset(token)


def time_unit(largest: float) -> tuple[float, str]:
    """Choose a unit for times up to `largest` s; returns (units per second, name).

    That of `times_in`; for seconds s, ms or µs by size.

    Examples
    --------
    >>> from ctrl_realize._wording import time_unit
    >>> time_unit(3.0), time_unit(0.029), time_unit(0.0)
    ((1.0, 's'), (1000.0, 'ms'), (1.0, 's'))
    """
    shown = _SHOWN.get()
    if shown != "s":
        return UNITS[shown], shown
    name = "s" if largest >= 0.5 or largest == 0 else "ms" if largest >= 0.5e-3 else "µs"
    return UNITS[name], name


def in_time(seconds: float, digits: int = 3) -> str:
    """Write a time with a suitable unit.

    Examples
    --------
    >>> from ctrl_realize._wording import in_time
    >>> in_time(0.02890625), in_time(1.3), in_time(8.06313e-06), in_time(float("nan"))
    ('28.9 ms', '1.3 s', '8.06 µs', 'unknown')
    """
    if not np.isfinite(seconds):
        return "unknown" if np.isnan(seconds) else "infinite"
    if seconds == 0:
        return "0 s"
    factor, name = time_unit(abs(seconds))
    return f"{plainly(seconds * factor, digits)} {name}"


def poles_in_words(poles: Iterable[complex]) -> str:
    """Write poles in rad/s as lags, pairs and integrators.

    Examples
    --------
    >>> from ctrl_realize._wording import poles_in_words
    >>> poles_in_words([-2.0, -20 + 99j, -20 - 99j, 0.0])
    'lag 0.5 s, pair at 16.1 Hz (damping 0.2), integrator'
    >>> poles_in_words([-0.0004 + 0.0003j, -0.0004 - 0.0003j])
    'pair with a period of 12566 s (damping 0.8)'
    >>> poles_in_words([-1300 + 10700j, -1300 - 10700j])
    'pair at 1715 Hz (damping 0.12)'
    """
    upper = [p for p in map(complex, poles) if p.imag >= 0]
    return ", ".join(map(_pole_in_words, sorted(upper, key=lambda p: (p == 0, -p.real))))


def _pole_in_words(pole: complex) -> str:
    if pole == 0:
        return "integrator"
    size = abs(pole)
    if pole.imag > 0:
        damping = f"(damping {-pole.real / size:.2g})"
        if _SHOWN.get() in _SLOW or size < 2 * np.pi * _SLOW_HZ:
            return f"pair with a period of {in_time(2 * np.pi / size)} {damping}"
        return f"pair at {plainly(size / (2 * np.pi), 3)} Hz {damping}"
    return f"{'lag' if pole.real < 0 else 'growing in'} {in_time(1 / size)}"


def rate_in_time(per_second: float) -> str:
    """Write a slope per unit of time.

    Examples
    --------
    >>> from ctrl_realize._wording import rate_in_time, times_in
    >>> with times_in("min"):
    ...     rate_in_time(0.5)
    '30 per min'
    """
    shown = _SHOWN.get()
    return f"{per_second / UNITS[shown]:.3g} per {shown}"


def interval_in_time(low: float, high: float, word: str = "to") -> str:
    """Write an interval of times in one unit, with two significant digits of its width.

    Examples
    --------
    >>> from ctrl_realize._wording import interval_in_time
    >>> interval_in_time(0.0256, 0.03737), interval_in_time(0.124534, 0.125411)
    ('25.6 to 37.4 ms', '124.53 to 125.41 ms')
    >>> interval_in_time(0.0, 0.00327)
    '0 to 3.27 ms'
    >>> interval_in_time(0.026, 0.0374), interval_in_time(0.026, 0.0374, "and")
    ('26.0 to 37.4 ms', '26.0 and 37.4 ms')
    """
    if not (np.isfinite(low) and np.isfinite(high)):
        return f"{in_time(low)} {word} {in_time(high)}"
    factor, name = time_unit(max(abs(low), abs(high)))
    low, high = factor * low, factor * high
    ends = numbers_alike((low, high), low, high)
    return f"{f' {word} '.join(ends)} {name}"


def only_end(low: float, high: float) -> str:
    """Write the end of an interval that has one alone; empty if it has none, or two.

    Examples
    --------
    >>> from ctrl_realize._wording import only_end
    >>> only_end(0.2196, float("inf")), only_end(0.2, 0.3)
    ('at least 0.22', '')
    """
    if np.isfinite(low) == np.isfinite(high):
        return ""
    return f"at least {low:.3g}" if np.isfinite(low) else f"at most {high:.3g}"


def time_within(value: float, low: float, high: float) -> str:
    """Write an estimate in the unit of its interval, rounded to the same digit.

    Equal rounding keeps the order: an estimate inside its interval is also shown inside.

    Examples
    --------
    >>> from ctrl_realize._wording import interval_in_time, time_within
    >>> time_within(0.12486, 0.12473, 0.12612), interval_in_time(0.12473, 0.12612)
    ('124.9 ms', '124.7 to 126.1 ms')
    >>> time_within(0.0304, 0.0, 41.2), interval_in_time(0.0, 41.2)
    ('0.0 s', '0 to 41.2 s')
    """
    if not (np.isfinite(low) and np.isfinite(high) and np.isfinite(value)):
        return in_time(value, 4)
    factor, name = time_unit(max(abs(low), abs(high)))
    return f"{number_within(factor * value, factor * low, factor * high)} {name}"


def time_and_interval(value: float, low: float, high: float) -> str:
    """Write an estimate of a time with its interval.

    Examples
    --------
    >>> from ctrl_realize._wording import time_and_interval
    >>> time_and_interval(0.12486, 0.12473, 0.12612)
    '124.9 ms (124.7 to 126.1 ms)'
    """
    return f"{time_within(value, low, high)} ({interval_in_time(low, high)})"


def number_within(value: float, low: float, high: float) -> str:
    """Write an estimate rounded to the same digit as the ends of its interval.

    Examples
    --------
    >>> from ctrl_realize._wording import number_within
    >>> number_within(37.0712, 36.9, 38.2), number_within(2.0, 2.0, 2.0)
    ('37.1', '2.000')
    >>> number_within(7.21978e-05, 4.3e-05, 20.7e-05)
    '7.22e-05'
    """
    if not (np.isfinite(low) and np.isfinite(high)):
        return f"{value:.4g}"
    return numbers_alike((value,), low, high)[0]


def numbers_alike(values: Iterable[float], low: float, high: float) -> list[str]:
    """Write numbers with one number of decimals, so that ``high - low`` has two digits.

    The larger end has at least three digits, four if the width is zero.

    Examples
    --------
    >>> from ctrl_realize._wording import numbers_alike
    >>> numbers_alike([9.1234, 37.44], 9.0, 37.0), numbers_alike([0.0, 12345.6], 0.0, 12e3)
    (['9.1', '37.4'], ['0', '12346'])
    """
    several = [float(value) for value in values]
    largest, width = max(abs(low), abs(high)), high - low
    if largest == 0 or not 1e-3 < largest < 1e6:
        digits = 6
        if width > 0 and largest > 0:
            digits = int(np.clip(2 + np.floor(np.log10(largest)) - np.floor(np.log10(width)), 3, 6))
        return [f"{value:.{digits}g}" for value in several]
    least = (4 if width <= 0 else 3) - 1 - int(np.floor(np.log10(largest)))
    # a width of 0.9999..., computed from 1, counts as 1
    shown = 1 - int(np.floor(np.log10(width) + 1e-9)) if width > 0 else least
    decimals = int(np.clip(max(shown, least), 0, 9))
    return ["0" if value == 0 else f"{value:.{decimals}f}" for value in several]


def plainly(value: float, digits: int) -> str:
    """Write a number without an exponent below a million.

    Examples
    --------
    >>> from ctrl_realize._wording import plainly
    >>> plainly(153.2, 2), plainly(1.532, 2), plainly(15.32e6, 3)
    ('153', '1.5', '1.53e+07')
    """
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits}g}"


def in_digits(value: float) -> str:
    """Write a number with four digits; an empty text if it is not finite.

    Examples
    --------
    >>> from ctrl_realize._wording import in_digits
    >>> in_digits(16.00001), in_digits(float("nan"))
    ('16', '')
    """
    return f"{value:.4g}" if np.isfinite(value) else ""


def in_numbers(values: FloatArray) -> str:
    """Write a matrix in one line, rows separated by semicolons; eight numbers of a row are shown.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize._wording import in_numbers
    >>> in_numbers(np.array([[0.53770001, 2.0], [1e-5, 0.0]]))
    '0.5377, 2; 1e-05, 0'
    """
    rows = []
    for row in np.atleast_2d(values):
        shown = ", ".join(f"{value:.4g}" for value in row[:8])
        rows.append(shown + (", …" if row.size > 8 else ""))
    return "; ".join(rows)


def in_percent(fits: Iterable[float]) -> str:
    """Write the fit percentage of each output.

    Examples
    --------
    >>> from ctrl_realize._wording import in_percent
    >>> in_percent([98.761, float("-inf")])
    '98.76 %, undefined: the output is constant'
    """
    constant = "undefined: the output is constant"
    return ", ".join(f"{fit:.2f} %" if np.isfinite(fit) else constant for fit in fits)


def count_of(number: int, noun: str) -> str:
    """Write a number of things.

    >>> count_of(1, "missing value"), count_of(2, "input")
    ('1 missing value', '2 inputs')
    """
    return f"{number} {noun}" + ("" if number == 1 else "s")


def named(kind: str, name: str) -> str:
    """Refer to an object by its name, if it has one.

    Examples
    --------
    >>> from ctrl_realize._wording import named
    >>> named("record", "valve_16mA"), named("record", "")
    ("record 'valve_16mA'", 'the record')
    """
    return f"{kind} {name!r}" if name else f"the {kind}"


def chosen(key: str, /, **values: object) -> str:
    """Say what was chosen automatically, and why, in the words of the table.

    Parameters
    ----------
    key : str
        ``"topic.choice"``.
    **values
        What stands in braces in the words.

    Examples
    --------
    >>> from ctrl_realize._wording import chosen
    >>> chosen("structure.only", kind="order 1, relative degree 1")
    'order 1, relative degree 1: the only structure that was tried'
    """
    topic, _, choice = key.partition(".")
    return str(facts("choices.toml")[topic][choice]).format(**values)
