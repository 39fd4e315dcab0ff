"""Records as arguments: one or several, complete or with missing samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
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
    """Return one record or several as a tuple; see `each_record`."""
    return tuple(each_record(given))


def each_record(given: Any) -> Iterator[Record]:
    """Yield one record or several: what a generator makes need not fit into memory together.

    Raises
    ------
    DataError
        There is none, or something else is among them.
    """
    if isinstance(given, Record) or not isinstance(given, Iterable):
        yield as_record(given)
        return
    one = None
    for one in given:
        if not isinstance(given, list | tuple) and not isinstance(one, Record):
            # Text, an array or a table is reported as such, not by its letters, rows or columns.
            as_record(given)
        yield as_record(one)
    if one is None:
        raise DataError("no records; expected at least one Record")


def records_alike(given: Any) -> Iterator[Record]:
    """Yield records as `each_record` does, if sample time and channels are those of the first.

    Raises
    ------
    DataError
        Others, or as `each_record`.
    """
    first: Record | None = None
    for i, record in enumerate(each_record(given)):
        first = record if first is None else first
        if not np.isclose(record.dt, first.dt, rtol=1e-3, atol=0):
            raise DataError(
                f"record {i} has the sample time {record.dt:g} s, the first one {first.dt:g} s; "
                "resample one of them"
            )
        if (record.ninputs, record.noutputs) != (first.ninputs, first.noutputs):
            raise DataError(
                f"record {i} has {record.ninputs} inputs and {record.noutputs} outputs, the "
                f"first one {first.ninputs} and {first.noutputs}"
            )
        yield record


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
            f"{task} needs complete data; missing samples in this record: {record.n_missing}; "
            "identify(record) and fit_output_error use the samples that there are; otherwise "
            "select a complete part with record.between(t0, t1), or interpolate"
        )


def check_inputs_move(records: Sequence[Record]) -> None:
    """Refuse records in which an input is constant.

    Raises
    ------
    DataError
    """
    ranges = np.max([np.ptp(np.atleast_2d(one.input), axis=1) for one in records], axis=0)
    if not ranges.all():
        way = "; leave it out of the record" if ranges.any() else ": there is nothing to fit"
        raise DataError(f"the input {records[0].input_labels[ranges.argmin()]!r} is constant{way}")
