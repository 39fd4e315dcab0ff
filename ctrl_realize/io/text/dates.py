"""Dates as they are written around the world, as time stamps.

ISO 8601 is read as it is. Other dates are read by the first cell: ``01.02.2025`` is day, month and
year; ``1/2/2025`` is so if one of the cells has a day above 12 in that place. If no cell tells,
both readings are compared: they may give the same times (all on one day), or one of them leaves
gaps of months where the other is regular. Otherwise the date is ambiguous.
"""

from __future__ import annotations

import re
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ...errors import DataError, OptionError

Stamps = np.ndarray[Any, np.dtype[np.datetime64]]

_DATES = ("%d-%m-%Y", "%m-%d-%Y", "%d-%m-%y", "%m-%d-%y", "%Y-%m-%d", "%d-%b-%Y", "%d-%b-%y")
"""Dates with another sign in place of the hyphen; with points the day is before the month."""
_CLOCKS = (
    "", " %H:%M", " %H:%M:%S", " %H:%M:%S.%f", " %I:%M %p", " %I:%M:%S %p", " %I:%M:%S.%f %p",
)  # fmt: skip
PART = re.compile(r"(?<=:\d\d)[,;:](?=\d{3,}$)")
"""Sign before a part of a second, as some controllers write it."""
_HALF = re.compile(r" ?([AaPp])\.?[Mm]\.?$")
_UNIVERSAL = re.compile(r" (UTC|GMT)$")
_MONTHS = {"mrz": "mar", "mär": "mar", "mai": "may", "okt": "oct", "dez": "dec"}
"""German months whose first three letters are not those of the English names."""
_REGULAR = 10.0
"""Largest gap of a regular time axis, in usual steps; a wrong order of day and month makes gaps of
weeks where the days change."""


class Dates(NamedTuple):
    """Time stamps, NaT where a cell is none.

    ``form`` is their format in words; ``doubt`` tells if they may be the `other` dates, with the
    same distances between them.
    """

    stamps: Stamps
    form: str
    doubt: str = ""
    other: Stamps | None = None


def stamps_of(cells: list[str], time_format: str | None) -> Dates:
    """Return the time stamps of cells.

    Raises
    ------
    OptionError
        `time_format` is not a format, or day and month cannot be distinguished.
    """
    if time_format is not None:
        return Dates(_parsed(cells, time_format), time_format)
    cells = [_UNIVERSAL.sub("", cell) for cell in cells]  # as stamps without zone are read
    stamps = _parsed(cells, "ISO8601")
    if not np.isnat(stamps).all():
        return Dates(stamps, "ISO 8601")
    plain = [_plain(cell) for cell in cells]
    first = next((cell for cell in plain if cell), "")
    found = {form: _in_format(plain, form) for form in _formats(first)}
    bad = {form: int(np.isnat(read).sum()) for form, read in found.items()}
    formats = [form for form in found if bad[form] == min(bad.values())]
    read = [found[form] for form in formats]
    if len(formats) < 2:
        return Dates(read[0], formats[0]) if formats else Dates(stamps, "ISO 8601")
    doubt = (
        f"{cells[plain.index(first)]!r} may be written as day and month or as month and day; give "
        f"time_format={formats[0]!r} or {formats[1]!r}"
    )
    if np.array_equal(*(one - one[0] for one in read)):
        return Dates(read[0], formats[0], doubt, read[1])
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
    turned = direction(stamps)
    ordered = stamps[::turned]
    back = np.flatnonzero(np.diff(ordered) < np.timedelta64(0, "ns"))
    # equal stamps: an hour apart in a table of hours, or those of several signals at one time
    once = np.r_[True, ordered[1:] != ordered[:-1]][: stamps.size]
    tries: list[tuple[Any, Any]] = [(np.ones_like(once), "infer"), (once, "infer")]
    if back.size == 1:  # only a part of the hour is there twice
        tries.append((tries[0][0], np.arange(stamps.size) <= back[0]))
    if not back.size:  # the record ends or begins in the hour
        tries += [(tries[0][0], np.full(stamps.size, summer)) for summer in (True, False)]
    for new, summer in tries:
        try:
            local = pd.DatetimeIndex(ordered[new]).tz_localize(zone, ambiguous=summer)
        except Exception as error:  # pandas 2 raises errors of pytz
            reason = error
            continue
        utc = np.asarray(local.tz_convert("UTC").tz_localize(None), dtype="datetime64[ns]")
        guessed = not back.size and not isinstance(summer, str)
        if guessed and np.any(np.diff(utc) > np.timedelta64(1, "h")):
            continue
        return np.asarray(utc[np.cumsum(new) - 1][::turned])
    raise DataError(
        f"time_zone={zone!r} does not fit the stamps: {reason}; expected an hour that comes twice, "
        "in order of time, where summer time ends"
    ) from reason


