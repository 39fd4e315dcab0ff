"""Extrapolate as little as the data allow where they do not determine the gain.

A pole far slower than the record stands for a drift that began with the response. Its time constant
has no upper limit, and the gain of the best fit may be any number. The profile likelihood [1]_ of
that pole tells the fastest one that is not ruled out; with it the model fits as well, and its gain
is close to what was observed. Of all solutions within the error of the data, Phillips [2]_ takes
the smoothest in the same way. Ablation: least extrapolation.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
.. [2] D. L. Phillips, A technique for the numerical solution of certain integral equations of the
   first kind, J. ACM 9 (1962) 84-97, doi:10.1145/321105.321114.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..constants import CHI2_95
from ..engine.descend import descend
from ..engine.modal import parameters_from_poles, poles_from_parameters
from ..engine.newton import settle
from ..engine.problem import Family, KnownFactor, Structure
from ..engine.static_gain import StaticGain
from ..engine.structures import Candidate, parameter_bounds
from ..engine.window_fit import WindowFit
from ..rules import Rule

_FASTEST = 4.0  # over the length of the record: 2 % of such a mode are left at its end
_BENDS = 0.6
"""Over the length of the record: a slower pole is no other plant than an integrator. Of 12 plants
that integrate, and were found to, none became a lag."""
_RATIO = 2.0  # of the rates that are tried: time


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
