"""Dead time and interval for a residual at noise level: all models that are not ruled out.

Point 2 of the rule in `output_error`.

Profile likelihoods [1]_ of all structures within a difference of criteria [2]_; joining them
instead of using only the best one follows [3]_. `_UNSEEN` and the widening for a zero are our
own: a zero can imitate the onset of a response, so that only the visible onset is known.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
.. [3] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, chapter 4 (Multimodel inference), doi:10.1007/b97636.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..constants import VERY_STRONG, Z_95
from ..engine.problem import Structure
from ..engine.profile import Points, profile_limits
from ..engine.structures import Scales, charged, least_charge, plausible
from ..engine.window_fit import WindowFit
from ..families.equal_lags import (
    FREE_IN_A_CHAIN,
    LagChain,
    chain_limits,
    chain_profile,
    still_improving,
)
from ..families.flow import DispersedFlow
from ..rules import Rule
from .extrapolation import least_extrapolating
from .friction import latest_slip
from .margins import CloseDecision, close_choices, close_exclusions
from .profiles import Profile, curves, laid_profiles, lower_minima, profile_of, solved_profiles
from .result import DelayInterval, DistributedLags, OtherModel, OutputErrorEstimate, assembled
from .selection import Choice, choose_model

_UNSEEN = 3.0
"""How far before the dead time a beginning that is open may lie, in times from there to the first
motion. Diffusion behind lags and parallel paths mostly need 1 to 3. Ablation: open beginning behind
a zero."""

MOST_ROUNDS = 6
"""In which profiles are laid anew where they lead below a minimum."""


def likelihood_fit(
    fits: WindowFit,
    *,
    adequate: bool,
    chains: Sequence[LagChain] = (),
    flows: Sequence[DispersedFlow] = (),
    onset: float | None = None,
    may_stick: bool = False,
    near: tuple[CloseDecision, ...] = (),
) -> OutputErrorEstimate:
    """Determine dead time and interval from the likelihood.

    `onset` is the time of the visible onset; without it the structures are used alone. With
    `may_stick` the interval reaches to where a stem behind the lags may come loose. `near`
    are close decisions made before.
    """
    equal_lags = [chain for chain in chains if not chain.truncated]
    fits, choice, kept = _compared(fits, equal_lags, chains, flows)
    chosen, scales = choice.model, fits.scales
    own = kept.profile_of(choice, scales)
    if choice.chain is not None:
        fits = _with_chain(fits, choice.chain)
        kept.profiles[chosen.structure] = own
    others = kept.other_models(scales)
    limits = [profile_limits(*profile) for profile in kept.profiles.values()]
    limits += [(other.low, other.high) for other in others]
    low = min(chosen.dead_time, *(first for first, _ in limits))
    high = max(chosen.dead_time, *(last for _, last in limits))
    if unlimited := still_improving(equal_lags) and Rule.IMPROVING.on:
        low = scales.earliest
    open_start = onset is not None and choice.flow is None and chosen.structure.zeros > 0
    if onset is not None and open_start and Rule.OPEN_START.on:
        low, high = _opened(low, high, chosen.dead_time, onset, scales)
    free = choice.chain is None and choice.flow is None
    if may_stick and free and not chosen.structure.zeros and Rule.FRICTION.on:
        high = max(high, latest_slip(fits, chosen) or high)
    first, last = profile_limits(*own)
    interval = DelayInterval(low, high, (last - first) / (2 * Z_95))
    static = None
    if free:
        chosen, static = least_extrapolating(fits, chosen)
    found = assembled(fits, chosen, adequate, (), kept.profiles, interval, own, static=static)
    close: tuple[CloseDecision, ...] = near
    if free:
        own_structure = chosen.structure
        close += close_choices(fits, choice.level, own_structure)
        close += close_exclusions(fits, _charged_level(fits, choice), own_structure)
    process = found.process
    if not free:
        process = process.without_errors()
    distributed = DistributedLags(
        choice.chain,
        unlimited,
        tuple(flow for flow, _ in kept.flows),
        choice.flow is not None,
        tuple(others),
    )
    return replace(
        found,
        process=process,
        distributed=distributed,
        open_start=open_start,
        close=close,
        points=kept.points,
    )


@dataclass(frozen=True, eq=False)
class _Kept:
    """Models that the data cannot rule out: structures, dispersion and chains, with profiles."""

    profiles: dict[Structure, Profile]
    flows: list[tuple[DispersedFlow, Profile]]
    chains: list[LagChain]
    points: dict[Structure, Points]

    def profile_of(self, choice: Choice, scales: Scales) -> Profile:
        """Misfit over the dead time for the chosen model."""
        if choice.chain is not None:
            return chain_profile(choice.chain, scales)
        for flow, profile in self.flows:
            if flow is choice.flow:
                return profile
        return self.profiles[choice.model.structure]

    def other_models(self, scales: Scales) -> list[OtherModel]:
        """Models other than the structures, with their intervals."""
        flows = (OtherModel(flow, *profile_limits(*profile)) for flow, profile in self.flows)
        chains = (OtherModel(chain, *chain_limits(chain, scales)) for chain in self.chains)
        return [*flows, *chains]


def _compared(
    fits: WindowFit,
    equal_lags: Sequence[LagChain],
    chains: Sequence[LagChain],
    flows: Sequence[DispersedFlow],
) -> tuple[WindowFit, Choice, _Kept]:
    """Choose, and lay the profiles of what is not ruled out: again where these lead lower."""
    points: dict[Structure, Points] = {}
    for _ in range(MOST_ROUNDS):
        choice = choose_model(fits, equal_lags, flows)
        values = charged(fits.criterion, fits.penalty)
        level = _charged_level(fits, choice)
        free = plausible(fits.candidates, values, fits.variance, choice.model, level)
        free = [s for s in free if fits.candidates[s] is choice.model or Rule.STRUCTURES.on]
        points |= laid_profiles(fits, [s for s in free if s not in points])
        kept = {s: points[s] for s in free}
        lower = lower_minima(fits, kept)
        if not lower:
            kept = solved_profiles(fits, kept, choice.model.structure)
            lower = lower_minima(fits, kept)
        if not lower:
            break
        fits = fits.of(fits.candidates | lower)
        points = {s: own for s, own in points.items() if s not in lower}
    return fits, choice, _not_ruled_out(fits, choice, chains, flows, kept)


def _not_ruled_out(
    fits: WindowFit,
    choice: Choice,
    chains: Sequence[LagChain],
    flows: Sequence[DispersedFlow],
    points: dict[Structure, Points],
) -> _Kept:
    more = least_charge(fits.penalty) - fits.penalty
    limit = _charged_level(fits, choice) + VERY_STRONG
    return _Kept(
        curves(fits, points),
        [
            (flow, profile_of(fits, flow.fit))
            for flow in flows
            if flow.criterion + more * flow.parameters <= limit
        ],
        [chain for chain in chains if chain.criterion + more * FREE_IN_A_CHAIN <= limit],
        points,
    )


def _charged_level(fits: WindowFit, choice: Choice) -> float:
    """Value of the criterion relative to which structures are ruled out."""
    return choice.level + (least_charge(fits.penalty) - fits.penalty) * choice.parameters


def _opened(
    low: float, high: float, dead_time: float, onset: float, scales: Scales
) -> tuple[float, float]:
    """Widen an interval for a zero that can imitate the onset."""
    unseen = _UNSEEN * max(onset - dead_time, scales.dt)
    return (
        min(low, max(dead_time - unseen, scales.earliest)),
        max(high, min(onset + scales.dt, scales.latest)),
    )


def _with_chain(fits: WindowFit, chain: LagChain) -> WindowFit:
    structure = chain.candidate.structure
    return replace(
        fits,
        candidates=fits.candidates | {structure: chain.candidate},
        criterion=fits.criterion | {structure: chain.criterion},
    )
