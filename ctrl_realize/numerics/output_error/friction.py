"""Static friction behind the lags: how late a stem may have come loose.

A stem that sticks slips towards the demand of the lags once that has gone far enough [1]_. From
then on the output consists of the modes of the lags, with any weights, and it begins with a jump:
a structure with as many zeros as poles. Structures of relative degree 1 cannot jump, and begin a
little earlier.

This alternative is ruled out as structures are [2]_, and its end is that of a profile likelihood
[3]_. Behind two lags, S and J are all that it has more: there it is kept while it fits no worse
than the lags alone, as one lag more is. Ablation: friction behind lags.

References
----------
.. [1] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, Modelling valve stiction, Control
   Engineering Practice 13 (2005) 641-658, doi:10.1016/j.conengprac.2004.05.005.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
.. [3] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

import numpy as np

from ..constants import VERY_STRONG
from ..engine.descend import descend
from ..engine.problem import Structure
from ..engine.profile import profile_limits
from ..engine.structures import Candidate, least_charge, parameter_bounds
from ..engine.window_fit import WindowFit

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
