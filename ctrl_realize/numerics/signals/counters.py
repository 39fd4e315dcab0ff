"""Counters and angles that start again at the end of their range, and clocks that are set.

Our own rule: all jumps are longer than half of the range, all other steps are short, and each jump
is the range of an angle or a register but for a step like others, or the signal moves the other way
beside it, as a counter does that falls from its end to its start. `numpy.unwrap` joins the turns. A
clock is set for summer time where, of regular stamps, one step is an hour too short or too long, in
the first hours of a Sunday of the months in which clocks are set.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import FloatArray

_JUMP, _STEP = 0.5, 0.2
"""Parts of the range: a jump is at least so long, another step at most. A first-order lag whose
sample time is a third of it moves by 0.28 of its response in a sample."""
_SLOW = 0.05  # of a turn: the longest step of a signal of which noise may turn the way
_FEWEST = 30  # samples of which a tenth at most are jumps
_SEVERAL = 4  # jumps of a counter of another range; one jump of a noisy step may look alike
_ANGLES = (2 * np.pi, 360.0)
_BITS = tuple(2.0**bits for bits in range(8, 33))  # registers of counters: a byte to four
_BACK, _FORWARD = (4, 10, 11), (3, 9, 10)
"""Months, of both hemispheres."""
_TICKS = {"ms": 1e3, "us": 1e6, "ns": 1e9}  # in a second
_YEAR_2005, _YEAR_2060 = 1.1e9, 2.85e9  # in s since 1970; a clock in seconds needs no check
_AN_HOUR = 3600.0  # in s; ticks since the start of a device may have the numbers of a date
_NO_SECONDS = 1e11  # in s, the year 5138
_DAY_COUNTS = ((36526.0, 58440.0), (730486.0, 752400.0))
"""Years 2000 to 2060 in days, as counted by Excel and by MATLAB's datenum."""
_ROUND = 1e-5  # relative difference of a step from its first three digits
_EARLY = np.timedelta64(4, "h")  # after midnight
_REGULAR = 1 / 3  # of a step
_HOUR = np.timedelta64(1, "h")  # by which clocks are set


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def counter_period(values: FloatArray) -> float | None:
    """Find the range of a counter that starts again; None if the signal looks like no counter.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Signal; NaN is missing.

    Returns
    -------
    float or None
        A power of two, 360 or 2 pi, if the jumps fit; otherwise, for whole numbers, about the
        length of a jump and a step.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.counters import counter_period
    >>> turned = np.floor(30.3 * np.arange(1000.0))
    >>> counter_period(turned % 4096), counter_period(turned % 5000), counter_period(turned)
    (4096.0, 5000.0, None)
    >>> counter_period((0.1 * np.arange(200.0)) % (2 * np.pi))
    6.283185307179586
    """
    known = values[~np.isnan(values)]
    steps = np.diff(known)
    reach = float(np.ptp(known)) if known.size else 0.0
    jumps = np.flatnonzero(np.abs(steps) > _JUMP * reach)
    if known.size < _FEWEST or not 0 < jumps.size <= known.size // 10:
        return None
    others = np.delete(steps, jumps)
    quick = float(np.abs(others).max())
    counts = bool(np.all(known == np.round(known)))
    sizes = np.abs(steps[jumps])
    usual = min(_ANGLES + counts * _BITS, key=lambda one: abs(one - float(np.median(sizes))))
    # Noise may turn the steps beside a jump, which is a whole turn but for a step like others. A
    # signal from one end of its range to the other does not move on when the jumps are joined.
    like_others = np.abs(sizes - usual).max() <= max(quick, 1.0 * counts) <= _SLOW * usual
    if like_others and reach < usual and np.ptp(np.unwrap(known, period=usual)) > _STEP * usual:
        return float(usual)
    inner = jumps[(jumps > 0) & (jumps < steps.size - 1)]
    beside = np.stack([steps[inner - 1], steps[inner + 1]])
    if not inner.size or quick > _STEP * reach or np.any(beside * steps[inner] >= 0):
        return None
    period = float(np.median(np.abs(steps[inner]) + np.abs(beside).mean(axis=0)))
    usual = min(_ANGLES + counts * _BITS, key=lambda one: abs(one - period))
    # the step that a jump hides lies between those beside it, or near them
    slack = float(np.abs(np.diff(beside, axis=0)).max()) / np.sqrt(inner.size) + counts
    if abs(usual - period) <= slack and usual > reach:
        return float(usual)
    return float(np.round(period)) if counts and inner.size >= _SEVERAL else None


def clock_change(stamps: np.ndarray[Any, np.dtype[np.datetime64]]) -> tuple[int, int]:
    """Find the change of a clock that shows summer time.

    Parameters
    ----------
    stamps : ndarray of datetime64, shape (N,)

    Returns
    -------
    row, hours : int
        First stamp after the change, and by how many hours the clock was set: -1, 1, or 0 for none.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.counters import clock_change
    >>> utc = np.datetime64("2025-10-26T00:00") + np.timedelta64(10, "m") * np.arange(12)
    >>> clock_change(utc + np.timedelta64(1, "h") * (2 - (np.arange(12) >= 6)))
    (6, -1)
    >>> clock_change(utc)
    (0, 0)
    """
    steps = np.diff(stamps) / _HOUR
    usual = float(np.median(steps)) if steps.size else 0.0
    odd = np.flatnonzero(np.abs(steps - usual) > _REGULAR * usual)
    if odd.size != 1 or not usual > 0:
        return 0, 0
    row = int(odd[0]) + 1
    turn = float(steps[row - 1]) - usual
    day = stamps[row].astype("datetime64[D]")
    month = int(stamps[row].astype("datetime64[M]").astype(int)) % 12 + 1
    months = {-1: _BACK, 1: _FORWARD}.get(round(turn), ())
    at_night = np.is_busday(day, weekmask="Sun") and stamps[row] - day <= _EARLY
    if abs(turn - round(turn)) > _REGULAR * usual or not at_night or month not in months:
        return 0, 0
    return row, round(turn)


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def clock_unit(values: FloatArray) -> str | None:
    """Unit of the numbers of a clock: ticks since 1970, or days as in a spreadsheet.

    A clock in seconds may have such numbers of days too, but then its steps are round.

    Parameters
    ----------
    values : ndarray, shape (N,)

    Returns
    -------
    str or None
        Empty if they may be seconds; None if they can be neither.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.counters import clock_unit
    >>> k = np.arange(5.0)
    >>> clock_unit(1738397700e3 + 500 * k), clock_unit(46085.5 + k / 86400), clock_unit(7e11 + k)
    ('ms', 'day', None)
    >>> clock_unit(k)
    ''
    """
    if not values.size:
        return ""
    first, step = float(values[0]), float(values[-1] - values[0]) / max(values.size - 1, 1)
    for unit, ticks in _TICKS.items():
        if _YEAR_2005 <= first / ticks < _YEAR_2060 and 0 < abs(step) / ticks <= _AN_HOUR:
            return unit
    if first > _NO_SECONDS:
        return None
    if not any(low <= first < high for low, high in _DAY_COUNTS):
        return ""
    coarse = 0 < 86400 * step < 1.5 * _AN_HOUR and abs(float(f"{step:.3g}") / step - 1) >= _ROUND
    return "day" if coarse else ""
