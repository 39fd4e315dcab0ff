"""Records from and to pandas tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import DataError, OptionError
from ..numerics.arrays import FloatArray
from ..numerics.signals.counters import clock_unit

if TYPE_CHECKING:
    import pandas as pd


_NO_SECONDS = re.compile(r"[ _/(\[](ms|[uµμ]s|ns|min|minutes|h|hours|days?)[)\]]?$")
"""A name of a time that ends in another unit than s."""


def signals_of_frame(
    frame: Any, input: str | Sequence[str], output: str | Sequence[str], time: str | None
) -> tuple[FloatArray, FloatArray, FloatArray, list[str], list[str]]:
    """Time in s, input, output and their labels, from columns of a table."""
    import pandas as pd

    if not isinstance(frame, pd.DataFrame):
        kind, converts = type(frame).__name__, ""
        if hasattr(frame, "to_pandas"):
            kind = f"{type(frame).__module__.split('.')[0]} {kind}"
            converts = "; frame.to_pandas() converts it"
        raise DataError(f"expected a pandas DataFrame, got a {kind}{converts}")
    stamps = frame.index if time is None else _column(frame, time, "time")
    _refuse_others(stamps, frame)
    inputs, outputs = _labels(input, "input"), _labels(output, "output")
    u, y = _signals(frame, inputs, "input"), _signals(frame, outputs, "output")
    return _seconds(stamps), u, y, inputs, outputs


def frame_of_signals(
    time: FloatArray, signals: FloatArray, labels: Sequence[str], start: Any
) -> pd.DataFrame:
    """Table with one column for each signal and the time as index."""
    import pandas as pd

    index: Any = pd.Index(time, name="time")
    if start is not None:
        try:
            first = pd.Timestamp(start)
        except (ValueError, TypeError) as error:
            raise OptionError(f"start={start!r}; expected the date and time of time 0") from error
        index = pd.DatetimeIndex(first + pd.to_timedelta(time, unit="s"), name="time")
    return pd.DataFrame(signals.T, index=index, columns=list(labels))


def _labels(given: str | Sequence[str], name: str) -> list[str]:
    labels = [given] if isinstance(given, str) or not isinstance(given, Sequence) else list(given)
    if not labels:
        raise OptionError(f"{name}={given!r}; expected the name of a column, or several")
    return labels


def _signals(frame: pd.DataFrame, labels: list[str], argument: str) -> FloatArray:
    rows = np.stack([_numbers(_column(frame, label, argument), label) for label in labels])
    return rows[0] if len(rows) == 1 else rows


def _column(frame: pd.DataFrame, label: str, argument: str) -> Any:
    if label not in frame.columns:
        names = ", ".join(repr(name) for name in list(frame.columns)[:20])
        raise OptionError(f"{argument}={label!r}: the table has the columns {names}")
    column = frame[label]
    if column.ndim != 1:
        raise OptionError(f"{argument}={label!r} names {column.shape[1]} columns of the table")
    return column


def _numbers(column: pd.Series[Any], label: str) -> FloatArray:
    """Values of a column; missing ones of any kind are NaN."""
    try:
        return np.asarray(column.to_numpy(dtype=np.float64, na_value=np.nan))
    except (ValueError, TypeError) as error:
        raise DataError(
            f"column {label!r} holds {column.dtype} values that are not numbers ({error}); convert "
            "it, for instance with pandas.to_numeric(column, errors='coerce'), or column == 'ON' "
            "of a switch"
        ) from error


def _refuse_others(stamps: Any, frame: pd.DataFrame) -> None:
    """Refuse numbers that are no seconds: another unit in their name, or a count of the rows."""
    if stamps.dtype.kind not in "iuf":
        return
    named = _NO_SECONDS.search(str(stamps.name))
    unit = named[1] if named else clock_unit(np.asarray(stamps, dtype=np.float64))
    if unit != "":
        raise OptionError(
            f"the time of the table is {stamps.name!r}; numbers are seconds: convert and rename "
            f"{unit or 'them'} (such as {np.max(stamps):.14g}), or give dates or durations "
            "(pandas.to_timedelta)"
        )
    counts = stamps.name is None and stamps.dtype.kind != "f" and len(stamps) > 1
    if counts and np.median(np.diff(stamps)) == 1:
        names = ", ".join(repr(name) for name in list(frame.columns)[:20])
        raise OptionError(
            f"the index of the table counts its rows; give time=, one of its columns {names}, or "
            "an index in s, such as frame.set_axis(0.5 * np.arange(len(frame)))"
        )


def _seconds(stamps: Any) -> FloatArray:
    """Seconds of dates and durations since the first one; numbers are seconds."""
    import pandas as pd

    values: Any = pd.Index(stamps)
    if isinstance(values, pd.DatetimeIndex | pd.TimedeltaIndex):
        if values.hasnans:
            row = int(np.argmax(values.isna()))
            raise DataError(f"the time of row {row} of the table is missing")
        # differences first: they are exact, whatever the resolution of the stamps
        since: Any = (values - values[0]).to_numpy()
        return np.asarray(since / np.timedelta64(1, "ns") / 1e9)
    if values.dtype.kind not in "iuf":
        raise DataError(
            f"the time of the table holds {values.dtype} values; expected seconds or dates; "
            "convert it with pandas.to_datetime, or give time= with the name of a column"
        )
    return np.asarray(values.to_numpy(), dtype=np.float64)
