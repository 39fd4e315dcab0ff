"""Dates as they are written around the world, as time stamps.

ISO 8601 is read as it is. Other dates are read by the first cell: ``01.02.2025`` is day, month and
year; ``1/2/2025`` is so if one of the cells has a day above 12 in that place. If no cell tells,
both readings are compared: they may give the same times (all on one day), or one of them leaves
gaps of months where the other is regular. Otherwise the date is ambiguous.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np

from ...errors import DataError, OptionError

Stamps = np.ndarray[Any, np.dtype[np.datetime64]]

_DATE = re.compile(
    r"(?P<a>\d{1,4})(?P<mark>[-/. ])(?P<b>\d{1,2}|[^\W\d_]{3,9})\.?[-/. ](?P<c>\d{2,4})\.?"
    r"(?:[ T]+(?P<clock>\d.*))?"
)
_CLOCK = re.compile(r"\d{1,2}:\d{2}(?P<seconds>:\d{2}(?P<part>\.\d+)?)?(?P<half> [AP]M)?")
_HALF = re.compile(r" ?([AaPp])\.?[Mm]\.?$")
_MONTHS = {"mrz": "mar", "mär": "mar", "mai": "may", "okt": "oct", "dez": "dec"}
"""German months whose first three letters are not those of the English names."""
_REGULAR = 10.0
"""Largest gap of a regular time axis, in usual steps; a wrong order of day and month makes gaps of
weeks where the days change."""


class Dates(NamedTuple):
    """Time stamps, NaT where a cell is none.

    ``form`` is their format in words; ``doubt`` tells if they may be other dates, with the same
    distances between them.
    """

    stamps: Stamps
    form: str
    doubt: str = ""


def stamps_of(cells: list[str], time_format: str | None) -> Dates:
    """Return the time stamps of cells.

    Raises
    ------
    OptionError
        `time_format` is not a format, or day and month cannot be distinguished.
    """
    if time_format is not None:
        return Dates(_parsed(cells, time_format), time_format)
    stamps = _parsed(cells, "ISO8601")
    first = next((cell for cell in cells if cell), "")
    if not np.isnat(stamps).all() or not _DATE.fullmatch(_plain(first)):
        return Dates(stamps, "ISO 8601")
    plain = [_plain(cell) for cell in cells]
    formats = _formats(plain)
    if not formats:
        return Dates(stamps, "ISO 8601")
    read = [_in_format(plain, one) for one in formats]
    if len(read) == 1:
        return Dates(read[0], formats[0])
    doubt = (
        f"{first!r} may be written as day and month or as month and day; give "
        f"time_format={formats[0]!r} or {formats[1]!r}"
    )
    if _same_times(*read):
        return Dates(read[0], formats[0], doubt)
    regular = [_is_regular(one) for one in read]
    if sum(regular) != 1:
        raise OptionError(doubt)
    chosen = regular.index(True)
    return Dates(read[chosen], formats[chosen])


def in_utc(stamps: Stamps, zone: str) -> Stamps:
    """Return stamps of a clock with summer time in UTC; stamps are in order, or newest first.

    The order tells the hours apart that the clock shows twice.

    Raises
    ------
    OptionError
        There is no such zone.
    DataError
        The order does not tell, or a stamp is in the hour that is left out in spring.
    """
    import pandas as pd

    try:
        pd.Timestamp(0, tz=zone)
    except (KeyError, ValueError, TypeError) as error:
        raise OptionError(
            f"time_zone={zone!r} is not known; expected a name such as 'Europe/Berlin'"
        ) from error
    turned = -1 if stamps.size and stamps[0] > stamps[-1] else 1
    ordered = stamps[::turned]
    # equal stamps: an hour apart in a table of hours, or those of several signals at one time
    once = np.r_[True, ordered[1:] != ordered[:-1]][: stamps.size]
    for new in (np.ones_like(once), once):
        try:
            local = pd.DatetimeIndex(ordered[new]).tz_localize(zone, ambiguous="infer")
        except Exception as error:  # pandas 2 raises errors of pytz
            reason = error
            continue
        utc = np.asarray(local.tz_convert("UTC").tz_localize(None), dtype="datetime64[ns]")
        return np.asarray(utc[np.cumsum(new) - 1][::turned])
    raise DataError(
        f"time_zone={zone!r} does not fit the stamps: {reason}; expected an hour that comes twice, "
        "in order of time, where summer time ends"
    ) from reason


def have_offset(cell: str) -> bool:
    """Whether a date is written with its distance from UTC."""
    return bool(re.search(r":\d.*(Z|UTC|[+-]\d{2}:?\d{2})$", cell))


def _plain(cell: str) -> str:
    """Cell with single blanks, AM or PM in capital letters and a decimal point."""
    text = _HALF.sub(lambda half: f" {half[1].upper()}M", " ".join(cell.split()))
    return re.sub(r"(?<=\d),(?=\d+( |$))", ".", text)


def _formats(cells: list[str]) -> list[str]:
    """Formats that the cells may have: one, or two if day and month cannot be distinguished."""
    found = [match for match in map(_DATE.fullmatch, cells) if match]
    first = found[0]
    clock = _clock_format(first["clock"])
    if clock is None:
        return []
    mark, year = first["mark"], "%Y" if len(first["c"]) == 4 else "%y"
    if len(first["a"]) == 4:
        dates = [f"%Y{mark}%m{mark}%d"]
    elif not first["b"].isdecimal():
        dates = [f"%d{mark}%b{mark}{year}"]
    else:
        day_first, month_first = f"%d{mark}%m{mark}{year}", f"%m{mark}%d{mark}{year}"
        if mark == "." or any(int(match["a"]) > 12 for match in found):
            dates = [day_first]
        elif any(match["b"].isdecimal() and int(match["b"]) > 12 for match in found):
            dates = [month_first]
        else:
            dates = [day_first, month_first]
    return [date + clock for date in dates]


def _clock_format(clock: str | None) -> str | None:
    if clock is None:
        return ""
    match = _CLOCK.fullmatch(clock)
    if match is None:
        return None
    hour = " %I:%M" if match["half"] else " %H:%M"
    seconds = ":%S" if match["seconds"] else ""
    return hour + seconds + (".%f" if match["part"] else "") + (" %p" if match["half"] else "")


def _in_format(cells: list[str], form: str) -> Stamps:
    """Stamps in a format; a part of a second may be there or not."""
    cells = [re.sub(r"[^\W\d_]{3,9}\.?(?=[-/. ]+\d)", _month, cell) for cell in cells]
    cells = [re.sub(r"T(?=\d)", " ", cell) for cell in cells]
    stamps = _parsed(cells, form)
    other = form.replace(".%f", "") if "%f" in form else form.replace("%S", "%S.%f")
    left = np.isnat(stamps)
    if left.any() and other != form:
        stamps[left] = _parsed([cell for cell, bad in zip(cells, left, strict=True) if bad], other)
    return stamps


def _month(match: re.Match[str]) -> str:
    letters = match[0][:3].lower()
    return _MONTHS.get(letters, letters)


def _parsed(cells: list[str], form: str) -> Stamps:
    import pandas as pd

    try:
        stamps = pd.to_datetime(pd.Series(cells, dtype=str), format=form, utc=True, errors="coerce")
    except (ValueError, TypeError) as error:
        raise OptionError(f"time_format={form!r} is not a time format: {error}") from error
    return np.array(stamps.dt.tz_localize(None).to_numpy(), dtype="datetime64[ns]")


def _same_times(one: Stamps, two: Stamps) -> bool:
    return bool(np.array_equal(one - one[0], two - two[0], equal_nan=False))


def _is_regular(stamps: Stamps) -> bool:
    """Whether the stamps run in one direction without long gaps."""
    if np.isnat(stamps).any() or stamps.size < 3:
        return False
    steps = np.diff(stamps) / np.timedelta64(1, "ns")
    usual = float(np.median(steps))
    return bool(usual and np.all(steps / usual > -_REGULAR) and np.all(steps / usual < _REGULAR))
