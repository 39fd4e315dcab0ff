"""Measured records on a uniform time axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import numbers, one_of, real, spelled_out
from ..errors import DataError, OptionError, TimeAxisError
from ..numerics.arrays import BoolArray, FloatArray, read_only
from ..numerics.signals.time_axis import axis_fault, sample_time
from ..results import Drawable
from .frames import frame_of_signals, signals_of_frame
from .irregular import on_one_axis
from .record_checks import (
    axis_words,
    check_finite,
    check_shape,
    check_size,
    checked_units,
    labelled,
)
from .resampling import MIN_SAMPLES, resampled

if TYPE_CHECKING:
    import pandas as pd

MISSING = ("refuse", "keep")


class Record(Drawable):
    """Measured input and output of a plant.

    Parameters
    ----------
    time : array_like, shape (N,)
        Time in s; uniform within 5 % of a sample (see `resampled` for more jitter).
    input, output : array_like, shape (N,) or (signals, N)
        Input and output, in any unit.
    name : str, optional
        Name in tables and plots.
    input_labels, output_labels : sequence of str, optional
        Names of the signals; default ``u`` and ``y`` (``u[0]``, ``u[1]``, ... for several).
    units : mapping of str to str, optional
        Unit of each signal by its label, such as ``{"u": "%", "y": "degC"}``; under ``"time"`` the
        unit in which times are to be shown (`time` itself is in s).
    missing : {"refuse", "keep"}, optional
        How NaN in `input` and `output` is treated. With ``"keep"`` they are missing samples:
        `identify`, `fit_output_error` and `impulse_from_io` use the outputs that there are; the
        scans and the step functions need complete records.

    Attributes
    ----------
    dt : float
        Sample time in s.
    n_samples, ninputs, noutputs : int
    n_missing : int
        True for samples of `input` and `output` that are NaN.

    Raises
    ------
    DataError
        Wrong shapes, fewer than three samples, text, values that are not finite.
    TimeAxisError
        Time that jitters, has gaps, repeats or decreases; the message gives the first bad row.

    Examples
    --------
    ``len(record)`` is the number of samples, ``record[t0:t1]`` the part between two times in s.

    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(500)
    >>> u = (t >= 1.0).astype(float)
    >>> record = cr.Record(t, u, 2 * u, name="bench", units={"u": "V", "y": "mm"})
    >>> record
    <Record 'bench': 500 samples of 0.01 s, 1 input, 1 output>
    >>> record.input_units, record.output_units, len(record[0.5:2])
    (('V',), ('mm',), 151)
    """

    __slots__ = (
        "dt",
        "input",
        "input_labels",
        "missing",
        "name",
        "output",
        "output_labels",
        "time",
        "units",
    )

    time: FloatArray
    input: FloatArray
    output: FloatArray
    dt: float
    name: str
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    missing: str
    units: Mapping[str, str]

    def __init__(
        self,
        time: ArrayLike,
        input: ArrayLike,
        output: ArrayLike,
        *,
        name: str = "",
        input_labels: Sequence[str] | None = None,
        output_labels: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        missing: Literal["refuse", "keep"] = "refuse",
    ) -> None:
        stamps = numbers(time, "time")
        if stamps.ndim != 1 or stamps.size < MIN_SAMPLES:
            raise DataError(
                f"time has shape {stamps.shape}; a record needs shape (N,) with N >= {MIN_SAMPLES}"
            )
        signals = {"input": numbers(input, "input"), "output": numbers(output, "output")}
        for what, values in signals.items():
            check_shape(values, what, stamps.size)
        check_finite(stamps, "time")
        missing = one_of(missing, "missing", MISSING)
        for what, values in signals.items():
            check_finite(values, what, allow_nan=missing == "keep")
            check_size(values, what)
        fault = axis_fault(stamps)
        if fault is not None:
            raise TimeAxisError(
                f"{axis_words(fault)}; Record needs a uniform time axis: Record.from_samples(...) "
                "takes gaps and irregular samples as they are, Record.resampled(...) or "
                "read_record(..., resample=True) interpolates small jitter"
            )
        fix = object.__setattr__
        fix(self, "time", read_only(stamps))
        fix(self, "input", read_only(signals["input"]))
        fix(self, "output", read_only(signals["output"]))
        fix(self, "dt", sample_time(stamps))
        fix(self, "name", spelled_out(str(name)))
        fix(self, "missing", str(missing))
        fix(self, "input_labels", labelled(input_labels, self.ninputs, "u", "input_labels"))
        fix(self, "output_labels", labelled(output_labels, self.noutputs, "y", "output_labels"))
        known = checked_units(units, (*self.input_labels, *self.output_labels))
        fix(self, "units", MappingProxyType(known))

    def __setattr__(self, attribute: str, value: Any) -> None:
        raise AttributeError(
            f"a Record cannot be modified; make a new one with another {attribute}"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (self.time, self.input, self.output, self._labels())

    def _labels(self) -> dict[str, Any]:
        """Arguments of a record besides its samples."""
        return {
            "name": self.name,
            "input_labels": self.input_labels,
            "output_labels": self.output_labels,
            "units": dict(self.units),
            "missing": self.missing,
        }

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        return (
            f"<Record{name}: {self.n_samples} samples of {self.dt:g} s, "
            f"{_count(self.ninputs, 'input')}, {_count(self.noutputs, 'output')}"
            + (f", {self.n_missing} missing values>" if self.n_missing else ">")
        )

    def __len__(self) -> int:
        return self.n_samples

    def __getitem__(self, part: slice) -> Record:
        if not isinstance(part, slice) or part.step is not None:  # type: ignore[redundant-expr]
            raise OptionError(
                f"record[{part!r}]; expected two times in s, such as record[10:60]; the samples "
                "are in record.time, record.input and record.output"
            )
        low = self.time[0] if part.start is None else real(part.start, "start", "time in s")
        high = self.time[-1] if part.stop is None else real(part.stop, "stop", "time in s")
        return self.between(low, high)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def ninputs(self) -> int:
        """Number of input signals."""
        return 1 if self.input.ndim == 1 else int(self.input.shape[0])

    @property
    def noutputs(self) -> int:
        """Number of output signals."""
        return 1 if self.output.ndim == 1 else int(self.output.shape[0])

    @property
    def n_missing(self) -> int:
        """Number of values of input and output that are NaN."""
        return int(np.isnan(self.input).sum() + np.isnan(self.output).sum())

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the input signals; empty where they are not known."""
        return tuple(self.units.get(label, "") for label in self.input_labels)

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the output signals; empty where they are not known."""
        return tuple(self.units.get(label, "") for label in self.output_labels)

    @property
    def seen(self) -> BoolArray:
        """Samples (N,) at which no output is missing."""
        return np.asarray(~np.isnan(np.atleast_2d(self.output)).any(axis=0))

    def issiso(self) -> bool:
        """Whether there is one input and one output."""
        return self.ninputs == 1 and self.noutputs == 1

    def between(self, start: float, stop: float) -> Record:
        """Return the samples with start <= time <= stop, in s.

        Raises
        ------
        DataError
            Fewer than three samples are left.
        """
        slack = 1e-9 * self.dt
        inside = (self.time >= start - slack) & (self.time <= stop + slack)
        if np.count_nonzero(inside) < MIN_SAMPLES:
            raise DataError(
                f"between {start:g} s and {stop:g} s there are {np.count_nonzero(inside)} "
                f"samples of the record, which covers {self.time[0]:g} s to {self.time[-1]:g} "
                f"s; at least {MIN_SAMPLES} are needed"
            )
        return Record(
            self.time[inside],
            self.input[..., inside],
            self.output[..., inside],
            **self._labels(),
        )

    def with_baseline(self, input: ArrayLike, output: ArrayLike) -> Record:
        """Return the record with one sample of the steady state in front of it.

        For a record that begins with its step: the input had the value `input` before, and the
        output had settled at `output`.

        Parameters
        ----------
        input, output : float or array_like, shape (signals,)
            Levels before the record.

        Raises
        ------
        DataError
            Not one number for each signal.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> record = cr.Record([0, 1, 2, 3], [5, 5, 5, 5], [20, 20, 21, 22]).with_baseline(0, 20)
        >>> print(record.time, record.input, record.output)
        [-1.  0.  1.  2.  3.] [0. 5. 5. 5. 5.] [20. 20. 20. 21. 22.]
        """
        levels = []
        for what, given, signal in (("input", input, self.input), ("output", output, self.output)):
            level = numbers(given, f"the baseline of the {what}")
            check_finite(np.atleast_1d(level), f"the baseline of the {what}")
            if level.size != np.atleast_2d(signal).shape[0]:
                raise DataError(
                    f"the baseline of the {what} has {level.size} values; expected one for each "
                    f"of the {np.atleast_2d(signal).shape[0]} signals"
                )
            levels.append(level.reshape(signal[..., :1].shape))
        return Record(
            np.r_[self.time[0] - self.dt, self.time],
            np.concatenate([levels[0], self.input], axis=-1),
            np.concatenate([levels[1], self.output], axis=-1),
            **self._labels(),
        )

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        *,
        input: str | Sequence[str],
        output: str | Sequence[str],
        time: str | None = None,
        **options: Any,
    ) -> Record:
        """Make a record from a pandas table.

        Parameters
        ----------
        frame : pandas.DataFrame
        input, output : str or sequence of str
            Columns of the signals; their names become the labels.
        time : str, optional
            Column of time; default: the index. Dates (a `DatetimeIndex`) and durations are
            counted in s from the first row, numbers are s.
        **options
            Further arguments of `Record`. With ``missing="keep"``, missing values are kept.

        Raises
        ------
        OptionError
            The table has no such column.
        DataError, TimeAxisError
            As for `Record`.

        Examples
        --------
        >>> import pandas as pd
        >>> import ctrl_realize as cr
        >>> when = pd.date_range("2025-02-01 08:15", periods=5, freq="10s")
        >>> frame = pd.DataFrame({"OP": [0, 0, 1, 1, 1], "PV": [5.0, 5, 5, 6, 7]}, index=when)
        >>> cr.Record.from_frame(frame, input="OP", output="PV").dt
        10.0
        """
        *signals, inputs, outputs = signals_of_frame(frame, input, output, time)
        labels = {"input_labels": inputs, "output_labels": outputs}
        return cls(*signals, **labels | options)

    def to_frame(self, start: Any = None) -> pd.DataFrame:
        """Convert the record to a pandas table with a column for each signal.

        Parameters
        ----------
        start : str, datetime or pandas.Timestamp, optional
            Date and time of time 0. The index is then a `DatetimeIndex`; default: time in s.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> print(cr.Record([0, 1, 2], [0, 1, 1], [5, 5, 6]).to_frame())
                u    y
        time
        0.0   0.0  5.0
        1.0   1.0  5.0
        2.0   1.0  6.0
        """
        rows = np.concatenate([np.atleast_2d(self.input), np.atleast_2d(self.output)])
        return frame_of_signals(self.time, rows, (*self.input_labels, *self.output_labels), start)

    @classmethod
    def resampled(
        cls,
        time: ArrayLike,
        input: ArrayLike,
        output: ArrayLike,
        *,
        dt: float | None = None,
        max_jitter: float = 0.5,
        **labels: Any,
    ) -> Record:
        """Make a record from samples with time jitter, by linear interpolation.

        An input that holds its levels (most of its values repeat the one before) is not
        interpolated: it has the value of the nearest time stamp.

        Parameters
        ----------
        time, input, output : array_like
            As for `Record`, but the time stamps only need to increase.
        dt : float, optional
            Sample time of the new axis in s; default: the mean step.
        max_jitter : float, optional
            Largest time step, as a relative excess over the median step; a longer step is a gap,
            across which the signals are not interpolated.
        **labels
            Further arguments of `Record`.

        Raises
        ------
        TimeAxisError
            Time that repeats or decreases, or a gap.
        """
        return cls(*resampled(time, input, output, dt, max_jitter), **labels)

    @classmethod
    def from_samples(
        cls,
        time: ArrayLike,
        input: ArrayLike,
        output: ArrayLike,
        *,
        input_time: ArrayLike | None = None,
        dt: float | None = None,
        **labels: Any,
    ) -> Record:
        """Make a record from samples with gaps or irregular time stamps, without interpolation.

        The time axis is a uniform grid on which each sample has its own row. The output is NaN
        (missing) in rows without a sample, the input holds its last value.

        Parameters
        ----------
        time, input, output : array_like
            As for `Record`, but the time stamps only need to increase. NaN in the output is
            missing; where the input is NaN it holds its last value.
        input_time : array_like, optional
            Time stamps of the input in s, if they are others than those of the output: a fast
            input with a slow output, or an input that is stored when it changes.
        dt : float, optional
            Step of the grid in s; each sample goes to the nearest row. Default: regular samples
            keep their step; otherwise the greatest common divisor of the distances between the
            stamps, or a fiftieth of the usual distance if that would be too fine.
        **labels
            Further arguments of `Record`.

        Returns
        -------
        Record
            With ``missing="keep"``. It starts with the first sample of the input.

        Raises
        ------
        TimeAxisError
            Time that repeats or decreases, or two samples in one step.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> record = cr.Record.from_samples([0, 10, 30, 40], [0, 0, 1, 1], [5, 5, 5, 6])
        >>> record.dt, record.input.tolist(), record.output.tolist()
        (10.0, [0.0, 0.0, 0.0, 1.0, 1.0], [5.0, 5.0, nan, 5.0, 6.0])
        """
        labels = {"missing": "keep", **labels}
        return cls(*on_one_axis(time, input, output, input_time, dt), **labels)

    @classmethod
    def from_response(cls, response: ct.TimeResponseData, *, name: str | None = None) -> Record:
        """Make a record from a simulated response of python-control that includes its input.

        Examples
        --------
        >>> import control as ct
        >>> import numpy as np
        >>> import ctrl_realize as cr
        >>> plant = ct.tf([1], [1, -0.9], 0.1)
        >>> response = ct.forced_response(plant, 0.1 * np.arange(50), np.ones(50))
        >>> cr.Record.from_response(response).dt
        0.1
        """
        if response.inputs is None:
            raise DataError("the response has no input; simulate with ct.forced_response")
        many = {} if response.issiso else {"input": response.u, "output": response.y}
        for what, values in many.items():
            if np.ndim(values) > 2:
                raise DataError(f"the {what} of the response has several traces; pass one of them")
        return cls(
            response.time,
            many.get("input", np.ravel(response.u)),
            many.get("output", np.ravel(response.y)),
            name=(response.sysname or "") if name is None else name,
            input_labels=response.input_labels,
            output_labels=response.output_labels,
        )

    def to_response(self) -> ct.TimeResponseData:
        """Convert the record to time-response data of python-control."""
        return ct.TimeResponseData(
            self.time,
            self.output,
            inputs=self.input,
            issiso=self.issiso(),
            sysname=self.name or "record",
            input_labels=list(self.input_labels),
            output_labels=list(self.output_labels),
        )


def _rebuild(
    time: FloatArray, input: FloatArray, output: FloatArray, labels: dict[str, Any]
) -> Record:
    return Record(time, input, output, **labels)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
