"""Delay and interval where the residual is noise: of all structures that are not ruled out.

Points 2 and, for the choice of the model, 1 of the rule in `output_error`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arrays import ComplexArray
from .dispersed_flow import DispersedFlow, fit_flows, flow_profile
from .fit_window import WindowFit
from .lag_chains import (
    FREE_IN_A_CHAIN,
    LagChain,
    chain_limits,
    chain_profile,
    fit_chains,
    fit_diffusion,
    still_improving,
)
from .output_error_result import OutputErrorFit, assembled, profile_of
from .profile_interval import profile_limits
from .separable_fit import Structure
from .structure_search import (
    LEAST_CHARGE,
    PLAUSIBLE,
    Candidate,
    Scales,
    choose,
    needless_charge,
    plausible,
    search,
)

_UNSEEN = 3.0
"""How far before the delay a beginning that is open may lie, in times from there to the first
motion. Flows that disperse, diffusion behind lags and parallel paths mostly need 1 to 3."""

_LAGS_OF_TANKS, _LAGS_OF_DIFFUSION = 3, 2
"""Poles from which on there may be more lags than show; the second mode of diffusion is fast."""

_BEHIND_A_FLOW = tuple(Structure(n, r) for n in range(3, 7) for r in range(n, 0, -1))

_LIKE_A_FLOW = 6
"""Lags of a chain from which on a flow that disperses looks the same, unless one was fitted and is
out of the question."""
_OUT_OF_QUESTION = 2 * PLAUSIBLE


def flow_lead(poles: ComplexArray) -> float:
    r"""Time by which a flow that disperses begins before a chain of lags that looks like it, in s.

    n lags of T have the cumulants nT, nT^2, 2nT^3, 6nT^4 in time; a residence time with an inverse
    Gaussian distribution of mean m and shape l has m, m^3/l, 3m^5/l^2, 15m^7/l^3. With m = 1.5 nT
    behind half of nT less dead time the first three are equal and the fourth differs by a ninth.
    """
    return 0.5 * float(np.sum(1 / np.abs(poles)))


@dataclass(frozen=True, eq=False)
class _Choice:
    """The model, the criterion to which others are held, and the limits and profile of its own.

    A chain of lags, or lags behind the dead time of a flow, where it is one.
    """

    model: Candidate
    level: float
    chain: LagChain | None = None
    flow: DispersedFlow | None = None

    @property
    def parameters(self) -> int:
        """Free ones beside gain and delay."""
        if self.flow is not None:
            return self.flow.parameters
        own = self.model.structure
        return FREE_IN_A_CHAIN if self.chain is not None else own.order + own.zeros


def likelihood_fit(
    whole: WindowFit,
    *,
    adequate: bool,
    chains: Sequence[LagChain] = (),
    flows: Sequence[DispersedFlow] = (),
    onset: float | None = None,
) -> OutputErrorFit:
    """Take delay and interval from the likelihood (points 1 and 2 of the rule).

    `onset` is the time of the first motion; without it the structures are believed.
    """
    # Diffusion widens the interval and is never the model: friction, too, looks like it.
    tanks = [chain for chain in chains if not chain.hidden]
    choice = _with_flow(whole, _among_lags(whole, tanks), flows)
    chosen = choice.model
    more = max(LEAST_CHARGE - whole.penalty, 0.0)
    free, kept, seen = _not_ruled_out(whole, choice, chains, flows, more)
    profiles = {s: profile_of(whole, whole.candidates[s]) for s in free}
    of_flows = [flow_profile(whole.problem, flow, whole.scales, whole.variance) for flow in seen]
    if choice.flow is not None:
        own = of_flows[[flow is choice.flow for flow in seen].index(True)]
    elif choice.chain is not None:
        own = chain_profile(choice.chain, whole.scales)
        whole = _with_chain(whole, choice.chain)
        profiles[chosen.structure] = own
    else:
        own = profiles[chosen.structure]
    limits = [profile_limits(*profile) for profile in profiles.values()]
    beside = [
        *(("a flow that disperses", *profile_limits(*profile)) for profile in of_flows),
        *((chain.name, *chain_limits(chain, whole.scales)) for chain in kept),
    ]
    limits += [(first, last) for _, first, last in beside]
    low = min(chosen.delay, *(ends[0] for ends in limits))
    high = max(chosen.delay, *(ends[1] for ends in limits))
    if endless := still_improving(tanks):
        low = whole.scales.earliest
    out = bool(flows) and min(flow.excess for flow in flows) > _OUT_OF_QUESTION
    like_flow = choice.chain is not None and not out and chosen.structure.order >= _LIKE_A_FLOW
    if like_flow:
        low = min(low, max(chosen.delay - flow_lead(chosen.poles), whole.scales.earliest))
    open_start = onset is not None and choice.flow is None and chosen.structure.zeros > 0
    if onset is not None and open_start:
        low, high = _opened(low, high, chosen.delay, onset, whole.scales)
    ends = profile_limits(*own)
    interval = (low, high, (ends[1] - ends[0]) / 3.92)
    found = assembled(whole, chosen, adequate, (), profiles, interval, own)
    return replace(
        found,
        chain=choice.chain.name if choice.chain else "",
        beside=tuple(beside),
        endless=endless,
        like_flow=like_flow,
        open_start=open_start,
        flows=tuple(seen),
        follows_flow=choice.flow is not None,
    )


def _among_lags(whole: WindowFit, tanks: Sequence[LagChain]) -> _Choice:
    """Choose between the structures and the chains."""
    best = whole.best
    level = whole.criterion[best.structure] + needless_charge(best.structure)
    better = min(tanks, key=lambda chain: chain.criterion, default=None)
    if better is not None and better.criterion < level:
        return _Choice(better.candidate, better.criterion, better)
    return _Choice(best, level)


def _with_flow(whole: WindowFit, lags: _Choice, flows: Sequence[DispersedFlow]) -> _Choice:
    """Take the delay of a flow that fits clearly better, if lags behind it can follow it."""
    flow = min(flows, key=lambda flow: flow.criterion, default=None)
    if flow is None or flow.criterion >= lags.level:
        return lags
    limit = flow.cost + PLAUSIBLE * whole.variance
    pinned = replace(whole.scales, earliest=flow.delay, latest=flow.delay)
    behind = search(whole.problem, _BEHIND_A_FLOW, pinned)
    # They need not be worth their number: it is known what they stand for.
    behind = {structure: model for structure, model in behind.items() if model.cost <= limit}
    if not behind:
        return lags
    model = behind[choose(whole.criteria(behind))]
    return _Choice(model, flow.criterion, flow=flow)


def _opened(
    low: float, high: float, delay: float, onset: float, scales: Scales
) -> tuple[float, float]:
    """Widen an interval by what is open where a zero imitates the beginning."""
    unseen = _UNSEEN * max(onset - delay, scales.dt)
    return (
        min(low, max(delay - unseen, scales.earliest)),
        max(high, min(onset + scales.dt, scales.latest)),
    )


def _not_ruled_out(
    whole: WindowFit,
    choice: _Choice,
    chains: Sequence[LagChain],
    flows: Sequence[DispersedFlow],
    more: float,
) -> tuple[list[Structure], list[LagChain], list[DispersedFlow]]:
    """List the structures, chains and flows that the data cannot rule out beside the chosen one.

    `more` is charged for every parameter.
    """
    charged = {s: value + more * (s.order + s.zeros) for s, value in whole.criterion.items()}
    level = choice.level + more * choice.parameters
    free = plausible(whole.candidates, charged, whole.variance, choice.model, level)
    limit = level + PLAUSIBLE
    kept = [chain for chain in chains if chain.criterion + more * FREE_IN_A_CHAIN <= limit]
    seen = [flow for flow in flows if flow.criterion + more * flow.parameters <= limit]
    return free, kept, seen


def chains_of(whole: WindowFit) -> list[LagChain]:
    """Chains of lags, where so many lags show that there may be more than were tried."""
    best = whole.best
    setting = whole.problem, best, whole.scales, whole.variance, whole.penalty
    tanks = fit_chains(*setting) if best.structure.order >= _LAGS_OF_TANKS else []
    diffusion = fit_diffusion(*setting) if best.structure.order >= _LAGS_OF_DIFFUSION else []
    return tanks + diffusion


def flows_of(whole: WindowFit, chains: Sequence[LagChain]) -> list[DispersedFlow]:
    """Flows that disperse, where more than one lag shows."""
    best = whole.best
    if best.structure.order < _LAGS_OF_DIFFUSION:
        return []
    level = min(*whole.criterion.values(), *(chain.criterion for chain in chains))
    return fit_flows(whole.problem, best, whole.scales, whole.variance, whole.penalty, level)


def _with_chain(whole: WindowFit, chain: LagChain) -> WindowFit:
    structure = chain.candidate.structure
    return replace(
        whole,
        candidates=whole.candidates | {structure: chain.candidate},
        criterion=whole.criterion | {structure: chain.criterion},
    )
