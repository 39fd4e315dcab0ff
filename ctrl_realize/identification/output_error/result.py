"""Result of an output-error fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..._parameters import Parameter, formula, gain_unit
from ..._wording import (
    in_time,
    interval_in_time,
    number_within,
    plainly,
    poles_in_words,
    time_within,
    times_in,
)
from ...data import Record
from ...numerics.arrays import ComplexArray, FloatArray, locked
from ...numerics.engine.modal import lag_sum
from ...numerics.engine.plausible_models import PlausibleModel
from ...numerics.engine.static_gain import INTEGRATOR
from ...numerics.output_error.result import OutputErrorEstimate, StructureFit
from ...numerics.output_error.step_data import StepData
from ...results import Flag, FractionalDelayFit, IntervalKind
from ..plausible import PlausibleModels
from ..process_parameters import jump, not_seen_in_words, told, with_intervals
from ..verdicts import Verdict, verdicts
from .actuated.result import ActuatorFit
from .record_gains import RecordGains
from .repeat_flags import BY_CHANCE
from .repeatability import Repeatability
from .words import (
    ESTIMATE_WORDS,
    Stated,
    gain_in_words,
    gain_scatter,
    order_words,
    structure_words,
    total_in_words,
)

if TYPE_CHECKING:
    from ..noise import NoiseModel

FOLLOWED_LESS = 0.5
"""Per cent of a response by which two fits differ, from which on the difference is stated."""


@dataclass(frozen=True, eq=False, repr=False)
class OutputErrorFit(FractionalDelayFit):
    """Dead time and model from an output-error fit of raw records.

    ``interval[0] <= dead_time <= interval[1]`` and ``total_delay == dead_time + sum of the model's
    lags - sum of its leads``. The total delay is usually determined better than its division into
    dead time and lags; see `total_delay_interval` and `interval`. The model is ``gain exp(-s
    dead_time)`` times a transfer function of unit gain with `poles` and `zeros`. This assumes a
    linear plant in open loop whose response has settled within the record; flags report where it
    has not.

    Attributes
    ----------
    estimate : OutputErrorEstimate
        Numerical result; most other attributes are read from it.
    data : StepData
        Data that were fitted (the mean, for several step records), and their noise.
    time : ndarray, shape (N,)
        In s.
    records : tuple of Record
        Records that were given; samples at a limit of the output are missing in them.
    repeatability : Repeatability or None
        Delay of each record separately, if there are several.
    gains : RecordGains or None
        Gain of each record at its operating point, if they were not taken for the same.
    choices : tuple of str
        Automatic choices, with reasons.
    flags : tuple of Flag
        Warnings about the result.
    actuator : ActuatorFit or None
        Actuator before or behind the linear model, if one was asked for and is needed.
    stated : Stated or None
        What the user stated beforehand: `fastest_lag` and `dead_time`, in s.

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

    estimate: OutputErrorEstimate
    data: StepData
    time: FloatArray
    records: tuple[Record, ...]
    repeatability: Repeatability | None = None
    gains: RecordGains | None = None
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = ()
    actuator: ActuatorFit | None = None
    stated: Stated | None = None

    def __post_init__(self) -> None:
        profile = self.estimate.profile
        for values in (self.time, self.data.output, self.estimate.fitted, *profile):
            values.flags.writeable = False

    @property
    def dead_time(self) -> float:
        """Transport delay of the model, in s."""
        return self.estimate.dead_time

    @property
    def std_given_structure(self) -> float:
        """Standard error of the dead time in s for the chosen structure.

        If the residual exceeds the noise, the standard error of the delay estimates. It does not
        contain the uncertainty of the structure, which is usually the larger part and is contained
        in `interval`.
        """
        return self.estimate.std

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the dead time in s.

        Of all structures that the data do not rule out if the residual is at noise level (wider if
        the model has a zero), otherwise of the delay estimates.
        """
        return self.estimate.low, self.estimate.high

    @property
    def onset(self) -> float:
        """Visible onset of the response after the step in s; NaN if the input is not a step."""
        motion = self.data.motion
        return float("nan") if motion is None else motion.onset * self.data.dt

    @property
    def total_delay(self) -> float:
        """Delay at zero frequency in s, without integrators."""
        return self.dead_time + lag_sum(self._moving_poles, self.estimate.numerator)

    @property
    def total_delay_interval(self) -> tuple[float, float]:
        """95 % interval of the total delay in s, if the residual is at noise level.

        Infinite if the record does not determine it. Called well determined if its ends are within
        a tenth of the estimate.
        """
        return self.estimate.total_ends if self._jump is None else self.interval

    @property
    def _jump(self) -> int | None:
        fit = self.estimate
        return jump(fit.poles, fit.numerator, fit.dead_time, self.interval, self.data.dt)

    @property
    def order(self) -> int:
        """Number of poles."""
        return self.estimate.structure.order

    @property
    def relative_degree(self) -> int:
        """Poles minus zeros."""
        return self.estimate.structure.relative_degree

    @property
    def _plain_poles(self) -> ComplexArray:
        """Poles of the estimate; those of integrators are exactly 0."""
        poles = self.estimate.poles.copy()
        poles[np.abs(poles) < INTEGRATOR / self.data.length] = 0.0
        return poles

    @property
    def _moving_poles(self) -> ComplexArray:
        poles = self._plain_poles
        return np.asarray(poles[poles != 0])

    @property
    def poles(self) -> ComplexArray:
        """Poles of the continuous model, in rad/s."""
        return locked(np.sort_complex(self._plain_poles))

    @property
    def zeros(self) -> ComplexArray:
        """Zeros of the continuous model, in rad/s."""
        zeros = np.roots(self.estimate.numerator[::-1]).astype(np.complex128)
        return locked(np.sort_complex(zeros))

    @property
    def gain(self) -> float:
        """Gain at zero frequency; for a model with an integrator, the slope per second."""
        return float(self.estimate.numerator[0] / np.prod(-self._moving_poles).real)

    @property
    def gain_std_given_structure(self) -> float:
        """Standard error of the gain for the chosen structure."""
        static = self.estimate.static
        return float("nan") if static is None else static.gain_std

    @property
    def gain_interval(self) -> tuple[float, float]:
        """95 % interval of the gain, for all structures that the data do not rule out.

        Also for all records, if their gains differ and were taken for the same. Infinite if the
        record is shorter than the
        slowest time constant and does not determine the gain.
        """
        low, high = self.estimate.gain_ends
        repeats = self.repeatability
        if repeats is None or self.gains is not None or repeats.gain_test[1] >= BY_CHANCE:
            return low, high
        own = self.gain * repeats.gains[repeats.kept]
        return float(min(low, *own)), float(max(high, *own))

    @property
    def integrators(self) -> int:
        """Number of poles at zero."""
        return int(np.sum(self._plain_poles == 0))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Gain, dead time, lags, ... with standard errors and 95 % intervals; times in s.

        The intervals of gain and dead time cover the choice of the structure, the others are those
        of the chosen one. Standard errors are NaN where no likelihood describes the error of the
        fit, and for lags that follow a law (many equal lags, axial dispersion).
        """
        longest = self.data.length / INTEGRATOR
        found = self.estimate.process.parameters
        return with_intervals(
            tuple(p for p in found if not p.name.startswith("lag_") or p.value <= longest),
            gain_unit(self.output_unit, self.input_unit),
            gain=(self.gain, self.gain_std_given_structure, self.gain_interval),
            dead_time=(self.std_given_structure, self.interval),
            integrating=self.integrators > 0,
            several=len(self.structures) > 1 and self.better is None,
        )

    @property
    def formula(self) -> str:
        """The transfer function in one line, in seconds.

        Without lags that the data do not distinguish from zero. The dead time of a response that
        jumps from one sample to the next is written in whole samples.
        """
        shown, _ = told(self.parameters, self.data.dt, self._jump)
        return formula(shown, self.integrators, self.time_unit)

    @property
    def at_noise_level(self) -> bool:
        """Whether the residual is as small as the noise before the step."""
        return self.estimate.adequate

    @property
    def normalized_rms(self) -> float:
        """Residual divided by noise, for means over bins of samples."""
        return self.estimate.residual.normalized_rms

    @property
    def noise(self) -> float:
        """Standard deviation of the output's noise."""
        return self.data.sigma

    @property
    def residual(self) -> float:
        """Standard deviation of the residual, with its degrees of freedom and outliers cut."""
        return self.estimate.residual.std

    @property
    def correlation(self) -> float:
        """Number of residual samples that count as one independent sample."""
        return self.estimate.residual.correlation

    @property
    def delay_estimates(self) -> dict[str, float]:
        """Dead times in s by six methods; the last one only contributes to the interval.

        Empty if the dead time is that of the likelihood.
        """
        return {ESTIMATE_WORDS[key]: delay for key, delay in self.estimate.delay_estimates}

    @property
    def structures(self) -> tuple[StructureFit, ...]:
        """All models that were fitted, best first."""
        return self.estimate.structures

    @property
    def measured(self) -> FloatArray:
        """Output that was fitted, shape (N,)."""
        return self.data.output

    @property
    def fitted(self) -> FloatArray:
        """Response of the model to the record, shape (N,)."""
        return self.estimate.fitted

    @property
    def fit_percent(self) -> float:
        """``100 (1 - |y - fitted| / |y - mean y|)``: 100 is perfect, 0 a mean.

        A drift, hum, load or free response that was estimated together with the model is included.
        Of several records that are not averaged, y is in units of the noise of each, about its own
        mean.
        """
        return self.estimate.followed.complete

    @property
    def simulated_percent(self) -> float:
        """`fit_percent` of the model alone, simulated from rest; its level is that of the output.

        An input that is not a step was at its first value or at its mean, whichever follows more.
        Less than `fit_percent` where a drift, hum, or the free response to an earlier input was
        estimated together with the model.
        """
        return self.estimate.followed.simulated

    @property
    def dt(self) -> float:
        """Sample time of the model in s, that of the records."""
        first = self.records[0]
        return first.sample_time if first.irregular else self.data.dt

    @property
    def better(self) -> StructureFit | None:
        """The best structure, if the requested structures are ruled out; otherwise None.

        Its `delta_bic` is negative. The dead time is then an apparent one, which includes lags that
        are missing in the model.
        """
        return self.estimate.better

    @property
    def interval_kind(self) -> IntervalKind:
        """Kind of `interval`: a confidence interval only if the residual is at noise level.

        If structures were requested, it is one only if the right one is among them.
        """
        if self.estimate.others is not None:
            return "conditional"
        return "confidence" if self.at_noise_level else "spanned"

    @property
    def residual_std(self) -> float:
        """Standard deviation of the residual, the same as `residual`."""
        return self.residual

    @property
    def noise_model(self) -> NoiseModel:
        """Autoregressive model of the noise, with a one-step predictor."""
        from ..noise import noise_of

        return noise_of(self.measured - self.fitted, self.dt, self._noise_filter)

    @property
    def _noise_filter(self) -> FloatArray | None:
        """Polynomial that made the noise of samples white; that of means over blocks is another."""
        return self.estimate.residual.noise if self.data.every == 1 else None

    @property
    def structure(self) -> tuple[int, int]:
        """Order and relative degree."""
        return self.order, self.relative_degree

    @property
    def plausible_models(self) -> PlausibleModels | None:
        """Models that the data do not rule out; None beside an actuator."""
        models, unit = self.estimate.plausible, self.time_unit
        if models and unit not in self._drawn:
            self._drawn[unit] = PlausibleModels(models, self.dt, unit)
        return self._drawn.get(unit)

    @cached_property
    def _drawn(self) -> dict[str, PlausibleModels]:
        """Plausible models by the unit of their times: sampled once, as every check needs them."""
        return {}

    @property
    def _answered_noise(self) -> bool:  # type: ignore[override]
        in_loop = "closed_loop" in [flag.code for flag in self.flags]
        return in_loop and self.estimate.residual.noise_lags > 0

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Whether dead time and gain are known, and whether the model is fit for tuning.

        Empty beside an actuator, which takes part in every loop.
        """
        if not self.estimate.plausible:
            return ()
        own = PlausibleModel(self.dead_time, self._plain_poles, self.estimate.numerator)
        with times_in(self.time_unit):
            return verdicts(self, own, self.estimate.plausible)

    def __repr__(self) -> str:
        low, high = self.interval
        level = "noise" if self.at_noise_level else f"{plainly(self.normalized_rms, 2)} x noise"
        return (
            f"<{type(self).__name__} {self.dead_time:.4g} s in {low:.4g}...{high:.4g} s, "
            f"{order_words(self.estimate.structure)}, residual {level}>"
        )

    @property
    def interval_without_short_lags(self) -> tuple[float, tuple[float, float]] | None:
        """A lag in s, and the interval of the dead time if the plant has none that is shorter.

        None if that is no help, or if something was stated. Lags that are short beside those of the
        model, and that the data do not rule out, can take the place of dead time; without them the
        interval is that of the other structures. How often it holds is measured in
        `benchmarks.records`.
        """
        found = None if self.stated else self.estimate.low_without_short_lags
        return found and (found[0], (found[1], self.interval[1]))

    def _as_stated(self) -> str:
        return "" if self.stated is None else f", {self.stated.in_words()}"

    def _without_short_lags(self) -> list[tuple[str, str]]:
        found = self.interval_without_short_lags
        return (
            [(f"if no lag is faster than {in_time(found[0], 2)}", interval_in_time(*found[1]))]
            if found else []
        )  # fmt: skip

    def _other_orders(self) -> list[tuple[str, str]]:
        """What structures of one more pole say that were not requested and are not ruled out."""
        lines = [] if self.estimate.others is None else self.estimate.others.not_ruled_out
        ends = [line.interval for line in lines if line.interval is not None]
        if not ends:
            return []
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        return [(f"with order {lines[0].order}", f"{interval_in_time(low, high)}, not ruled out")]

    def _fit_in_words(self) -> str:
        own, alone = self.fit_percent, self.simulated_percent
        words = f"{own:.1f} % of the response"
        if own - alone > FOLLOWED_LESS:
            words += f"; {alone:.1f} % simulated from rest, without {self._fitted_along()}"
        return words

    def _fitted_along(self) -> str:
        """What was estimated together with the model, in words."""
        if not np.isfinite(self.onset):
            loads = any(flag.code == "load_disturbance" for flag in self.flags)
            more = ", drift and initial state" * self.data.relaxing
            return "loads, and " * loads + f"the level{more} of the record"
        parts = ["the free response to an earlier input"] * self.data.relaxing
        parts += ["the load"] * (self.data.load is not None)
        parts += ["the drift"] * bool(self.data.drift) + ["the hum"] * bool(self.data.hum)
        return " and ".join(parts) or "its level"

    _name = "Output-error fit"
    _method = "output-error fit of the raw record"

    def _kind(self) -> str:
        return "dead time" if self.better is None else "apparent dead time"

    def _title(self) -> str:
        return f"{self._name}: {self._kind()} {self._dead_time_in_words()[0]}"

    def _dead_time_in_words(self) -> tuple[str, str]:
        """Dead time and what follows it: in s and in samples, of a jump in samples."""
        low, high = self.interval
        if (after := self._jump) is not None:
            step = self.data.dt
            same = interval_in_time((after - 1) * step, after * step)
            return (
                f"{after} sample{'s' * (after > 1)}",
                f" ({same} give the same samples behind a hold)",
            )
        samples = number_within(self.delay, *self.delay_interval)
        return time_within(self.dead_time, low, high), f" = {samples} samples"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.interval
        _, left_out = told(self.parameters, self.data.dt, self._jump)
        rows = [
            ("transfer function", self.formula),
            *([("not seen", not_seen_in_words(left_out))] if left_out else []),
            *((f"verdict: {v.question}", f"{v.level}: {v.sentence}") for v in self.verdicts),
            (self._kind(), "".join(self._dead_time_in_words())),
            (self.interval_label, interval_in_time(low, high) + self._as_stated()),
            *self._without_short_lags(),
            *self._other_orders(),
            *([("visible onset", in_time(self.onset, 4))] if self.onset == self.onset else []),
            (
                "total delay",
                total_in_words(self.total_delay, self.total_delay_interval, self.flags),
            ),
            ("model", structure_words(self.estimate)),
            ("poles", poles_in_words(self.poles)),
            ("gain", gain_in_words(self.gain, self.gain_interval)),
            *([("actuator", self.actuator.in_words())] if self.actuator is not None else []),
            ("fit", self._fit_in_words()),
            (
                "residual",
                f"{self.residual:.3g}, noise {self.noise:.3g} "
                f"(normalised rms {plainly(self.normalized_rms, 3)})",
            ),
        ]
        rows += [
            (f"delay estimate: {name}", in_time(value, 4))
            for name, value in self.delay_estimates.items()
        ]
        if self.repeatability is not None:
            rows += gain_scatter(self.gain * self.repeatability.gains)
            rows += self.repeatability.rows()
        if self.gains is not None:
            rows.append(("schedule", self.gains.in_words()))
        return rows
