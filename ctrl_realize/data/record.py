"""Measured records on a uniform time axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import numbers, one_of, spelled_out
from ..errors import DataError, TimeAxisError
from ..numerics.arrays import FloatArray, read_only
from ..numerics.signals.time_axis import axis_fault, sample_time
from ..results import Drawable
from .irregular import on_one_axis
from .record_checks import axis_words, check_finite, check_shape, check_size, labelled
from .resampling import MIN_SAMPLES, resampled

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
    missing : {"refuse", "keep"}, optional
        How NaN in `input` and `output` is treated. With ``"keep"`` they are missing samples, which
        `impulse_from_io` can handle; the step functions need complete records.

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
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(500)
    >>> u = (t >= 1.0).astype(float)
    >>> cr.Record(t, u, 2 * u, name="bench")
    <Record 'bench': 500 samples of 0.01 s, 1 input, 1 output>
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
    )

    time: FloatArray
    input: FloatArray
    output: FloatArray
    dt: float
    name: str
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    missing: str

    def __init__(
        self,
        time: ArrayLike,
        input: ArrayLike,
        output: ArrayLike,
        *,
        name: str = "",
        input_labels: Sequence[str] | None = None,
        output_labels: Sequence[str] | None = None,
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

    def __setattr__(self, attribute: str, value: Any) -> None:
        raise AttributeError(
            f"a Record cannot be modified; make a new one with another {attribute}"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return (
            _rebuild,
            (
                self.time,
                self.input,
                self.output,
                self.name,
                self.input_labels,
                self.output_labels,
                self.missing,
            ),
        )

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        return (
            f"<Record{name}: {self.n_samples} samples of {self.dt:g} s, "
            f"{_count(self.ninputs, 'input')}, {_count(self.noutputs, 'output')}>"
        )

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
            name=self.name,
            input_labels=self.input_labels,
            output_labels=self.output_labels,
            missing="keep" if self.missing == "keep" else "refuse",
        )

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
    time: FloatArray,
    input: FloatArray,
    output: FloatArray,
    name: str,
    input_labels: tuple[str, ...],
    output_labels: tuple[str, ...],
    missing: Literal["refuse", "keep"],
) -> Record:
    return Record(
        time,
        input,
        output,
        name=name,
        input_labels=input_labels,
        output_labels=output_labels,
        missing=missing,
    )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
