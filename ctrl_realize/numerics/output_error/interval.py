"""Dead time and interval for a residual at noise level: all models that are not ruled out.

Point 2 of the rule in `output_error`.

Profile likelihoods [1]_ of all structures within a difference of criteria [2]_; joining them
instead of using only the best one follows [3]_. `_UNSEEN` and the widening for a zero are our
own: a zero can imitate the onset of a response, so that only the visible onset is known.

Which ends are solved for, and that a profile which leads below a minimum is followed there, are
rules of our own, too.

A stem behind the lags may have come loose later. One that sticks slips towards the demand of the
lags once that has gone far enough [4]_. From then on the output consists of the modes of the lags,
with any weights, and it begins with a jump: a structure with as many zeros as poles. Structures of
relative degree 1 cannot jump, and begin a little earlier.

This alternative is ruled out as structures are [2]_, and its end is that of a profile likelihood
[1]_. Behind two lags, S and J are all that it has more: there it is kept while it fits no worse
than the lags alone, as one lag more is. Ablation: friction behind lags.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
.. [3] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, chapter 4 (Multimodel inference), doi:10.1007/b97636.
.. [4] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, Modelling valve stiction, Control
   Engineering Practice 13 (2005) 641-658, doi:10.1016/j.conengprac.2004.05.005.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..constants import VERY_STRONG, Z_95
from ..engine.descend import descend
from ..engine.problem import Structure
from ..engine.profile import (
    Points,
    Profile,
    dead_time_profile,
    profile_curve,
    profile_limits,
    profile_points,
    with_ends,
    without_points,
)
from ..engine.structures import (
    Candidate,
    charged,
    least_charge,
    parameter_bounds,
    plausible,
    settled,
)
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
from .result import DelayInterval, DistributedLags, OtherModel, OutputErrorEstimate, assembled
from .selection import (
    Choice,
    CloseDecision,
    choose_model,
    close_choices,
    close_exclusions,
    least_extrapolating,
)

_UNSEEN = 3.0
"""How far before the dead time a beginning that is open may lie, in times from there to the first
motion. Diffusion behind lags and parallel paths mostly need 1 to 3. Ablation: open beginning behind
a zero."""

MOST_ROUNDS = 6
"""In which profiles are laid anew where they lead below a minimum."""
LOWER = 0.01
"""Variances by which a profile must lead below a minimum to be followed.