def direction(stamps: Stamps) -> int:
    """1 for stamps in order, -1 for the newest first; a clock may be set in between."""
    return -1 if np.sum(np.diff(stamps) < np.timedelta64(0, "ns")) > stamps.size / 2 else 1


def date_of(text: str, form: str) -> Any:
    """Date in the format of a file or in ISO 8601, NaT if it is none; the clock may be left out."""
    import pandas as pd

    text = PART.sub(".", text.strip())
    cell, day = _UNIVERSAL.sub("", text), re.split(r"\W*T?%[HI]", form)[0]
    forms = [form, *(day + clock for clock in _CLOCKS if "%" in day), "ISO8601"]
    # pandas knows "now" in each format, and takes 2100, an hour, for a year
    tries = product(forms, (text, cell, _plain(cell)) if re.search(r"\d.{4}", cell) else ())
    read = (pd.to_datetime(one, format=as_, errors="coerce") for as_, one in tries)
    stamp: Any = next((one for one in read if not pd.isna(one)), pd.NaT)
    return stamp.tz_localize("UTC") if cell != text and stamp.tzinfo is None else stamp


def zone_of(cells: list[str], form: str) -> Any:
    """Zone that dates are written with: None without one, empty if their offsets differ."""
    zone = date_of(cells[0], form).tzinfo
    end = re.sub(r".*?([A-Z]*|[+-]\d\d:?(\d\d)?)$", r"\1", cells[0])
    return zone if zone is None or all(cell.endswith(end) for cell in cells) else ""


def _plain(cell: str) -> str:
    """Cell with single blanks, English months, AM or PM, and a decimal point."""
    text = _HALF.sub(lambda half: f" {half[1].upper()}M", " ".join(cell.replace(", ", " ").split()))
    text = re.sub(r"[^\W\d_]{3,9}\.?(?=[-/. ]+\d)", _month, text)
    return re.sub(r"(?<=\d),(?=\d+([ Z+-]|$))", ".", re.sub(r"(?<=\d)T(?=\d)", " ", text))


def _formats(cell: str) -> list[str]:
    """Formats that a cell may have: several, if day and month cannot be distinguished."""
    mark = re.sub(r"\w", "", cell)[:1]
    dates = [one.replace("-", mark) for one in _DATES if mark != "." or not one.startswith("%m")]
    forms = [date + clock for date in dates for clock in _CLOCKS]
    forms += [clock.strip() for clock in _CLOCKS if "%p" in clock]  # a clock alone
    return [form for form in forms if not np.isnat(_parsed([cell], form)).any()]


def _in_format(cells: list[str], form: str) -> Stamps:
    """Stamps in a format; a part of a second may be there or not."""
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


def _is_regular(stamps: Stamps) -> bool:
    """Whether the stamps run in one direction without long gaps."""
    if np.isnat(stamps).any() or stamps.size < 3:
        return False
    steps = np.diff(stamps) / np.timedelta64(1, "ns")
    usual = float(np.median(steps))
    return bool(usual and np.all(steps / usual > -_REGULAR) and np.all(steps / usual < _REGULAR))
