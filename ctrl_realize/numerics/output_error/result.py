"""What an output-error fit has found: dead time, interval, model, and the table of structures.

Intervals of structures are profile likelihoods [1]_.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ..arrays import ComplexArray, FloatArray, IntArray
from ..blas_threads import one_blas_thread
from ..engine.eliminate import eliminate, evaluate
from ..engine.modal import lag_sum, respond
from ..engine.plausible_models import PlausibleDraw, PlausibleModel
from ..engine.problem import Structure
from ..engine.profile import Points, Profile, profile_limits
from ..engine.static_gain import StaticGain, averaged_ends, gain_ends
from ..engine.structures import Candidate, Scales, needless_parameters
from ..engine.window_fit import WindowFit
from ..families.equal_lags import LagChain
from ..families.flow import DispersedFlow
from ..families.form_fit import FormFamily
from ..families.lag_profiles import low_without_short_lags
from ..families.physical import ProcessParameter, fitted_parameters
from ..families.process_form import ProcessForm
from ..signals.correlation import fit_percent
from ..signals.load_step import LoadStep
from .selection import CloseDecision, least_extrapolating

_LEAST_WIDTH = 1e-6  # samples
AT_BOUND = 0.98  # of the range of dead times, from which on an interval reaches its bound
_TEMPERED = 0.5
"""Power of the evidence with which a structure counts: the criterion says too surely which one of
two is right (five lags: a further one is seldom seen). Measured: `benchmarks.verdicts`, seeds below
100."""
_OVER = 7.0
"""Lags in a sample from which on less than a thousandth of a mode is left at the next one: to the
data such a lag is dead time, and the error of the sum of both is rounding."""
_ON_THE_GRID = 1e-3
"""Steps by which an end may be beyond a rounded value and count as equal to it: ends often lie on
samples, which are such values."""
RobustKey: TypeAlias = Literal[
    "onset",
    "one_lag_early",
    "two_lags_early",
    "three_lags_early",
    "model_of_rise",
    "model_of_record",
]
"""Dead time estimates where no model is adequate: "early" is 15 % of the excursion, "rise" 63 %."""


class Followed(NamedTuple):
    """How much of an output, in per cent, models follow: 100 (1 - |error| / |y - mean|).

    `complete` is that of the chosen model with drift, hum and free response, `simulated` without
    them; `closest` is the structure with the smallest residual, whatever its number of parameters,
    and `by_closest` how much it follows, with all of these.
    """

    complete: float
    simulated: float
    closest: Structure
    by_closest: float


class OtherModel(NamedTuple):
    """Interval of the dead time in s under a model that is not in the table of structures."""

    model: LagChain | DispersedFlow
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class StructureFit:
    """One structure that was fitted: `order` poles, ``order - relative_degree`` zeros.

    `delta_bic` is its information criterion above that of the best structure; up to 10 the data do
    not rule it out, and `interval` (s) is the 95 % profile-likelihood interval of its dead time
    (None where the structure is ruled out). Times are in s, poles in rad/s; `gain` is that at
    zero frequency.
    """

    structure: Structure
    dead_time: float
    total_delay: float
    delta_bic: float
    interval: tuple[float, float] | None
    poles: ComplexArray
    gain: float

    @property
    def order(self) -> int:
        """Number of poles."""
        return self.structure.order

    @property
    def relative_degree(self) -> int:
        """Poles minus zeros."""
        return self.structure.relative_degree


@dataclass(frozen=True, eq=False, repr=False)
class OtherStructures:
    """What structures say that were not requested; their `delta_bic` is relative to the requested.

    `better` rules out what was requested. `alike` have one pole more than the best of the requested
    ones, and are not ruled out; the criterion includes the charges with which structures are
    chosen. `ends` finds the interval of one of them, in half the time of a fit.
    """

    better: StructureFit | None = None
    alike: tuple[StructureFit, ...] = ()
    ends: Callable[[Structure], tuple[float, float]] | None = None

    def __getstate__(self) -> dict[str, object]:
        """What is stored or sent: all intervals, and not the fits of which they are."""
        return {"better": self.better, "alike": self.alike, "not_ruled_out": self.not_ruled_out}

    def with_interval(self, line: StructureFit) -> StructureFit:
        """One that is not ruled out, with the 95 % profile-likelihood interval of its dead time."""
        assert self.ends is not None
        with one_blas_thread():
            return replace(line, interval=self.ends(line.structure))

    @cached_property
    def not_ruled_out(self) -> tuple[StructureFit, ...]:
        """All that are not ruled out, with their intervals."""
        return tuple(self.with_interval(line) for line in self.alike)


class DelayInterval(NamedTuple):
    """95 % interval of a dead time in s, and its standard error if the structure is the plant's."""

    low: float
    high: float
    std: float

    def rounded(self, dead_time: float, scales: Scales) -> DelayInterval:
        """Round the ends outwards, to a hundredth of the width at most.

        The third digit of a width is less than its own error, and on flat profiles it is decided
        by rounding errors.
        """
        width = (self.high - self.low) / scales.dt
        if not _LEAST_WIDTH < width < np.inf:
            return self
        step = float(10.0 ** (np.floor(np.log10(width)) - 2)) * scales.dt
        low = step * float(np.floor(self.low / step + _ON_THE_GRID))
        high = step * float(np.ceil(self.high / step - _ON_THE_GRID))
        return DelayInterval(
            min(max(low, scales.earliest), dead_time),
            max(min(high, scales.latest), dead_time),
            self.std,
        )


