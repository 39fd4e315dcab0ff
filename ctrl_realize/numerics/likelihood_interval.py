"""Delay and interval where the residual is noise: of all structures that are not ruled out.

Points 2 and, for the choice of the model, 1 of the rule in `output_error`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .arrays import ComplexArray
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
    needless_charge,
    plausible,
)

_UNSEEN = 3.0
"""How far before the delay a beginning that is open may lie, in times from there to the first
motion. Flows that disperse, diffusion behind lags and parallel paths mostly need 1 to 3."""

_LAGS_OF_TANKS, _LAGS_OF_DIFFUSION = 3, 2
"""Poles from which on there may be more lags than show; the second mode of diffusion is fast."""

LIKE_A_FLOW = 6
"""Lags of a chain from which on no step tells it from a flow that disperses."""


def flow_lead(poles: ComplexArray) -> float:
    r"""Time by which a flow that disperses begins before a chain of lags that looks like it, in s.

    n lags of T have the cumulants nT, nT^2, 2nT^3, 6nT^4 in time; a residence time with an inverse
    Gaussian distribution of mean m and shape l has m, m^3/l, 3m^5/l^2, 15m^7/l^3. With m = 1.5 nT
    behind half of nT less dead time the first three are equal and the fourth differs by a ninth.
    """
    return 0.5 * float(np.sum(1 / np.abs(poles)))


def likelihood_fit(
    whole: WindowFit,
    *,
    adequate: bool,
    chains: Sequence[LagChain] = (),
    onset: float | None = None,
) -> OutputErrorFit:
    """Take delay and interval from the likelihood (points 1 and 2 of the rule).

    `onset` is the time of the first motion; without it the structures are believed.
    """
    chosen = whole.best
    level = whole.criterion[chosen.structure] + needless_charge(chosen.structure)
    # Diffusion widens the interval and is never the model: friction, too, looks like it.
    tanks = [chain for chain in chains if not chain.hidden]
    better = min(tanks, key=lambda chain: chain.criterion, default=None)
    if better is not None and better.criterion < level:
        chosen, level = better.candidate, better.criterion
    is_chain = better is not None and chosen is better.candidate
    free, kept = _not_ruled_out(whole, chosen, level, chains, is_chain=is_chain)
    profiles = {s: profile_of(whole, whole.candidates[s]) for s in free}
    limits = [profile_limits(*profile) for profile in profiles.values()]
    limits += [chain_limits(chain, whole.scales) for chain in kept]
    chain = ""
    if better is not None and is_chain:
        whole = _with_chain(whole, better)
        chain = f"chain of {chosen.structure.order} nearly equal lags"
        profiles[chosen.structure] = chain_profile(better, whole.scales)
    low = min(chosen.delay, *(ends[0] for ends in limits))
    high = max(chosen.delay, *(ends[1] for ends in limits))
    own = profile_limits(*profiles[chosen.structure])
    if endless := still_improving(tanks):
        low = whole.scales.earliest
    if chain and chosen.structure.order >= LIKE_A_FLOW:
        low = min(low, max(chosen.delay - flow_lead(chosen.poles), whole.scales.earliest))
    open_start = onset is not None and chosen.structure.zeros > 0
    if onset is not None and open_start:
        low, high = _opened(low, high, chosen.delay, onset, whole.scales)
    interval = (low, high, (own[1] - own[0]) / 3.92)
    found = assembled(whole, chosen, adequate, (), profiles, interval)
    return replace(found, chain=chain, endless=endless, open_start=open_start)


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
    chosen: Candidate,
    level: float,
    chains: Sequence[LagChain],
    *,
    is_chain: bool,
) -> tuple[list[Structure], list[LagChain]]:
    """List the structures and chains that the data cannot rule out beside the chosen one."""
    more = max(LEAST_CHARGE - whole.penalty, 0.0)
    charged = {s: value + more * (s.order + s.zeros) for s, value in whole.criterion.items()}
    of_chain = more * FREE_IN_A_CHAIN
    own = chosen.structure
    level += of_chain if is_chain else more * (own.order + own.zeros)
    free = plausible(whole.candidates, charged, whole.variance, chosen, level)
    return free, [chain for chain in chains if chain.criterion + of_chain <= level + PLAUSIBLE]


def chains_of(whole: WindowFit) -> list[LagChain]:
    """Chains of lags, where so many lags show that there may be more than were tried."""
    best = whole.best
    setting = whole.problem, best, whole.scales, whole.variance, whole.penalty
    tanks = fit_chains(*setting) if best.structure.order >= _LAGS_OF_TANKS else []
    diffusion = fit_diffusion(*setting) if best.structure.order >= _LAGS_OF_DIFFUSION else []
    return tanks + diffusion


def _with_chain(whole: WindowFit, chain: LagChain) -> WindowFit:
    structure = chain.candidate.structure
    return replace(
        whole,
        candidates=whole.candidates | {structure: chain.candidate},
        criterion=whole.criterion | {structure: chain.criterion},
    )
