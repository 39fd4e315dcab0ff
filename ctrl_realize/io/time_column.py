"""Time in seconds from a column of numbers, dates or times of day."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from .._wording import ASSUMED
from ..errors import DataError, OptionError, warn_caller
from ..numerics.arrays import FloatArray
from ..numerics.signals.counters import clock_change, clock_unit
from .columns import holds_numbers
from .tables import Table
from .text.dates import PART, Dates, direction, in_utc, stamps_of, zone_of
from .units import checked_time_unit, plain_unit, sample_time_unit, to_seconds, unit_named

# from here on neighbouring integers are the same double
_EXACT_INTEGERS = 2**53
# in 0.1 us since 1601, as TwinCAT and Windows count; years 1968 to 2101
_FILETIME = (1.16e17, 1.58e17)
# 12:34, 12:34.5, 12:34:56 and 12:34:56.789
_SHORT = r"\d{1,3}:\d{2}(\.\d*)?"
_CLOCK = rf"{_SHORT}|\d{{1,3}}:\d{{2}}:\d{{2}}(\.\d*)?"
_FIRST = {"hh:mm": "h", "h:mm": "h", "h:min": "h", "mm:ss": "min", "m:ss": "min", "min:s": "min"}
AS_STATED = 0.01
"""Relative difference of the usual step from the sample time in the header, or from `dt`."""


class TimeAxis(NamedTuple):
    """Time in s, and the date of second 0 where the column has dates.

    ``doubt`` tells if a date may be another one; ``unit`` is that of numbers in the file, ``form``
    the format of its dates. With a ``zone``, that of the clock or empty for offsets that differ,
    the date is in UTC.
    """

    seconds: FloatArray
    start: np.datetime64 | None = None
    doubt: str = ""
    unit: str = ""
    zone: Any = None
    form: str = ""


class Clock(NamedTuple):
    """How a column of time is written: unit of numbers, format of dates, and zone of the clock."""

    unit: str
    form: str | None
    zone: str | None


def time_axis(table: Table, index: int, clock: Clock, date: int | None = None) -> TimeAxis:
    """Return the time column in s; dates and times of day are relative to the first row.

    Parameters
    ----------
    table : Table
    index : int
        Position of the time column.
    clock : Clock
        Unit of numbers, or ``"auto"``: that of the header, otherwise s, which is `ASSUMED`; format
        of dates (as for `datetime.strptime`), if it cannot be inferred from the cells; zone of a
        clock that has summer time.
    date : int, optional
        Position of a column with the dates of times of day.

    Raises
    ------
    DataError
        A cell is not a time.
    OptionError
        Not a unit of time, or dates whose day and month cannot be distinguished.
    """
    cells = table.columns[index].cells
    unit, time_format, zone = clock
    if cells.dtype.kind in "mM":
        return _since_first(table, index, cells, zone)
    named = table.columns[index].told_unit or unit_named(table.columns[index].name)
    if time_format is not None or not holds_numbers(table, index):
        unit_used = named if unit == "auto" else unit
        dates = _parsed_dates(table, index, time_format, unit_used, date)
        own = zone_of([str(cell).strip() for cell in cells], dates.form)
        shown = zone if own is None else None
        if dates.other is not None:
            _refuse_other_clock(table, index, dates, shown)
        axis = _since_first(table, index, dates.stamps, shown)
        return axis._replace(doubt=dates.doubt or axis.doubt, zone=zone or own, form=dates.form)
    if zone is not None:
        _refuse_zone(table, index, zone)
    if unit == "auto" and cells.dtype.kind in "iu" and _FILETIME[0] < cells[0] < _FILETIME[1]:
        return TimeAxis((cells - cells[0]) / 1e7, unit="s")
    if unit == "auto":
        unit = named or _epoch_unit(table, index) or _stated_unit(table, index)
    used = checked_time_unit(unit or "s")
    if cells.dtype.kind in "iu" and cells.size and int(np.max(cells)) > _EXACT_INTEGERS:
        # nanoseconds since 1970 do not fit into a double, but their differences do
        values = (cells - cells[0]).astype(np.float64)
    else:
        values = table.numbers(index)
    return TimeAxis(to_seconds(values, used), unit=used if unit else ASSUMED)


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def _stated_unit(table: Table, index: int) -> str:
    """Unit of a column whose steps are the sample time that the file states, empty without one."""
    stated = {name: value for name, value in table.constants.items() if sample_time_unit(name)}
    if not stated or table.columns[index].cells.size < 2:
        return ""
    (name, value), step = *list(stated.items())[:1], float(np.median(np.diff(table.numbers(index))))
    unit = sample_time_unit(name)
    # several columns of time, each with its own
    if np.isnan(value) or np.isclose(step, value, rtol=AS_STATED):
        return unit
    if np.isclose(step, to_seconds(np.asarray(value), unit), rtol=AS_STATED):
        return "s"
    raise OptionError(
        f"{table.at(index)} runs in steps of {step:g}, and the file states {name} {value:g}; give "
        "time_unit=, the unit of the column"
    )


def _epoch_unit(table: Table, index: int) -> str:
    """Unit of a clock that counts since 1970, or days as in a spreadsheet; otherwise empty."""
    values = table.numbers(index)
    unit = clock_unit(values)
    begins = f"{table.at(index)} begins at {(*values[:1], 0.0)[0]:.14g}"
    if unit is None:
        raise OptionError(
            f"{begins}, which is no clock in s; give time_unit='ms', 'us' or 'ns', or time_format= "
            "such as '%Y%m%d%H%M%S'"
        )
    if unit:
        since = "days since 1900 or 0 (Excel, datenum)" if unit == "day" else f"{unit} since 1970"
        said = f"{begins} and is taken for {since}; time_unit= says otherwise, such as 's'"
        warn_caller(said)
    return unit


def _refuse_zone(table: Table, index: int, zone: str) -> NoReturn:
    raise OptionError(
        f"time_zone={zone!r}: {table.title(index)} of {table.path} has no dates; expected dates "
        "with the time of day"
    )


def _since_first(
    table: Table, index: int, stamps: np.ndarray[Any, Any], zone: str | None
) -> TimeAxis:
    missing = np.isnat(stamps)
    if missing.any():
        row = int(np.argmax(missing))
        raise DataError(f"{table.at(index, row)}: the time is missing")
    if not stamps.size:
        return TimeAxis(np.empty(0), None)
    doubt = ""
    if zone is not None:
        if stamps.dtype.kind != "M":
            _refuse_zone(table, index, zone)
        try:
            stamps = in_utc(stamps, zone)
        except (DataError, OptionError) as error:
            raise type(error)(f"{table.at(index)}: {error}") from error
    elif stamps.dtype.kind == "M":
        order = direction(stamps)  # historians list the newest sample first
        row, hours = clock_change(stamps[::order])
        if hours:
            place = table.place(row if order == 1 else stamps.size - 1 - row)
            warn_caller(
                f"{table.at(index)}: the clock is taken to be set "
                f"{'back' if hours < 0 else 'forward'} by an hour for summer time at {place}; "
                "time_zone= says otherwise, such as 'UTC'"
            )
            doubt = "the clock is set for summer time; give time_zone=, such as 'Europe/Berlin'"
            stamps = stamps - (np.arange(stamps.size) >= row)[::order] * np.timedelta64(hours, "h")
    dated = stamps.dtype.kind == "M"
    since = stamps - (stamps[0] if dated else min(stamps[0], stamps[-1]))
    seconds = np.asarray(since / np.timedelta64(1, "ns") / 1e9, dtype=np.float64)
    return TimeAxis(seconds, stamps[0] if dated else None, doubt, zone=zone)


def _refuse_other_clock(table: Table, index: int, dates: Dates, zone: str | None) -> None:
    """Refuse dates of which one reading alone is of a day on which the clock is set.

    Raises
    ------
    OptionError
    """
    hours = []
    for stamps in (dates.stamps, dates.other):
        try:
            clock = np.asarray(stamps) if zone is None else in_utc(np.asarray(stamps), zone)
        except DataError:
            hours.append(np.inf)  # not a day of that clock
        else:
            moved = clock_change(clock[:: direction(clock)])[1] if zone is None else 0
            hours.append((clock[-1] - clock[0]) / np.timedelta64(1, "h") - moved)
    if hours[0] != hours[1]:
        raise OptionError(
            f"{table.at(index)}: the clock is set for summer time on one of two possible days: "
            f"{dates.doubt}"
        )


def _parsed_dates(
    table: Table, index: int, time_format: str | None, unit: str, date: int | None
) -> Dates:
    written = [str(cell).strip() for cell in table.columns[index].cells]
    cells = [PART.sub(".", cell) for cell in written]
    if time_format is None:
        cells = [cell.replace(",", ".") for cell in cells]
    if date is not None and all(re.fullmatch(rf"({_CLOCK})( ?[AaPp][Mm])?", x) for x in cells[:3]):
        days = [str(cell).strip() for cell in table.columns[date].cells]
        cells, written = (list(map(" ".join, zip(days, x, strict=True))) for x in (cells, written))
    try:
        if time_format is None and all(re.fullmatch(_CLOCK, cell) for cell in cells[:3]):
            dates = Dates(_times_of_day(cells, written, unit, table.place(0)), "12:34:56")
        elif time_format is None and all(re.match(r"-?\d+ days?\b", cell) for cell in cells[:3]):
            dates = Dates(_durations(cells), "0 days 00:00:00")
        else:
            dates = stamps_of(cells, time_format)
            if dates.form.startswith("%I"):  # a clock alone
                since = dates.stamps - dates.stamps.astype("datetime64[D]")
                dates = dates._replace(stamps=_in_turns(since, np.timedelta64(1, "D")))
    except (DataError, OptionError) as error:
        raise type(error)(f"{table.at(index)}: {error}") from error
    bad = np.isnat(dates.stamps)
    if bad.any():
        row = int(np.argmax(bad))
        raise DataError(
            f"{table.at(index, row)}: {written[row][:60]!r} is neither a number nor a time in the "
            f"format {dates.form}; give time_format=, or dt= to ignore the column"
        )
    return dates


def _durations(cells: Sequence[str]) -> np.ndarray[Any, Any]:
    """Durations as pandas writes them, NaT where a cell is none."""
    import pandas as pd

    found = pd.to_timedelta(pd.Series(cells, dtype=str), errors="coerce")
    return np.asarray(found.to_numpy(dtype="timedelta64[ns]"))


def _times_of_day(
    cells: list[str], written: list[str], unit: str, place: str
) -> np.ndarray[Any, Any]:
    """Times as 12:34:56 or 12:34:56.789, on one day or across midnight, or as `unit` says.

    ``12:34`` may be hours and minutes, or minutes and seconds: `unit` is that of the first number.
    NaT where a cell is none. `written` are the cells in the file; `place` is that of the first.
    """
    shorts = [bool(re.fullmatch(_SHORT, cell)) for cell in cells]
    first = _FIRST.get(unit.lower(), plain_unit(unit))
    if any(shorts) and not all(shorts):
        raise DataError(
            f"times with two and three fields, such as {written[shorts.index(True)]!r}; expected "
            "one kind"
        )
    if any(shorts) and first not in ("h", "min"):
        raise OptionError(
            f"{written[0]!r} in {place} may be hours and minutes, or minutes and seconds; give "
            "time_unit='h' or time_unit='min', the unit of the first field"
        )
    ends = ("", "") if not any(shorts) else ("00:", "") if first == "min" else ("", ":00")
    stamps = _durations([ends[0] + cell + ends[1] for cell in cells])
    return _in_turns(stamps, np.timedelta64(1, "h" if ends[0] else "D"))


def _in_turns(stamps: np.ndarray[Any, Any], turn: np.timedelta64) -> np.ndarray[Any, Any]:
    """Times of a clock that falls back by most of a turn where a day, or a full hour, begins.

    The newest sample may come first: then most steps are back, and it jumps ahead there.
    """
    steps = 2 * np.diff(stamps)
    back = np.sum((-turn < steps) & (steps < 0 * turn)) + np.sum(steps > turn)
    way = -1 if back > steps.size / 2 else 1
    turns = np.cumsum(2 * np.diff(stamps[::way]) < -turn)
    return np.asarray((stamps[::way] + np.concatenate([[0], turns]) * turn)[::way])
