"""Records from other objects and back: tables of pandas, responses of python-control, samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import check_type
from ..errors import DataError, TimeAxisError
from ..numerics.arrays import FloatArray
from ..results import Drawable
from .frames import frame_of_signals, signals_of_frame
from .irregular import on_one_axis
from .resampling import at_equal_distances, held_at, resampled

if TYPE_CHECKING:
    import pandas as pd


class RecordConversions(Drawable):
    """Constructors of a record, and what it can be converted to."""

    __slots__ = ()

    time: FloatArray
    input: FloatArray
    output: FloatArray
    reference: FloatArray | None
    name: str
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    dt: float
    sample_time: float

    if TYPE_CHECKING:

        def _arguments(self) -> dict[str, Any]: ...

        def __replace__(self, **changes: Any) -> Self: ...

        def __init__(self, time: Any, input: Any, output: Any, **labels: Any) -> None: ...

    @property
    def irregular(self) -> bool:
        """Whether the time axis is finer than the sample time, for stamps that are irregular."""
        return self.sample_time > self.dt

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        *,
        input: str | Sequence[str],
        output: str | Sequence[str],
        time: str | None = None,
        reference: str | Sequence[str] | None = None,
        **options: Any,
    ) -> Self:
        """Make a record from a pandas table.

        Parameters
        ----------
        frame : pandas.DataFrame
        input, output : str or sequence of str
            Columns of the signals; their names become the labels.
        time : str, optional
            Column of time; default: the index, unless it counts the rows. Dates (a
            `DatetimeIndex`) and durations are counted in s from the first row, numbers are s.
        reference : str or sequence of str, optional
            Columns of the set points, one for each output.
        **options
            Further arguments of `Record`. With ``missing="keep"``, missing values are kept, and
            rows that are missing or at irregular times, see `from_samples`.

        Raises
        ------
        OptionError
            The table has no such column, an index that counts its rows, or a time that its name
            says to be in another unit than s, such as ``time_ms``.
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
        labels: dict[str, Any] = {"input_labels": inputs, "output_labels": outputs}
        if reference is not None:
            labels["reference"] = signals_of_frame(frame, input, reference, time)[2]
        labels |= options
        try:
            return cls(*signals, **labels)
        except TimeAxisError as error:
            if np.any(np.diff(signals[0]) <= 0):
                raise
            if labels.get("missing") == "keep":
                return cls.from_samples(*signals, **labels)
            raise TimeAxisError(f"{error}; from_frame(..., missing='keep') does so") from None

    def to_frame(self, start: Any = None) -> pd.DataFrame:
        """Convert the record to a pandas table with a column for each signal.

        A set point is in the column ``reference``, or ``reference[0]``, ``reference[1]``, ...

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
        signals, labels = [self.input, self.output], [*self.input_labels, *self.output_labels]
        if self.reference is not None:
            signals.append(self.reference)
            many = len(self.output_labels)
            labels += [f"reference[{k}]" for k in range(many)] if many > 1 else ["reference"]
        rows = np.concatenate([np.atleast_2d(one) for one in signals])
        return frame_of_signals(self.time, rows, labels, start)

    @classmethod
    def resampled(
        cls,
        time: ArrayLike,
        input: ArrayLike,
        output: ArrayLike,
        *,
        dt: float | None = None,
        max_jitter: float = 0.5,
        reference: ArrayLike | None = None,
        **labels: Any,
    ) -> Self:
        """Make a record from samples with time jitter, by linear interpolation.

        An input that holds its levels (most of its values repeat the one before) is not
        interpolated: it has the value of the nearest time stamp, which moves its steps, and with
        them dead times, by up to half a sample. `from_samples` keeps the stamps.

        Parameters
        ----------
        time, input, output : array_like
            As for `Record`, but the time stamps only need to increase.
        dt : float, optional
            Sample time of the new axis in s; default: the mean step.
        max_jitter : float, optional
            Largest time step, as a relative excess over the median step; a longer step is a gap,
            across which the signals are not interpolated.
        reference : array_like, optional
            Set point at the time stamps; it holds its value from one to the next.
        **labels
            Further arguments of `Record`.

        Raises
        ------
        TimeAxisError
            Time that repeats or decreases, or a gap.
        """
        signals = resampled(time, input, output, dt, max_jitter)
        return cls(*signals, reference=held_at(time, reference, signals[0]), **labels)

    @classmethod
    def from_samples(
        cls,
        time: ArrayLike,
        input: ArrayLike,
        output: ArrayLike,
        *,
        input_time: ArrayLike | None = None,
        dt: float | None = None,
        reference: ArrayLike | None = None,
        **labels: Any,
    ) -> Self:
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
            stamps, or a fiftieth of the usual distance if that would be too fine; samples that are
            closer together are averaged.
        reference : array_like, optional
            Set point at the stamps of the output; it holds its value from one to the next.
        **labels
            Further arguments of `Record`.

        Returns
        -------
        Record
            With ``missing="keep"``. It starts with the first sample of the input. Its `sample_time`
            is the step of regular samples, some of which may be missing, otherwise the median
            distance of the outputs, as short a number as their jitter allows (1 s for stamps about
            1.001 s apart).

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
        signals, usual = on_one_axis(time, input, output, input_time, dt)
        # one that is a step of the axis is left to `Record`, which knows it without rounding
        labels = {"missing": "keep", "sample_time": usual, **labels}
        return cls(*signals, reference=held_at(time, reference, signals[0]), **labels)

    def at_equal_distances(self) -> Self:
        """Return a record of irregular samples at equal distances, `sample_time`, by interpolation.

        The output is interpolated linearly and missing in gaps, the input is its mean over a sample
        time. A record whose samples are regular is returned as it is.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> record = cr.Record.from_samples([0, 1.1, 2, 3.2, 4], [0, 0, 1, 1, 1], [5, 5, 5, 6, 7])
        >>> print(record.at_equal_distances().output.round(2))
        [5.   5.   5.   5.83 7.  ]
        """
        if not self.irregular:
            return self
        time, *signals = at_equal_distances(self.time, self.input, self.output, self.sample_time)
        reference = held_at(self.time, self.reference, time)
        return self.__replace__(
            time=time, input=signals[0], output=signals[1], reference=reference, sample_time=None
        )

    def on_axis(self, dt: float) -> Self:
        """Return the record with its samples on a time axis in steps of `dt`, the nearest to each.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> record = cr.Record([0, 1, 2], [0, 1, 1], [5, 5, 6]).on_axis(0.5)
        >>> record.dt, record.sample_time, record.output.tolist()
        (0.5, 1.0, [5.0, nan, 5.0, nan, 6.0])
        """
        seen = ~np.isnan(np.atleast_2d(self.output)).all(axis=0)
        labels = self._arguments()
        signals = [labels.pop(key) for key in ("time", "input", "output", "reference")]
        time, u, y, reference = signals
        return self.from_samples(
            time[seen], u, y[..., seen], input_time=time, dt=dt,
            reference=None if reference is None else reference[..., seen],
            **labels | {"missing": "keep", "sample_time": self.sample_time},
        )  # fmt: skip

    @classmethod
    def from_response(cls, response: ct.TimeResponseData, *, name: str | None = None) -> Self:
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
        check_type(response, ct.TimeResponseData, "response", "one of python-control")
        if response.inputs is None:
            raise DataError("the response has no input; simulate with ct.forced_response")
        u, y = response.u, response.y
        if response.issiso:
            u, y = np.ravel(u), np.ravel(y)
        for what, values in (("input", u), ("output", y)):
            if np.ndim(values) > 2:
                raise DataError(f"the {what} of the response has several traces; pass one of them")
        called = (response.sysname or "") if name is None else name
        labels = {"input_labels": response.input_labels, "output_labels": response.output_labels}
        return cls(response.time, u, y, name=called, **labels)

    def to_response(self) -> ct.TimeResponseData:
        """Convert the record to time-response data of python-control."""
        return ct.TimeResponseData(
            self.time,
            self.output,
            inputs=self.input,
            issiso=len(self.input_labels) == len(self.output_labels) == 1,
            sysname=self.name or "record",
            input_labels=list(self.input_labels),
            output_labels=list(self.output_labels),
        )