class Residual(NamedTuple):
    """What the model leaves of the output, and what was assumed about its noise.

    `std` is its standard deviation, `normalized_rms` that over the noise in means over bins,
    `correlation` the number of samples that count as one. `whitened`: coloured noise was whitened
    with its model from before the step; `noise` is the polynomial (r + 1,) that was used to make
    the noise white beside an input other than a step. `rounded` is the noise before rounding, if
    the model is that of the likelihood of rounded data.
    """

    std: float
    normalized_rms: float
    correlation: float
    whitened: bool = False
    noise: FloatArray | None = None
    rounded: float | None = None

    @property
    def noise_lags(self) -> int:
        """Order of that polynomial; 0 where none was used."""
        return 0 if self.noise is None else self.noise.size - 1


class DistributedLags(NamedTuple):
    """What models with many lags say: chains of equal lags, and axial dispersion.

    `chain` is the chain of lags that the model is, if it is one; `unlimited`: chains fit the better
    the longer they are, so that all of the dead time may be lags. `flows` are dispersion models
    that are not ruled out; with `follows_flow` the dead time is that of the best of them, and the
    model approximates it. `not_ruled_out` are models with their intervals that are not in the table
    of structures.
    """

    chain: LagChain | None = None
    unlimited: bool = False
    flows: tuple[DispersedFlow, ...] = ()
    follows_flow: bool = False
    not_ruled_out: tuple[OtherModel, ...] = ()


_PLAIN_LAGS = DistributedLags()


@dataclass(frozen=True, eq=False, repr=False)
class ProcessEstimate:
    """The model as a process model.

    `form` is the form that was prescribed, if it is not a plain structure, and `at_bound` lists its
    parameters that are at a bound. `find` has the parameters once somebody asks: the profiles of
    lags take a third of the time of a fit.
    """

    find: Callable[[], tuple[ProcessParameter, ...]]
    form: ProcessForm | None = None
    at_bound: tuple[str, ...] = ()

    def __getstate__(self) -> dict[str, object]:
        """What is stored or sent: the parameters, and not the fit that has them."""
        return {"parameters": self.parameters, "form": self.form, "at_bound": self.at_bound}

    @cached_property
    def parameters(self) -> tuple[ProcessParameter, ...]:
        """The parameters, with standard errors if they are known."""
        with one_blas_thread():
            return self.find()

    def without_errors(self) -> ProcessEstimate:
        """The same, where standard errors are not those of the curvature: of a law or a median."""
        return replace(
            self,
            find=lambda: tuple(ProcessParameter(one.name, one.value) for one in self.parameters),
        )


