"""Measured records on a uniform time axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .._checks import check_finite, finite, numbers, one_of, positive, real, spelled_out
from .._shown import Card
from .._wording import ASSUMED, count_of, in_time, shown_unit, times_in
from ..errors import DataError, OptionError, TimeAxisError
from ..numerics.arrays import BoolArray, read_only
from ..numerics.signals.time_axis import axis_fault
from ..numerics.signals.time_axis import sample_time as mean_step
from .record_checks import axis_words, checked_reference, checked_signal, checked_units, labelled
from .record_conversions import RecordConversions
from .resampling import MIN_SAMPLES

MISSING = ("refuse", "keep")


class Record(RecordConversions):
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
        unit in which times are to be shown (`time` itself is in s): min, h or day; others are
        shown as s, ms or µs by size, ``"s (assumed)"`` with that word.
    missing : {"refuse", "keep"}, optional
        How NaN in `input` and `output` is treated. With ``"keep"`` they are missing samples:
        `identify`, `fit_output_error` and `impulse_from_io` use the outputs that there are; the
        scans and the step functions need complete records.
    reference : array_like, shape of the output, optional
        Set point of the controller, in the unit of the output; NaN where it is not in force,
        since the loop is in manual. Default: the record was not made in a loop, or nobody knows.
    sample_time : float, optional
        Time in s between two samples of the plant, where the time axis is finer than that, since
        the stamps are irregular (see `from_samples`): models of the record have it as their `dt`.
        Default: the step of the time axis.

    Attributes
    ----------
    dt : float
        Step of the time axis in s.
    n_samples, ninputs, noutputs : int
    irregular : bool
        Whether `sample_time` is longer than `dt`.
    n_missing : int
        Number of values of `input` and `output` that are NaN.

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
        "dt", "input", "input_labels", "missing", "name", "output", "output_labels", "reference",
        "sample_time", "time", "units",
    )  # fmt: skip

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
        reference: ArrayLike | None = None,
        sample_time: float | None = None,
    ) -> None:
        stamps = numbers(time, "time")
        if stamps.ndim != 1 or stamps.size < MIN_SAMPLES:
            raise DataError(
                f"time has shape {stamps.shape}; a record needs shape (N,) with N >= {MIN_SAMPLES}"
                + "; numpy.ravel makes one of a column" * (stamps.ndim == 2 and 1 in stamps.shape)
            )
        missing = one_of(missing, "missing", MISSING)
        u, y = (
            checked_signal(values, what, stamps.size, allow_nan=missing == "keep")
            for what, values in (("input", input), ("output", output))
        )
        check_finite(stamps, "time")
        fault = axis_fault(stamps)
        if fault is not None:
            raise TimeAxisError(
                f"{axis_words(fault)}; Record needs a uniform time axis: Record.from_samples(...) "
                "takes gaps and irregular samples as they are, Record.resampled(...) or "
                "read_record(..., resample=True) interpolates small jitter"
            )
        fix = object.__setattr__
        fix(self, "time", read_only(stamps))
        fix(self, "input", read_only(u))
        fix(self, "output", read_only(y))
        fix(self, "reference", checked_reference(reference, y))
        fix(self, "dt", mean_step(stamps))
        fix(self, "sample_time", self._longer(sample_time))
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
        return partial(Record, **self._arguments()), ()

    def __replace__(self, **changes: Any) -> Record:
        """Return a record with some arguments changed (`copy.replace`, from Python 3.13 on)."""
        return Record(**self._arguments() | changes)

    def _arguments(self) -> dict[str, Any]:
        names = ("time", "input", "output", "reference", "name", "input_labels", "output_labels")
        given = {name: getattr(self, name) for name in (*names, "missing")}
        usual = self.sample_time if self.irregular else None
        return given | {"units": dict(self.units), "sample_time": usual}

    def _longer(self, given: float | None) -> float:
        """Sample time that was given, which is not below a step of the time axis."""
        if given is None:
            return self.dt
        wanted = positive(given, "sample_time", "time in s between two samples")
        if wanted < (1 - 1e-6) * self.dt:
            raise OptionError(
                f"sample_time={wanted:g} s; expected at least the step of the time axis, "
                f"{self.dt:g} s"
            )
        return self.dt if wanted <= (1 + 1e-6) * self.dt else wanted

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        unit = ASSUMED if self.units.get("time") == ASSUMED else "s"
        on_axis = f"{self.n_samples} samples of {self.dt:g} {unit}"
        if self.irregular:
            on_axis = (
                f"{np.count_nonzero(self.seen)} samples about {self.sample_time:g} {unit} apart "
                f"(stamps to {self.dt:g} {unit})"
            )
        gaps = 0 if self.irregular else self.n_missing
        return (
            f"<Record{name}: {on_axis}, "
            f"{count_of(self.ninputs, 'input')}, {count_of(self.noutputs, 'output')}"
            + (", set point" if self.reference is not None else "")
            + (f", {count_of(gaps, 'missing value')}>" if gaps else ">")
        )

    def report(self) -> str:
        """Return samples, length and signals with units and ranges as plain text.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> units = {"u": "%", "y": "°C", "time": "min"}
        >>> print(cr.Record([0, 60, 120], [40, 50, 50], [180, 180, 183], units=units).report())
        Record
          samples   3 of 60 s, 2 min long
          input u   40 to 50 %
          output y  180 to 183 °C
        """
        return self._card().text()

    def _repr_html_(self) -> str:
        return self._card().html()

    def _card(self) -> Card:
        told = self.units.get("time", "s")
        step = f"{in_time(self.dt, 6)}" + " (assumed)" * (told == ASSUMED)
        with times_in(shown_unit(told)):
            length = in_time(float(self.time[-1] - self.time[0]), 4)
        rows = [("samples", f"{self.n_samples} of {step}, {length} long")]
        if self.irregular:
            many, usual = np.count_nonzero(self.seen), in_time(self.sample_time, 6)
            rows = [
                ("samples", f"{many} about {usual} apart, {length} long"),
                ("time axis", f"in steps of {step}, irregular stamps"),
            ]
        for kind, labels, units, values in (
            ("input", self.input_labels, self.input_units, self.input),
            ("output", self.output_labels, self.output_units, self.output),
            ("set point of", self.output_labels, self.output_units, self.reference),
        ):
            several = () if values is None else np.atleast_2d(values)
            for label, unit, row in zip(labels, units, several, strict=False):
                known = row[~np.isnan(row)]
                ends = f"{known.min():.4g} to {known.max():.4g}" if known.size else "missing"
                rows.append((f"{kind} {label}", f"{ends} {unit}".rstrip()))
        if self.n_missing and not self.irregular:
            rows.append(("missing", f"{self.n_missing} values"))
        return Card(f"Record {self.name}".rstrip(), rows)

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
        signals = {"input": self.input, "output": self.output, "reference": self.reference}
        kept = {name: one[..., inside] for name, one in signals.items() if one is not None}
        return self.__replace__(time=self.time[inside], **kept)

    def with_baseline(self, input: ArrayLike, output: ArrayLike) -> Record:
        """Return the record with one sample of the steady state in front of it.

        For a record that begins with its step: the input had the value `input` before, and the
        output had settled at `output`. A set point was what it is at first.

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
            level = finite(given, f"the baseline of the {what}")
            if level.size != np.atleast_2d(signal).shape[0]:
                raise DataError(
                    f"the baseline of the {what} has {level.size} values; expected one for each "
                    f"of the {np.atleast_2d(signal).shape[0]} signals"
                )
            levels.append(level.reshape(signal[..., :1].shape))
        aim = self.reference
        return self.__replace__(
            time=np.r_[self.time[0] - self.dt, self.time],
            input=np.concatenate([levels[0], self.input], axis=-1),
            output=np.concatenate([levels[1], self.output], axis=-1),
            reference=None if aim is None else np.concatenate([aim[..., :1], aim], axis=-1),
        )
