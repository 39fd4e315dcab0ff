"""Common base of all results: a card in a notebook, the same card as text, a plot.

A result is a frozen dataclass. It has a title (`_heading`, or `_title` where the title depends on
the numbers) and lists its numbers with their units (`_rows`); it may have `choices`, what was
chosen automatically and why, and `flags`, warnings about the result.
"""

from __future__ import annotations

from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from ._flags import Flag, in_doubt
from ._parameters import Parameter, checked_time_unit, formula, parameter_table
from ._shown import Card
from ._wording import ASSUMED, chosen, in_time, shown_unit, times_in

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "INTERVAL_LABELS", "Drawable", "Flag", "FractionalDelayFit", "IntervalKind", "ModelFit",
    "Parameter", "Result",
]  # fmt: skip

IntervalKind = Literal["confidence", "conditional", "spanned", "flatness", "plausible", "tracked"]
"""Kinds of intervals of a dead time; see `ModelFit`."""
INTERVAL_LABELS: dict[IntervalKind | None, str] = {
    "confidence": "95 % interval",
    "conditional": "95 % interval if the structure is right",
    "spanned": "range of the delay estimates",
    "flatness": "within 5 % of the smallest IAE",
    "plausible": "dead times not ruled out",
    "tracked": "95 % interval within the memory",
    None: "95 % interval",
}
_SAID = f"time in {ASSUMED}: the file names no unit; time_unit= says which it is"


class Drawable:
    """Base of everything that has a plot in `ctrl_realize.plots`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.results import Drawable
    >>> issubclass(cr.Record, Drawable)
    True
    """

    __slots__ = ()

    def plot(self, **kwargs: Any) -> Any:
        """Draw the object; returns a `control.ControlPlot`.

        Keyword arguments are those of the function of `ctrl_realize.plots` for this kind of object.
        """
        # The only upward import in the layers: plots are imported on demand, so that computing
        # needs no matplotlib.
        return import_module("ctrl_realize.plots").draw(self, **kwargs)


class Result(Drawable):
    """Base class of all results: `report`, `plot` and the card shown by a notebook.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from ctrl_realize.results import Result
    >>> @dataclass(frozen=True)
    ... class Weight(Result):
    ...     kilograms: float
    ...     def _rows(self):
    ...         return [("mass", f"{self.kilograms:g} kg")]
    >>> print(Weight(4.2).report())
    Weight
      mass  4.2 kg
    """

    if TYPE_CHECKING:
        # A subclass may define these as fields of a dataclass or as properties.
        @property
        def choices(self) -> tuple[str, ...]:
            """Choices that were made automatically, with reasons."""

        @property
        def flags(self) -> tuple[Flag, ...]:
            """Warnings about the result."""

    else:
        choices = ()
        flags = ()
    _heading = ""

    def __init_subclass__(cls, **settings: Any) -> None:
        """Write times in the unit of the result in one line as on its card."""
        super().__init_subclass__(**settings)
        if own := vars(cls).get("__repr__"):

            @wraps(own)
            def shown(self: Result) -> str:
                with times_in(getattr(self, "time_unit", None)):
                    return str(own(self))

            cls.__repr__ = shown  # type: ignore[method-assign, assignment]

    def _title(self) -> str:
        return self._heading or type(self).__name__

    def _rows(self) -> list[tuple[str, str]]:
        raise AssertionError(f"{type(self).__name__} does not list its numbers")

    def _choices(self) -> list[str]:
        return list(self.choices)

    def _notes(self) -> list[str]:
        return [str(flag) for flag in self.flags]

    def _card(self) -> Card:
        return Card(self._title(), self._rows(), self._choices(), self._notes())

    def report(self) -> str:
        """Return the result as plain text, choices and flags included."""
        with times_in(getattr(self, "time_unit", None)):
            return self._card().text()

    def _repr_html_(self) -> str:
        with times_in(getattr(self, "time_unit", None)):
            return self._card().html()