@dataclass(frozen=True, eq=False)
class OutputErrorEstimate:
    """Dead time and model of one record; see the rule in `output_error`.

    ``low <= dead_time <= high``. `delay_estimates` are (key, dead time), empty where the dead time
    is that of the likelihood. The model is exp(-L s) b(s) / a(s), L the dead time: `numerator`
    lists b from the lowest power on, `poles` are the roots of the monic a. `std` is the standard
    error of the dead time for the chosen structure. `adequate`: the residual is at noise level.
    `open_start`: the relative degree, and with it the onset, is not identifiable. `static` is the
    gain of the model, `alike` those of the other structures that are not ruled out and resolve one,
    each with its evidence over the model's. `others` is None if no structures were requested;
    `close` are decisions that rounding errors may reverse. `unweighted` is the model of
    plain least squares, if the residual was whitened. `load` is a step of a load; it is part
    of the model unless it is early. `rounding` is the standard error of the gain from that of the
    levels before and after a step. `beyond` is the estimate without samples that may be at a limit
    of the output, which gain and total delay may exceed then. `drawn` has the structures of which
    plausible models are drawn.
    `points` are the profiles of structures that are not ruled out. If the dead time is
    `averaged`, it is the mean over them, and the interval holds 95 % of their weight: `with_moves`
    tells both for an input that moves so many times further.
    """

    dead_time: float
    low: float
    high: float
    std: float
    structure: Structure
    poles: ComplexArray
    numerator: FloatArray
    adequate: bool
    residual: Residual
    structures: tuple[StructureFit, ...]
    delay_estimates: tuple[tuple[RobustKey, float], ...]
    fitted: FloatArray
    followed: Followed
    profile: Profile
    latest: float
    process: ProcessEstimate
    open_start: bool = False
    distributed: DistributedLags = _PLAIN_LAGS
    static: StaticGain | None = None
    alike: tuple[tuple[StaticGain, float], ...] = ()
    others: OtherStructures | None = None
    close: tuple[CloseDecision, ...] = ()
    unweighted: PlausibleModel | None = None
    load: LoadStep | None = None
    drawn: PlausibleDraw | None = None
    points: Mapping[Structure, Points] = field(default_factory=dict)
    rounding: float = 0.0
    beyond: OutputErrorEstimate | None = None
    with_moves: Callable[[float], tuple[float, float, float]] | None = None

    @property
    def averaged(self) -> bool:
        """Whether the dead time is a mean over structures that are not ruled out."""
        return self.with_moves is not None

    @property
    def plausible(self) -> tuple[PlausibleModel, ...]:
        """Models that the data do not rule out, all equally likely; none beside an actuator."""
        return () if self.drawn is None else self.drawn.models

    @property
    def robust(self) -> bool:
        """Whether the interval, too, is that of the delay estimates and not of a likelihood."""
        return bool(self.delay_estimates) and not self.adequate

    @property
    def better(self) -> StructureFit | None:
        """A structure that rules out those that were requested, if there is one."""
        return None if self.others is None else self.others.better

    @property
    def gain_ends(self) -> tuple[float, float]:
        """95 % interval of the gain: of what was chosen and of structures that are not ruled out.

        Without end where the record does not resolve it, or not beside an early load.
        """
        if self.static is None or (self.load is not None and self.load.early):
            return -np.inf, np.inf
        if not self.static.resolved:
            return self.static.ends
        every = ((self.static, 1.0), *self.alike)
        own = gain_ends(every, self.rounding)
        late = 0.0 if self.load is None else self.load.own_gain
        own = own[0] + min(late, 0.0), own[1] + max(late, 0.0)
        if self.beyond is None:
            return own
        low, high = (-np.inf, np.inf) if self._rises_on else self.beyond.gain_ends
        return (own[0], max(own[1], high)) if self.static.gain > 0 else (min(own[0], low), own[1])

    @property
    def _rises_on(self) -> bool:
        """Whether it integrates without the samples that may be at a limit: its gain is a slope."""
        return self.beyond is not None and (
            self.beyond.static is None or self.beyond.static.integrates
        )

    @property
    def low_without_short_lags(self) -> tuple[float, float] | None:
        """A lag in s, and the low end of the interval if none is shorter; None if that is no help.

        See `families.lag_profiles`.
        """
        ends = [(other.low, np.inf) for other in self.distributed.not_ruled_out]
        for line in self.structures:
            if line.interval is not None:
                low, high = line.interval
                points = self.points.get(line.structure, {}).items()
                lags = [1 / np.abs(one.poles).max() for at, one in points if low <= at <= high]
                ends.append((low, max(lags, default=np.inf)))
        own = float(1 / np.abs(self.poles).max())
        return low_without_short_lags(ends, own, self.dead_time, (self.low, self.high))

    @property
    def total_ends(self) -> tuple[float, float]:
        """95 % interval of the total delay, in s, as that of the gain.

        It is a ratio with the gain for its denominator: without end if that may be zero, or if the
        response may go on.
        """
        low, high = self.gain_ends
        open_end = low <= 0 <= high or not np.isfinite(high - low)
        if self.static is None or not self.static.resolved or open_end:
            return self.low, np.inf
        every = ((self.static, 1.0), *self.alike)
        low, high = averaged_ends([(one.total, one.total_std, weight) for one, weight in every])
        low = low if self.numerator.size > 1 else max(low, 0.0)  # a lead may be longer
        if self.beyond is not None:
            high = np.inf if self._rises_on else max(high, self.beyond.total_ends[1])
        return low, high