Ablation: profiles followed below a minimum."""
_ROUGHLY = 0.05  # of an interval, by which ends between the points of a profile may be wrong

_S_AND_J = 2  # parameters of friction; behind a single lag the dead time takes the place of one
_POINTS = 16  # dead times at which the friction is tried: time


def latest_slip(fits: WindowFit, lags: Candidate) -> float | None:
    """Latest time in s at which a stem behind lags may have come loose.

    Parameters
    ----------
    fits : WindowFit
    lags : Candidate
        The chosen structure, without zeros.

    Returns
    -------
    float or None
        Upper end of its 95 % interval, or where it fits as well as the lags; None if friction is
        ruled out, or the visible onset is at the dead time of the lags.
    """
    scales = fits.scales
    first, last = lags.dead_time, scales.latest
    count = min(int((last - first) / scales.dt) + 1, _POINTS)
    if count < 2:
        return None
    slips = Structure(lags.structure.order, 0)
    grid = np.linspace(first, last, count + 1)[1:]
    starts = np.tile(lags.parameters, (count, 1))
    starts[:, 0] = grid
    box = parameter_bounds(slips, scales)
    costs = descend(fits.problem, slips, starts, box, scales.dt, dead_time_fixed=True)[1]
    gained = (lags.cost - costs.min()) / fits.variance
    charge = max(slips.zeros, _S_AND_J) * least_charge(fits.penalty)
    if charge - gained <= VERY_STRONG:
        return profile_limits(grid, (costs - costs.min()) / fits.variance)[1]
    if slips.zeros != _S_AND_J:
        return None  # the modes of more lags can do more than slip
    # Noise hides friction as it hides lags, and does not remove it.
    alike = grid[costs <= lags.cost]
    return float(alike[-1]) if alike.size else None


def profile_of(fits: WindowFit, candidate: Candidate) -> Profile:
    """Misfit over the dead time of one candidate of a window."""
    return dead_time_profile(fits.problem, candidate, fits.variance, fits.scales)


def laid_profiles(fits: WindowFit, structures: Sequence[Structure]) -> dict[Structure, Points]:
    """Profile points of structures, from their minima."""
    setting = fits.variance, fits.scales
    return {s: profile_points(fits.problem, fits.candidates[s], *setting) for s in structures}


def solved_profiles(
    fits: WindowFit, points: dict[Structure, Points], chosen: Structure
) -> dict[Structure, Points]:
    """Profile points, with the ends of the intervals that may be ends of all of them.

    Between the points of a profile its ends are known to a few parts in a hundred; those of the
    chosen structure, those that lie as far out as any, and those without a point near them are
    solved for.
    """
    setting = fits.variance, fits.scales
    profiles = curves(fits, points)
    limits = {s: profile_limits(*profile) for s, profile in profiles.items()}
    # None are left where a dispersed flow rules out every structure.
    low = min((first for first, _ in limits.values()), default=np.inf)
    high = max((last for _, last in limits.values()), default=-np.inf)
    found = dict(points)
    for s, (first, last) in limits.items():
        margin = _ROUGHLY * (last - first)
        lower, upper = without_points(dict(zip(*profiles[s], strict=True)))
        ends = (
            s == chosen or lower or first - margin <= low,
            s == chosen or upper or last + margin >= high,
        )
        if any(ends):
            found[s] = with_ends(fits.problem, points[s], *setting, ends)
    return found


def curves(fits: WindowFit, points: dict[Structure, Points]) -> dict[Structure, Profile]:
    """Misfit over the dead time of structures with these profile points."""
    setting = fits.variance, fits.scales
    return {s: profile_curve(own, fits.candidates[s], *setting) for s, own in points.items()}


def lower_minima(fits: WindowFit, points: dict[Structure, Points]) -> dict[Structure, Candidate]:
    """Minima to which profiles lead that are lower than those that the searches have found."""
    found = {}
    for s, own in points.items():
        best = min(own.values(), key=lambda point: point.cost)
        if fits.candidates[s].cost - best.cost > LOWER * fits.variance and Rule.LOWER.on:
            found[s] = settled(fits.problem, best, fits.scales)
    return found


def likelihood_fit(
    fits: WindowFit,
    *,
    adequate: bool,
    chains: Sequence[LagChain] = (),
    flows: Sequence[DispersedFlow] = (),
    follow: bool = True,
    onset: float | None = None,
    may_stick: bool = False,
    near: tuple[CloseDecision, ...] = (),
) -> OutputErrorEstimate:
    """Determine dead time and interval from the likelihood.

    With `follow` dispersion may be the model; otherwise it widens the interval only. `onset` is the
    time of the visible onset; without it the structures are used alone. With `may_stick` the
    interval reaches to where a stem behind the lags may come loose. `near` are close decisions made
    before.
    """
    equal_lags = [chain for chain in chains if not chain.truncated]
    fits, choice, points = _compared(fits, equal_lags, flows if follow else ())
    chosen, scales = choice.model, fits.scales
    profiles = curves(fits, points)
    more = least_charge(fits.penalty) - fits.penalty
    limit = charged_level(fits, choice) + VERY_STRONG
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
    if unlimited := still_improving(equal_lags, min(fits.criterion.values())):
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
        close += close_exclusions(fits, charged_level(fits, choice), chosen.structure)
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
        level = charged_level(fits, choice)
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


def charged_level(fits: WindowFit, choice: Choice) -> float:
    """Value of the criterion relative to which structures are ruled out."""
    return choice.level + (least_charge(fits.penalty) - fits.penalty) * choice.parameters
