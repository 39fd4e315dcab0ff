"""Choose the model of a step record with a residual at noise level: lags, a chain, or dispersion.

Besides the free structures there are chains of lags and axial dispersion, with few parameters each
(point 1 of the rule in `output_error`).

Compared by BIC [1]_, [2]_: lags, chains of lags [3]_ and dispersion [4]_.

Decisions may be so close that rounding, or another processor, changes them. All values that are
compared have converged (`converged`): different rounding of the same record changes them by
much less than `CLOSE`; structures that were not followed to their minimum by hundredths of a
variance at most. The definition of close is our own rule.

Where the data do not determine the gain, the model extrapolates as little as they allow. A pole
far slower than the record stands for a drift that began with the response. Its time constant has no
upper limit, and the gain of the best fit may be any number. The profile likelihood [5]_ of that
pole tells the fastest one that is not ruled out; with it the model fits as well, and its gain is
close to what was observed. Of all solutions within the error of the data, Phillips [6]_ takes the
smoothest in the same way. Ablation: least extrapolation.

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
.. [3] V. Strejc, Naherungsverfahren fur aperiodische Ubergangscharakteristiken, Regelungstechnik 7
   (1959) 124-128.
.. [4] O. Levenspiel, Chemical Reaction Engineering, 3rd ed., Wiley 1999, chapter 13 (The dispersion
   model).
.. [5] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [6] D. L. Phillips, A technique for the numerical solution of certain integral equations of the
   first kind, J. ACM 9 (1962) 84-97, doi:10.1145/321105.321114.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from ..constants import CHI2_95, VERY_STRONG
from ..engine.descend import descend
from ..engine.modal import parameters_from_poles, poles_from_parameters
from ..engine.newton import settle
from ..engine.problem import Family, KnownFactor, Structure
from ..engine.static_gain import StaticGain
from ..engine.structures import (
    Candidate,
    charged,
    choose,
    needless_parameters,
    parameter_bounds,
    plausible,
    search,
)
from ..engine.window_fit import WindowFit
from ..families.equal_lags import FREE_IN_A_CHAIN, LONGEST, LagChain, fit_chains, fit_diffusion
from ..families.flow import DispersedFlow, fit_flows
from ..rules import Rule

_LAGS_OF_TANKS, _LAGS_OF_DIFFUSION = 3, 2
"""Poles from which on there may be more lags than show; the second mode of diffusion is fast: of
lags that grow fourfold and more one hides beside the first."""

_BEHIND_A_FLOW = tuple(Structure(n, r) for n in range(3, 7) for r in range(n, 0, -1))
"""Fewer lags cannot follow a flow that is clearly better than lags."""
CLOSE = 1e-3
"""Distance from a threshold, as a part of it, within which a decision is called close. Structures
compare by the part of `VERY_STRONG` by which their criteria differ: a hundredth of a variance."""

DecisionKey: TypeAlias = Literal["structure", "ruled_out", "adequate", "likelihood"]
_FASTEST = 4.0  # over the length of the record: 2 % of such a mode are left at its end
_BENDS = 0.6
"""Over the length of the record: a slower pole is no other plant than an integrator. Of 12 plants
that integrate, and were found to, none became a lag."""
_RATIO = 2.0  # of the rates that are tried: time


@dataclass(frozen=True, eq=False)
class Choice:
    """The chosen model, and the criterion with which others are compared.

    It is a chain of lags, or lags with the dead time of dispersion, if one of these is given.
    """

    model: Candidate
    level: float
    chain: LagChain | None = None
    flow: DispersedFlow | None = None

    @property
    def parameters(self) -> int:
        """Number of free parameters besides gain and dead time."""
        if self.flow is not None:
            return self.flow.parameters
        return FREE_IN_A_CHAIN if self.chain is not None else self.model.structure.free


def chains_of(
    fits: WindowFit, modes: int = LONGEST, behind: Sequence[float] = ()
) -> list[LagChain]:
    """Fit chains of lags if the best order suggests more lags than were tried.

    Among them is diffusion, and with `behind` diffusion beside a lag: see `fit_diffusion`.
    """
    order = fits.best.structure.order
    equal_lags = fit_chains(fits) if order >= _LAGS_OF_TANKS and Rule.CHAINS.on else []
    if order < _LAGS_OF_DIFFUSION or not Rule.DIFFUSION.on:
        return equal_lags
    beside = fit_diffusion(fits, modes, behind) if behind else []
    return equal_lags + fit_diffusion(fits, modes) + beside


def flows_of(fits: WindowFit, chains: Sequence[LagChain]) -> list[DispersedFlow]:
    """Fit dispersion if there is more than one lag."""
    if fits.best.structure.order < _LAGS_OF_DIFFUSION or not Rule.FLOWS.on:
        return []
    level = min([*fits.criterion.values(), *(chain.criterion for chain in chains)])
    return fit_flows(fits, level)


def many_lags(fits: WindowFit) -> tuple[list[LagChain], list[DispersedFlow]]:
    """Fit what has more lags than structures have to points of a frequency response.

    They tell more than the response to a step: diffusion has more modes, and may have a lag in
    series. There may be records beside the points.
    """
    # The 16th mode is 256 to 961 times as fast as the first: data that reach three decades above it
    # are rare. Starts of the lag are parts of the spread of all. Benchmark: very many lags.
    chains = chains_of(fits, modes=16, behind=(0.3, 0.6, 0.9))
    return chains, flows_of(fits, chains)


def choose_model(
    fits: WindowFit, equal_lags: Sequence[LagChain], flows: Sequence[DispersedFlow]
) -> Choice:
    """Choose by the lowest criterion; dispersion must be representable by lags.

    Diffusion is not among the chains here: friction has a similar response, so diffusion widens the
    interval and is never the model.
    """
    best = fits.best
    lags = Choice(best, fits.criterion[best.structure] + needless_parameters(best.structure))
    chains = _beside_own_terms(fits, equal_lags)
    chain = min(chains, key=lambda chain: chain.criterion, default=None)
    if chain is not None and chain.criterion < lags.level:
        lags = Choice(chain.candidate, chain.criterion, chain)
    flow = min(flows, key=lambda flow: flow.criterion, default=None)
    if flow is None or flow.criterion >= lags.level:
        return lags
    model = _behind(fits, flow)
    return lags if model is None else Choice(model, flow.criterion, flow=flow)


def _beside_own_terms(fits: WindowFit, equal_lags: Sequence[LagChain]) -> Sequence[LagChain]:
    """Chains that may be the model: none beside a free response.

    Eight equal lags have a free response of eight initial values, which takes the place of the
    response to the step: gains 5 to 20 % too small in three of 22 simulated heaters, 0.20 for 0.27
    to 0.32 of a measured one. Ablation: no chain beside a free response.
    """
    moves = bool(equal_lags) and fits.problem.segments is not None
    return () if moves and Rule.NO_CHAIN.on else equal_lags


def _behind(fits: WindowFit, flow: DispersedFlow) -> Candidate | None:
    """Lags and zeros with the dead time of dispersion that fit as well, if there are any."""
    pinned = replace(fits.scales, earliest=flow.dead_time, latest=flow.dead_time)
    limit = flow.fit.cost + VERY_STRONG * fits.variance
    found = search(fits.problem, _BEHIND_A_FLOW, pinned)
    # Their number is not penalised, since they only represent the dispersion model.
    good = {structure: model for structure, model in found.items() if model.cost <= limit}
    return good[choose(fits.criteria(good))] if good else None


@dataclass(frozen=True)
class CloseDecision:
    """A decision near its threshold: its kind, and the structure that would be chosen instead."""

    key: DecisionKey
    structure: Structure | None = None


def close_to(key: DecisionKey, value: float, threshold: float) -> tuple[CloseDecision, ...]:
    """Report a value within `CLOSE` of its threshold."""
    return (CloseDecision(key),) if abs(value - threshold) <= CLOSE * threshold else ()


def close_choices(fits: WindowFit, level: float, chosen: Structure) -> tuple[CloseDecision, ...]:
    """List structures whose criterion nearly equals `level`, that of the chosen one.

    Frequencies of pairs are charged, as in the choice. Also those that could have determined the
    noise level, on which everything depends.
    """
    level += fits.frequency_charge(chosen)
    near = [
        s
        for s, value in fits.criterion.items()
        if abs(value + needless_parameters(s) + fits.frequency_charge(s) - level)
        <= CLOSE * VERY_STRONG
    ]
    near += [s for s, excess in fits.rivals.items() if excess <= CLOSE * VERY_STRONG]
    return tuple(CloseDecision("structure", s) for s in dict.fromkeys(near) if s != chosen)


def close_exclusions(fits: WindowFit, level: float, chosen: Structure) -> tuple[CloseDecision, ...]:
    """List structures that are just ruled out, or just not; `level` includes penalties."""
    values = charged(fits.criterion, fits.penalty)
    most, least = (
        plausible(fits.candidates, values, fits.variance, fits.candidates[chosen], level, slack)
        for slack in (CLOSE * VERY_STRONG, -CLOSE * VERY_STRONG)
    )
    return tuple(CloseDecision("ruled_out", s) for s in most if s not in least)


def least_extrapolating(
    fits: WindowFit, candidate: Candidate, *, dead_time_fixed: bool = False
) -> tuple[Candidate, StaticGain]:
    """Return the model with the fastest slow pole that is not ruled out (95 %), to a factor of two.

    A model with a significant gain is returned as it is, unless it is the slope of an integrator
    that may be a lag; so is one beside a free response of its own poles. The second result is the
    static response, with the errors of the best fit.

    Parameters
    ----------
    fits : WindowFit
    candidate : Candidate
    dead_time_fixed : bool, optional
        Keep the dead time.
    """
    problem, scales, structure = fits.problem, fits.scales, candidate.structure
    poles = candidate.poles
    slow = int(np.argmin(np.abs(poles)))
    static = fits.static(candidate)
    plain = structure.order > 1 and not isinstance(structure, Family)
    plain = plain and problem.segments is None and not poles[slow].imag
    slope = static.integrates and static.significant
    if not (plain and (slope or not static.significant) and Rule.EXTRAPOLATION.on):
        return candidate, static
    rest = Structure(structure.order - 1, structure.relative_degree - 1)
    bounds = parameter_bounds(rest, scales)
    start = np.append(candidate.dead_time, parameters_from_poles(np.delete(poles, slow)))
    level = candidate.cost + CHI2_95 * fits.variance
    rate = _FASTEST / scales.length
    while rate > (_BENDS / scales.length if slope else np.abs(poles[slow])):
        factor = KnownFactor(np.append(problem.known.poles, -rate), problem.known.numerator)
        held = replace(problem, known=factor)
        near, _ = descend(
            held, rest, start[None], bounds, scales.dt, dead_time_fixed=dead_time_fixed
        )
        x, cost = settle(held, rest, near[0], bounds, scales.dt, dead_time_fixed=dead_time_fixed)
        free = poles_from_parameters(x[None, 1:])[0][0]
        if cost <= level and np.abs(free).min() >= rate:
            parameters = np.append(x[0], parameters_from_poles(np.append(free, -rate)))
            found = Candidate(structure, parameters, cost)
            own = fits.static(found)
            # The errors of an integrator are those of a slope.
            errors = own if static.integrates else static
            std = errors.gain_std * abs(own.gain / (errors.gain or own.gain))
            return found, replace(
                errors, gain=own.gain, gain_std=std, total=own.total, reached=own.reached
            )
        rate /= _RATIO
    return candidate, static