def _table(fits: WindowFit, profiles: dict[Structure, Profile]) -> tuple[StructureFit, ...]:
    best = min(fits.criterion.values())
    lines = []
    for s, candidate in fits.candidates.items():
        interval = profile_limits(*profiles[s]) if s in profiles else None
        poles = candidate.poles
        numerator = eliminate(fits.problem, s, candidate.parameters[None]).numerator[0]
        total = candidate.dead_time + lag_sum(poles, numerator)
        excess = fits.criterion[s] - best
        gain = float(np.real(numerator[0] / np.prod(-poles)))
        lines.append(
            StructureFit(s.plain, candidate.dead_time, total, excess, interval, poles, gain)
        )
    return tuple(sorted(lines, key=lambda line: line.delta_bic))


def followed_by(fits: WindowFit, chosen: Candidate, numerator: FloatArray) -> Followed:
    """Compare a model alone, and the structure with the smallest residual, with the output."""
    window, problem = fits.window, fits.problem
    closest = min(fits.candidates.values(), key=lambda candidate: candidate.cost)
    parts = problem.segments
    edges: Sequence[int] | IntArray = [] if parts is None else parts.edges[1:-1]
    alone = respond(window.drive, problem.known, numerator, chosen.theta)
    alone += levels(edges, window.output - alone)
    # One after the other: a long record takes much memory.
    simulated = followed_percent(edges, window.output, alone)
    del alone
    complete = followed_percent(edges, window.output, window.predict(problem, chosen))
    most = followed_percent(edges, window.output, window.predict(problem, closest))
    return Followed(complete, simulated, closest.structure.plain, most)


def levels(edges: Sequence[int] | IntArray, values: FloatArray) -> FloatArray:
    """Mean of each record at all of its values (N,); all but the first begin at `edges`."""
    parts = np.split(values, edges)
    return np.repeat([part.mean() for part in parts], [part.size for part in parts])


def followed_percent(
    edges: Sequence[int] | IntArray, output: FloatArray, model: FloatArray
) -> float:
    """`fit_percent` of several records together: the levels of each are no part of a response."""
    level = levels(edges, output)
    return float(fit_percent(output - level, model - level))


def assembled(
    fits: WindowFit,
    chosen: Candidate,
    adequate: bool,
    delay_estimates: tuple[tuple[RobustKey, float], ...],
    profiles: dict[Structure, Profile],
    interval: DelayInterval,
    profile: Profile,
    *,
    static: StaticGain | None = None,
) -> OutputErrorEstimate:
    """Put a result together.

    `profiles` are those of the table of structures, `profile` that of the dead time chosen;
    `static` is the static response, if it is not that of the model alone.
    """
    problem, family = fits.problem, chosen.structure
    numerator = evaluate(problem, family, chosen.parameters[None]).numerator[0]
    variance = fits.error_variance
    if isinstance(family, FormFamily):
        find = partial(family.parameters, problem, chosen.parameters, variance)
        process = ProcessEstimate(find, family.form, family.at_bound)
    else:
        setting = problem, chosen, numerator, variance, fits.scales.length
        process = ProcessEstimate(partial(fitted_parameters, *setting))
    interval = interval.rounded(chosen.dead_time, fits.scales)
    static = static or fits.static(chosen)
    charged = {
        s: fits.criterion[s] + needless_parameters(s) + fits.frequency_charge(s) for s in profiles
    }
    least = charged.get(chosen.structure, np.inf)
    evidence = {
        s: float(np.exp(-max(value - least, 0.0) / 2)) ** _TEMPERED for s, value in charged.items()
    }
    alike = [
        (one, weight)
        for s, weight in evidence.items()
        if s != chosen.structure
        and np.abs(fits.candidates[s].poles.real).max() * fits.scales.dt < _OVER
        and (one := fits.static(fits.candidates[s])).resolved
    ]

    def drawn_about(one: Structure) -> Candidate:
        return chosen if one == family else least_extrapolating(fits, fits.candidates[one])[0]

    return OutputErrorEstimate(
        dead_time=chosen.dead_time,
        low=interval.low,
        high=interval.high,
        std=interval.std,
        structure=chosen.structure.plain,
        poles=chosen.poles,
        numerator=numerator,
        adequate=adequate,
        residual=Residual(
            fits.sigma, fits.normalized_rms, fits.correlation, fits.colour is not None
        ),
        structures=_table(fits, profiles),
        delay_estimates=delay_estimates,
        fitted=fits.window.predict(fits.problem, chosen),
        followed=followed_by(fits, chosen, numerator),
        profile=profile,
        latest=fits.scales.latest,
        static=static,
        # The slope of an integrator is no gain.
        alike=tuple(one for one in alike if one[0].integrates == static.integrates),
        process=process,
        drawn=PlausibleDraw(fits, evidence, drawn_about),
    )
