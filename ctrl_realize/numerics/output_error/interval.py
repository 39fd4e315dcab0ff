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
from dataclasses import replace

from ..constants import VERY_STRONG, Z_95
from ..engine.problem import Structure
from ..engine.profile import Points, profile_limits
from ..engine.structures import charged, least_charge, plausible
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
from .profiles import curves, laid_profiles, lower_minima, profile_of, solved_profiles
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
    fits, choice, points = _compared(fits, equal_lags, flows)
    chosen, scales = choice.model, fits.scales
    profiles = curves(fits, points)
    more = least_charge(fits.penalty) - fits.penalty
    limit = _charged_level(fits, choice) + VERY_STRONG
    flows = [flow for flow in flows if flow.criterion + more * flow.parameters <= limit]
    chains = [chain for chain in chains if chain.criterion + more * FREE_IN_A_CHAIN <= limit]
    of_flows = [profile_of(fits, flow.fit) for flow in flows]
    pairs = zip(flows, of_flows, strict=True)
    others = [OtherModel(flow, *profile_limits(*profile)) for flow, profile in pairs]
    others += [OtherModel(chain, *chain_limits(chain, scales)) for chain in chains]
    if choice.chain is not None:
        profiles[chosen.structure] = chain_profile(choice.chain, scales)
        criterion = fits.criterion | {chosen.structure: choice.chain.criterion}
        candidates = fits.candidates | {chosen.structure: chosen}
        fits = replace(fits, candidates=candidates, criterion=criterion)
    own = profiles[chosen.structure] if choice.flow is None else of_flows[flows.index(choice.flow)]
    limits = [profile_limits(*profile) for profile in profiles.values()]
    limits += [(other.low, other.high) for other in others]
    low = min(chosen.dead_time, *(first for first, _ in limits))
    high = max(chosen.dead_time, *(last for _, last in limits))
    if unlimited := still_improving(equal_lags) and Rule.IMPROVING.on:
        low = scales.earliest
    open_start = onset is not None and choice.flow is None and chosen.structure.zeros > 0
    if onset is not None and open_start and Rule.OPEN_START.on:
        # A zero can imitate the onset.
        unseen = _UNSEEN * max(onset - chosen.dead_time, scales.dt)
        low = min(low, max(chosen.dead_time - unseen, scales.earliest))
        high = max(high, min(onset + scales.dt, scales.latest))
    free = choice.chain is None and choice.flow is None
    if may_stick and free and not chosen.structure.zeros and Rule.FRICTION.on:
        high = max(high, latest_slip(fits, chosen) or high)
    first, last = profile_limits(*own)
    interval = DelayInterval(low, high, (last - first) / (2 * Z_95))
    static, close = None, near
    if free:
        close += close_choices(fits, choice.level, chosen.structure)
        close += close_exclusions(fits, _charged_level(fits, choice), chosen.structure)
        chosen, static = least_extrapolating(fits, chosen)
    found = assembled(fits, chosen, adequate, (), profiles, interval, own, static=static)
    distributed = DistributedLags(
        choice.chain, unlimited, tuple(flows), choice.flow is not None, tuple(others)
    )
    return replace(
        found,
        process=found.process if free else found.process.without_errors(),
        distributed=distributed,
        open_start=open_start,
        close=close,
        points=points,
    )


def _compared(
    fits: WindowFit, equal_lags: Sequence[LagChain], flows: Sequence[DispersedFlow]
) -> tuple[WindowFit, Choice, dict[Structure, Points]]:
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
    return fits, choice, kept


def _charged_level(fits: WindowFit, choice: Choice) -> float:
    """Value of the criterion relative to which structures are ruled out."""
    return choice.level + (least_charge(fits.penalty) - fits.penalty) * choice.parameters
