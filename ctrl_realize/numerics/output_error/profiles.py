"""Profiles of the dead time of several structures of one record.

Profile likelihoods [1]_; which ends are solved for, and that a profile which leads below a minimum
is followed there, are rules of our own.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from ..arrays import FloatArray
from ..engine.compared_fits import settled
from ..engine.problem import Structure
from ..engine.profile import (
    Points,
    dead_time_profile,
    profile_curve,
    profile_limits,
    profile_points,
    with_ends,
    without_points,
)
from ..engine.structures import Candidate
from ..engine.window_fit import WindowFit
from ..rules import Rule

LOWER = 0.01
"""Variances by which a profile must lead below a minimum to be followed.

Ablation: profiles followed below a minimum."""
_ROUGHLY = 0.05  # of an interval, by which ends between the points of a profile may be wrong

Profile: TypeAlias = tuple[FloatArray, FloatArray]
"""Dead times, and the misfit at each; see `dead_time_profile`."""


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
