"""What an output-error fit found, and how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..numerics.arrays import ComplexArray, FloatArray
from ..results import Flag, Result
from ..signals import Record
from ..wording import in_time, interval_in_time, number_within, poles_in_words, time_within

_TOTAL_IN_DOUBT = frozenset(
    {
        "not_settled",
        "integrating",
        "gain_open",
        "cancelled_pair",
        "structured_misfit",
        "input_in_residual",
        "feedback",
        "not_linear",
        "time_varying",
        "output_at_limit",
        "earlier_input",
    }
)
"""Flags after which not even the total delay is firm."""


@dataclass(frozen=True)
class StructureRow:
    """One structure that was fitted: `order` poles, ``order - relative_degree`` zeros.

    `excess` is its information criterion above that of the best structure; up to 10 the data do
    not rule it out, and `interval` (s) is the 95 % profile-likelihood interval of its dead time
    (None where the structure is ruled out).
    """

    order: int
    relative_degree: int
    dead_time: float
    total_delay: float
    excess: float
    interval: tuple[float, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class DelayFit(Result):
    """Dead time and model from an output-error fit of raw records.

    ``interval[0] <= dead_time <= interval[1]`` and
    ``total_delay == dead_time + sum of the model's lags - sum of its leads``. The total is
    firm in every model; how it splits into dead time and lags is not, and `interval` says how
    far. The model is ``gain exp(-s dead_time)`` times a transfer function of unit gain with
    `poles` and `zeros`. What is firm is so where the record shows the response to its end, of one
    linear plant in open loop: flags say where it does not.

    Attributes
    ----------
    dead_time : float
        Transport delay of the model, in s.
    std_given_structure : float
        Standard error of the dead time in s if the chosen structure is the plant's (that of the
        spread of the views where the residual is not noise). It knows nothing of the doubt about
        the structure, which is mostly the larger part: `interval` does.
    interval : tuple of float
        95 % interval of the dead time in s: of all structures that the data cannot rule out
        where the residual is noise (and wider where a zero leaves the beginning open), of the
        views where it is not.
    onset : float
        First motion of the output after the input has moved, in s (NaN when it is no step).
    total_delay : float
        Delay at zero frequency in s; integrators are left out.
    order, relative_degree : int
        Of the model that was chosen.
    poles, zeros : ndarray of complex
        Of the continuous model, in rad/s.
    gain : float
        Of the model at zero frequency; of one with an integrator, the slope per second.
    at_noise_level : bool
        The residual is as small as the noise before the step.
    misfit : float
        Residual over noise, in means over bins of samples.
    noise, residual : float
        Standard deviations in the unit of the output.
    correlation : float
        Samples of the residual that one independent sample is worth.
    views : dict of str to float
        Dead time in s as seen in six ways, of which the last serves the interval only; empty
        where one model explains everything.
    structures : tuple of StructureRow
        Everything that was fitted, best first.
    profile_delay, profile_excess : ndarray
        Profile of the chosen structure: delay in s, chi-square above the minimum.
    time, measured, fitted : ndarray, shape (N,)
        The record that was fitted (the mean, for several) and the model's response to it.
    records : tuple of Record
        What was given.
    repeatability : Repeatability or None
        Delay of every record by itself, where there are several.
    dt : float
        Sample time in s.
    choices : tuple of str
        What was chosen, and why.
    flags : tuple of Flag
        What one should know before trusting the result.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(900)
    >>> u = np.where(t < 1.0, 0.0, 2.0)
    >>> y = np.where(t < 1.125, 0.0, 6 * -np.expm1(-(t - 1.125) / 0.4))
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(t.size)
    >>> fit = cr.fit_delay(cr.Record(t, u, y + noise), structures=[(1, 1)]).fit
    >>> print(f"{fit.dead_time:.4f} s, within {fit.interval[0]:.4f} to {fit.interval[1]:.4f} s")
    0.1250 s, within 0.1245 to 0.1254 s
    """

    dead_time: float
    std_given_structure: float
    interval: tuple[float, float]
    onset: float
    total_delay: float
    order: int
    relative_degree: int
    poles: ComplexArray
    zeros: ComplexArray
    gain: float
    at_noise_level: bool
    misfit: float
    noise: float
    residual: float
    correlation: float
    views: dict[str, float]
    structures: tuple[StructureRow, ...]
    profile_delay: FloatArray
    profile_excess: FloatArray
    time: FloatArray
    measured: FloatArray
    fitted: FloatArray
    dt: float
    records: tuple[Record, ...] = ()
    repeatability: Repeatability | None = None
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = field(default=())

    @property
    def delay(self) -> float:
        """Dead time in samples, not rounded."""
        return self.dead_time / self.dt

    @property
    def delay_interval(self) -> tuple[float, float]:
        """Interval of the dead time in samples."""
        return self.interval[0] / self.dt, self.interval[1] / self.dt

    @property
    def dead_time_interval(self) -> tuple[float, float]:
        """Interval of the dead time in s, the same as `interval`."""
        return self.interval

    @property
    def interval_label(self) -> str:
        """What `interval` is: a confidence interval only where one model leaves only noise."""
        return "95 % interval" if self.at_noise_level else "interval spanned by the views"

    @property
    def structure(self) -> tuple[int, int]:
        """Order and relative degree."""
        return self.order, self.relative_degree

    def __repr__(self) -> str:
        low, high = self.interval
        level = "noise" if self.at_noise_level else f"{self.misfit:.2g} x noise"
        return (
            f"<DelayFit {self.dead_time:.4g} s in {low:.4g}...{high:.4g} s, order {self.order}, "
            f"relative degree {self.relative_degree}, residual {level}>"
        )

    def _title(self) -> str:
        return f"Output-error fit: dead time {time_within(self.dead_time, *self.interval)}"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.interval
        wait = time_within(self.dead_time, low, high)
        samples = number_within(self.delay, *self.delay_interval)
        doubted = any(flag.code in _TOTAL_IN_DOUBT for flag in self.flags)
        parts = "dead time and lags" + ("" if doubted else ": firm")
        rows = [
            ("dead time", f"{wait} = {samples} samples"),
            (self.interval_label, interval_in_time(low, high)),
            *([("first motion", in_time(self.onset, 4))] if self.onset == self.onset else []),
            ("total delay", f"{in_time(self.total_delay, 5)} ({parts})"),
            ("model", f"order {self.order}, relative degree {self.relative_degree}"),
            ("poles", poles_in_words(self.poles)),
            ("gain", f"{self.gain:.6g}"),
            ("residual", f"{self.residual:.3g}, noise {self.noise:.3g} (misfit {self.misfit:.3g})"),
        ]
        rows += [(f"view: {name}", in_time(value, 4)) for name, value in self.views.items()]
        if self.repeatability is not None:
            rows += self.repeatability.rows()
        return rows


@dataclass(frozen=True, eq=False)
class Repeatability:
    """How much records of one plant differ, beyond the noise inside each.

    ``chi_square`` is the sum over the records of ((delay - weighted mean) / standard error)^2
    and `p_value` the chance of a larger one when records differ by noise alone.

    Attributes
    ----------
    names : tuple of str
        Of the records.
    amplitudes : ndarray, shape (R,)
        Height of the step of each, or how far its input goes from lowest to highest.
    delays, errors : ndarray, shape (R,)
        Delay of each against the common model, and its standard error from the noise, in s.
    gains : ndarray, shape (R,)
        Gain of each, over the common one.
    trend, trend_error : float
        Slope of the delays over the amplitudes, in s per unit of input.
    outlying : tuple of str
        Records that lie apart from the rest; they are not in the mean.
    """

    names: tuple[str, ...]
    amplitudes: FloatArray
    delays: FloatArray
    errors: FloatArray
    gains: FloatArray
    chi_square: float
    p_value: float
    trend: float
    trend_error: float
    outlying: tuple[str, ...]

    def rows(self) -> list[tuple[str, str]]:
        """List the numbers for a report."""
        scatter = float(self.delays.std(ddof=1)) if self.delays.size > 1 else 0.0
        rows = [
            ("records", f"{len(self.names)}, {len(self.outlying)} of them left out"),
            ("scatter of delays", f"{in_time(scatter)} between records"),
            (
                "chi-square",
                f"{self.chi_square:.3g} for {len(self.names) - 1} (p = {self.p_value:.2g})",
            ),
        ]
        if self.trend_error > 0:
            rows.append(
                ("trend over amplitude", f"{self.trend:.2g} +- {self.trend_error:.2g} s per unit")
            )
        return rows
