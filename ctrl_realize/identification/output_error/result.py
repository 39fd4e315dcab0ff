"""What an output-error fit found, and how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._wording import (
    in_time,
    interval_in_time,
    number_within,
    numbers_alike,
    poles_in_words,
    time_within,
)
from ...data import Record
from ...numerics.arrays import ComplexArray, FloatArray
from ...results import Flag, Result
from .repeatability import Repeatability

_FIRM = 0.1  # part of a total delay up to which an interval on either side makes it firm

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

    `delta_bic` is its information criterion above that of the best structure; up to 10 the data do
    not rule it out, and `interval` (s) is the 95 % profile-likelihood interval of its dead time
    (None where the structure is ruled out).
    """

    order: int
    relative_degree: int
    dead_time: float
    total_delay: float
    delta_bic: float
    interval: tuple[float, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class OutputErrorFit(Result):
    """Dead time and model from an output-error fit of raw records.

    ``interval[0] <= dead_time <= interval[1]`` and
    ``total_delay == dead_time + sum of the model's lags - sum of its leads``. The total is
    mostly known better than how it splits into dead time and lags; `total_delay_interval` and
    `interval` say how far. The model is ``gain exp(-s dead_time)`` times a transfer function of
    unit gain with `poles` and `zeros`. What is called firm is so where the
    record shows the response to its end, of one linear plant in open loop: flags say where it does
    not.

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
    total_delay_interval : tuple of float
        95 % interval of the total delay in s, if the residual is noise; without end where the
        record does not resolve it. Called firm where it reaches a tenth of it to either side.
    order, relative_degree : int
        Of the model that was chosen.
    poles, zeros : ndarray of complex
        Of the continuous model, in rad/s.
    gain : float
        Of the model at zero frequency; of one with an integrator, the slope per second.
    gain_std_given_structure : float
        Standard error of the gain if the chosen structure is the plant's.
    gain_interval : tuple of float
        95 % interval of the gain: of the structures that the data cannot rule out, if the residual
        is noise; of the records too, where their gains differ. Without end where the record is
        shorter than the slowest time constant and does not resolve the gain.
    at_noise_level : bool
        The residual is as small as the noise before the step.
    normalized_rms : float
        Residual over noise, in means over bins of samples.
    noise, residual : float
        Standard deviations in the unit of the output.
    correlation : float
        Samples of the residual that one independent sample is worth.
    delay_estimates : dict of str to float
        Dead time in s as seen in six ways, of which the last serves the interval only; empty
        where one model explains everything.
    structures : tuple of StructureRow
        Everything that was fitted, best first.
    profile_delay, profile_deviance : ndarray
        Profile of the chosen structure: delay in s, chi-square above the minimum.
    time, measured, fitted : ndarray, shape (N,)
        The record that was fitted (the mean, for several) and the model's response to it.
    records : tuple of Record
        What was given.
    repeatability : Repeatability or None
        Delay of every record by itself, where there are several.
    dt : float
        Sample time in s.
    better : StructureRow or None
        Where structures were asked for, and are ruled out: the structure that does it, `delta_bic`
        below them. The dead time is then an apparent one, with the lags that the model lacks in it.
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
    >>> fit = cr.fit_output_error(cr.Record(t, u, y + noise), structures=[(1, 1)]).fit
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
    normalized_rms: float
    noise: float
    residual: float
    correlation: float
    delay_estimates: dict[str, float]
    structures: tuple[StructureRow, ...]
    profile_delay: FloatArray
    profile_deviance: FloatArray
    time: FloatArray
    measured: FloatArray
    fitted: FloatArray
    dt: float
    records: tuple[Record, ...] = ()
    repeatability: Repeatability | None = None
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = field(default=())
    gain_std_given_structure: float = float("nan")
    gain_interval: tuple[float, float] = (float("nan"), float("nan"))
    total_delay_interval: tuple[float, float] = (float("nan"), float("nan"))
    better: StructureRow | None = None

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
        if self.better is not None:
            return "95 % interval if the structure is right"
        return "95 % interval" if self.at_noise_level else "range of the delay estimates"

    @property
    def structure(self) -> tuple[int, int]:
        """Order and relative degree."""
        return self.order, self.relative_degree

    def __repr__(self) -> str:
        low, high = self.interval
        level = "noise" if self.at_noise_level else f"{self.normalized_rms:.2g} x noise"
        return (
            f"<OutputErrorFit {self.dead_time:.4g} s in {low:.4g}...{high:.4g} s, "
            f"order {self.order}, "
            f"relative degree {self.relative_degree}, residual {level}>"
        )

    def _kind(self) -> str:
        return "dead time" if self.better is None else "apparent dead time"

    def _total_in_words(self) -> str:
        low, high = self.total_delay_interval
        if high == np.inf:
            return "not determined: the record is much shorter than the slowest time constant"
        if np.isnan(high):
            return f"{in_time(self.total_delay, 5)} (dead time plus lags)"
        doubted = any(flag.code in _TOTAL_IN_DOUBT for flag in self.flags)
        if not doubted and is_firm(self.total_delay, self.total_delay_interval):
            said = time_within(self.total_delay, low, high)
            return f"{said} (dead time plus lags; well determined, {interval_in_time(low, high)})"
        said = time_within(self.total_delay, low, high)
        return f"{said} (dead time plus lags; {interval_in_time(low, high)})"

    def _title(self) -> str:
        return f"Output-error fit: {self._kind()} {time_within(self.dead_time, *self.interval)}"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.interval
        wait = time_within(self.dead_time, low, high)
        samples = number_within(self.delay, *self.delay_interval)
        rows = [
            (self._kind(), f"{wait} = {samples} samples"),
            (self.interval_label, interval_in_time(low, high)),
            *([("visible onset", in_time(self.onset, 4))] if self.onset == self.onset else []),
            ("total delay", self._total_in_words()),
            ("model", f"order {self.order}, relative degree {self.relative_degree}"),
            ("poles", poles_in_words(self.poles)),
            ("gain", gain_in_words(self.gain, self.gain_interval)),
            (
                "residual",
                f"{self.residual:.3g}, noise {self.noise:.3g} "
                f"(normalised rms {self.normalized_rms:.3g})",
            ),
        ]
        rows += [
            (f"delay estimate: {name}", in_time(value, 4))
            for name, value in self.delay_estimates.items()
        ]
        if self.repeatability is not None:
            rows += self.repeatability.rows()
        return rows


def is_firm(value: float, interval: tuple[float, float]) -> bool:
    """Whether an interval reaches a tenth of the estimate to either side at most."""
    low, high = interval
    return bool(max(high - value, value - low) <= _FIRM * abs(value))


def gain_in_words(gain: float, interval: tuple[float, float]) -> str:
    """Write a gain with its interval, and say so where it is not resolved."""
    low, high = interval
    if np.isfinite(low) != np.isfinite(high):
        said = f"at least {low:.3g}" if np.isfinite(low) else f"at most {high:.3g}"
        return f"{said}, the rest is extrapolated (gain of the model: {gain:.4g})"
    if np.isinf(low):
        return f"not determined by this record (gain of the model: {gain:.4g})"
    if np.isnan(low):
        return f"{gain:.6g}"
    number, *ends = numbers_alike((gain, low, high), low, high)
    return f"{number} ({ends[0]} to {ends[1]})"