class ModelFit(Result):
    """How a model was found: the common attributes of all estimation results.

    This is the type of `fit` of a `DelayedStateSpace`. Times are in s, delays in samples; None if
    the method does not estimate a quantity. Otherwise ``interval[0] <= dead_time <= interval[1]``
    and ``delay == dead_time / dt``, up to the rounding of some methods to whole samples.

    Attributes
    ----------
    dead_time : float or None
    interval : tuple of float, or None
        Of the dead time; `dead_time_interval` is the same, or None if it is not reliable.
    interval_kind : str or None
        Kind of `interval`. ``"confidence"``: a 95 % interval. ``"conditional"``: a 95 % interval if
        the requested order or structure is right. ``"spanned"``: the range
        of several estimates, if no model fits down to the noise level. ``"flatness"``: delays
        within 5 % of the smallest IAE. ``"plausible"``: dead times that are not ruled out, without
        a probability. ``"tracked"``: for the samples within the forgetting time of a tracker.
    interval_label : str
        The same in words.
    delay : float or None
    delay_interval : tuple of float, or None
    total_delay : float or None
        Delay at zero frequency: dead time plus lags.
    total_delay_interval : tuple of float, or None
        95 % interval.
    onset : float or None
        Visible onset of the response after a step of the input; NaN if the input is not a step.
    order : int or None
        Number of states of the core.
    gain : float or None
        At zero frequency.
    gain_interval : tuple of float, or None
        95 % interval.
    gain_std_given_structure : float or None
        Standard error for the chosen structure.
    residual_std : float or None
        Standard deviation of the residual; None for several outputs.
    parameters : tuple of Parameter
        Gain, dead time, lags, ... of the model as a process model, times in s; empty if the method
        does not estimate them. `parameter_table` has them as a table.
    formula : str
        The transfer function in one line, in seconds, the gain with its standard error; its times
        follow in `time_unit`, if that is another one. Empty without `parameters`.
    time_unit : str
        In which results are written: ``"min"``, ``"h"`` or ``"day"``, if the records have it, or
        ``"s"``; seconds are written as s, ms or µs by size.
    input_unit, output_unit : str
        Of the signals; empty if they are not known.
    actuator : ActuatorFit or None
        Actuator that was estimated with the model, which is the linear part.
    sampling : str or None
        Sampling of the impulse response that the model was realized from.
    records : tuple of Record
        Records that were fitted; empty if there were none.
    choices : tuple of str
    flags : tuple of Flag

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> fit = cr.identify(cr.bench.valve().step_record(16, rng=5), method="scan").fit
    >>> isinstance(fit, cr.results.ModelFit), fit.interval_kind
    (True, 'flatness')
    """

    if TYPE_CHECKING:
        # Every subclass defines these, mostly as dataclass fields, which cannot override
        # properties that exist at run time.
        @property
        def dead_time(self) -> float | None:
            """Dead time in s."""

        @property
        def interval(self) -> tuple[float, float] | None:
            """Interval of the dead time in s."""

        @property
        def delay(self) -> float | None:
            """Dead time in samples."""

        @property
        def delay_interval(self) -> tuple[float, float] | None:
            """Interval of the dead time in samples."""

        @property
        def order(self) -> int | None:
            """Number of states of the core."""

        @property
        def records(self) -> tuple[Any, ...]:
            """Records that were fitted."""

        @property
        def _method(self) -> str:
            """Name of the method, in words."""

    else:
        _method = "model with dead time"
    _answered_noise = False
    """Whether noise is so slow that a controller answers it: lags are then taken for dead time."""

    @property
    def dead_time_interval(self) -> tuple[float, float] | None:
        """Interval of the dead time in s, the same as `interval`."""
        return self.interval

    @property
    def interval_kind(self) -> IntervalKind | None:
        """Kind of `interval`, as a key."""
        return None

    @property
    def interval_label(self) -> str:
        """Kind of `interval`, in words."""
        return INTERVAL_LABELS[self.interval_kind]

    @property
    def total_delay(self) -> float | None:
        """Delay at zero frequency in s."""
        return None

    @property
    def total_delay_interval(self) -> tuple[float, float] | None:
        """95 % interval of the total delay in s."""
        return None

    @property
    def onset(self) -> float | None:
        """Visible onset of the response after a step of the input, in s."""
        return None

    @property
    def gain(self) -> float | None:
        """Gain at zero frequency."""
        return None

    @property
    def gain_interval(self) -> tuple[float, float] | None:
        """95 % interval of the gain."""
        return None

    @property
    def gain_std_given_structure(self) -> float | None:
        """Standard error of the gain for the chosen structure."""
        return None

    @property
    def residual_std(self) -> float | None:
        """Standard deviation of the residual; None for several outputs."""
        return None

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the model as a process model, with standard errors; times in s."""
        return ()

    @property
    def plausible_models(self) -> Any:
        """Models that the data do not rule out, `PlausibleModels`; None if they are not drawn."""
        return None

    @property
    def verdicts(self) -> tuple[Any, ...]:
        """Whether dead time and gain are known, and the model fits tuning; empty if not judged."""
        return ()

    @property
    def _judged(self) -> bool:
        """Whether there are verdicts, or would be but for an actuator: other flags are notes."""
        return bool(self.verdicts) or self.actuator is not None

    @property
    def integrators(self) -> int:
        """Number of poles at zero."""
        return 0

    @property
    def actuator(self) -> Any:
        """Actuator that was estimated with the model, an `ActuatorFit`; None if there is none."""
        return None

    @property
    def time_unit(self) -> str:
        """Unit of time in which results are written: min, h or day of the records, otherwise s."""
        return shown_unit(self._record_unit)

    @property
    def _record_unit(self) -> str:
        """Unit of time of the records."""
        return str(self.records[0].units.get("time", "s")) if self.records else "s"

    @property
    def input_unit(self) -> str:
        """Unit of the input; empty if it is not known, or there are several inputs."""
        return _common(self.records[0].input_units) if self.records else ""

    @property
    def output_unit(self) -> str:
        """Unit of the output; empty if it is not known, or there are several outputs."""
        return _common(self.records[0].output_units) if self.records else ""

    def _of_clock(self) -> list[str]:
        """What was chosen about the time axis of the records."""
        said = [_SAID] * (self._record_unit == ASSUMED)
        if self.records and self.records[0].irregular:
            said.append(chosen("sample_time.irregular", usual=in_time(self.records[0].sample_time)))
        return said

    def _choices(self) -> list[str]:
        notes = [f"note: {flag}" for flag in self.flags if self._judged and not in_doubt(flag)]
        return [*self.choices, *self._of_clock(), *notes]

    def _notes(self) -> list[str]:
        return [str(flag) for flag in self.flags if not self._judged or in_doubt(flag)]

    def report(self, *, time_unit: str | None = None) -> str:
        """Return the result as plain text, choices and flags included.

        Parameters
        ----------
        time_unit : {"ms", "s", "min", "h", "day"}, optional
            Of its rows. Default: `time_unit` of the fit.

        Raises
        ------
        OptionError
            Another unit of time.
        """
        unit = self.time_unit if time_unit is None else checked_time_unit(time_unit)
        with times_in(unit):
            return self._card().text()

    @property
    def formula(self) -> str:
        """The transfer function in one line, in seconds; empty without `parameters`."""
        return formula(self.parameters, self.integrators, self.time_unit)

    def parameter_table(self, *, time_unit: str | None = None) -> pd.DataFrame:
        """List the parameters with standard errors and 95 % intervals.

        Parameters
        ----------
        time_unit : {"ms", "s", "min", "h", "day"}, optional
            Default: `time_unit` of the fit.

        Returns
        -------
        pandas.DataFrame
            One row for each of `parameters`, see `Parameter`.

        Raises
        ------
        OptionError
            Another unit of time.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> record = cr.bench.valve().step_record(16, rng=5)
        >>> fit = cr.fit_output_error(record, structures=[(1, 1)]).fit
        >>> table = fit.parameter_table(time_unit="ms")
        >>> print(f"{table.loc['lag_1', 'value']:.1f} {table.loc['lag_1', 'unit']}")
        72.5 ms
        """
        unit = self.time_unit if time_unit is None else checked_time_unit(time_unit)
        return parameter_table([one.in_time_unit(unit) for one in self.parameters])

    @property
    def sampling(self) -> str | None:
        """Sampling of the impulse response that the model was realized from."""
        return None


def _common(units: tuple[str, ...]) -> str:
    return units[0] if len(units) == 1 else ""


class FractionalDelayFit(ModelFit):
    """Fit of a continuous dead time in s; `delay` and `delay_interval` are the same in samples.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> fit = cr.identify(record, structures=[(3, 3)]).fit
    >>> isinstance(fit, cr.results.FractionalDelayFit), fit.delay == fit.dead_time / fit.dt
    (True, True)
    """

    if TYPE_CHECKING:

        @property
        def dead_time(self) -> float:
            """Dead time in s."""

        @property
        def interval(self) -> tuple[float, float]:
            """Interval of the dead time in s."""

        @property
        def dt(self) -> float:
            """Sample time in s."""

    @property
    def delay(self) -> float:
        """Dead time in samples, not rounded."""
        return self.dead_time / self.dt

    @property
    def delay_interval(self) -> tuple[float, float]:
        """Interval of the dead time in samples."""
        return self.interval[0] / self.dt, self.interval[1] / self.dt


def __dir__() -> list[str]:
    return __all__
