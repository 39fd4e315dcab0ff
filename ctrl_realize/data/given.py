"""Records as arguments: one or several, complete or with missing samples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..errors import DataError
from .frf import MeasuredFRF
from .record import Record


def as_record(given: Any) -> Record:
    """Return the argument if it is a record.

    Raises
    ------
    DataError
    """
    if not isinstance(given, Record):
        advice = ""
        if isinstance(given, MeasuredFRF):
            advice = "; fit_frf makes a model of a frequency response"
        elif hasattr(given, "columns") and hasattr(given, "index"):
            advice = "; Record.from_frame(frame, input=..., output=...) makes one of a table"
        raise DataError(
            "expected a Record, such as Record(time, input, output) or read_record(path), "
            f"got a {type(given).__name__}{advice}"
        )
    return given


def as_records(given: Any) -> tuple[Record, ...]:
    """Return one record or several as a tuple.

    Raises
    ------
    DataError
        There is none, or something else is among them.
    """
    if isinstance(given, Record):
        return (given,)
    several = tuple(given) if isinstance(given, Iterable) else (given,)
    if not several:
        raise DataError("no records; expected at least one Record")
    if not isinstance(given, list | tuple) and not isinstance(several[0], Record):
        # Text, an array or a table is reported as such, not by its letters, rows or columns.
        return (as_record(given),)
    return tuple(map(as_record, several))


def check_input(record: Record, task: str) -> None:
    """Refuse a record whose input has missing samples; those of its output may be missing.

    Raises
    ------
    DataError
        A value of the input is NaN.
    """
    missing = int(np.isnan(as_record(record).input).sum())
    if missing:
        raise DataError(
            f"{task} needs the input at every sample; missing samples in the input: {missing}. If "
            "it holds its last value, Record.from_samples(record.time, record.input, "
            "record.output) or read_record(..., missing='hold') fills them"
        )


def check_complete(record: Record, task: str) -> None:
    """Refuse a record with missing samples; `task` names the operation in the message.

    Raises
    ------
    DataError
        A value of input or output is NaN.
    """
    as_record(record)
    if record.irregular:
        raise DataError(
            f"{task} needs samples at equal distances; the stamps of this record are irregular. "
            "identify(record) and fit_output_error use them as they are; "
            "record.at_equal_distances() or read_record(..., resample=True) interpolates"
        )
    if record.missing == "keep" and record.n_missing:
        raise DataError(
            f"{task} needs complete data; missing samples in this record: {record.n_missing}. "
            "identify(record) and fit_output_error use the samples that there are; otherwise "
            "select a complete part with record.between(t0, t1), or interpolate"
        )
