"""Structures none of whose lags is faster than a given one.

Real poles have logarithms of rates as parameters, paired as in `shaped`, so that a fastest lag is a
bound of each; a pair that oscillates has omega and zeta. The numerator remains free and is
eliminated by the engine. A fit with bounds follows [1]_.

References
----------
.. [1] J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section 16.7
   (bound constraints), doi:10.1007/978-0-387-40065-5.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..constants import CHI2_95
from ..engine.eliminate import eliminate
from ..engine.problem import Bounds, Mapped, Problem
from ..engine.static_gain import local_errors
from ..engine.structures import LEAST_DAMPING, SLOWEST, SLOWEST_PAIR, Candidate
from ..engine.window_fit import WindowFit
from .shaped import MappedFamily, lowest, paired

_APART = 0.03  # in logarithm: poles that are nearly equal have no derivatives by differences


@dataclass(frozen=True, eq=False)
class SlowLags(MappedFamily):
    """Poles over x = (dead time, log rates of real ones, log omega and log zeta of pairs)."""

    pairs: int
    length: float

    def mapped(self, parameters: FloatArray) -> Mapped:
        """Models at parameters (B, 1 + n), and their derivatives."""
        x, every = parameters, np.tile(np.eye(parameters.shape[1]), (len(parameters), 1, 1))
        real = slice(1, x.shape[1] - 2 * self.pairs)
        theta, slopes = paired(x[:, real], every[:, real])
        return Mapped(
            np.concatenate([x[:, :1], theta, x[:, real.stop :]], axis=1),
            np.concatenate([every[:, :1], slopes, every[:, real.stop :]], axis=1),
        )

    def directions(self, problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions of the structure without bounds, about lags that are just not equal."""
        rates = x[1 : x.size - 2 * self.pairs]
        rank = np.argsort(np.argsort(rates)) - (rates.size - 1) / 2
        moved = np.concatenate([x[:1], rates + _APART * rank, x[1 + rates.size :]])
        free = Candidate(self.plain, self.theta(moved), 0.0)
        numerator = eliminate(problem, free.structure, free.parameters[None]).numerator[0]
        errors = local_errors(problem, free, numerator, self.length)
        own = np.linalg.qr(errors.own)[0]
        slopes = errors.slopes - own @ (own.T @ errors.slopes)
        return slopes, np.eye(slopes.shape[1])


def fit_slow_lags(
    fits: WindowFit, like: Candidate, others: Iterable[Candidate], fastest: float
) -> Candidate:
    """Fit a structure without lags that are faster.

    Parameters
    ----------
    fits : WindowFit
        Its data and noise: poles are a pair if that is significantly better than real ones.
    like : Candidate
        Fit of the structure without that bound.
    others : iterable of Candidate
        Fits of structures of lower order, from which the search starts as well.
    fastest : float
        Fastest lag in s, and 1 / omega of pairs.
    """
    real = _lowest(fits, like, [like, *others], 0, fastest)
    pairs = int(np.count_nonzero(like.poles.imag > 0))
    if not pairs:
        return real
    swinging = _lowest(fits, like, [like], pairs, fastest)
    return swinging if real.cost - swinging.cost > CHI2_95 * fits.variance else real


def _lowest(
    fits: WindowFit, like: Candidate, starts: Iterable[Candidate], pairs: int, fastest: float
) -> Candidate:
    """Best model with so many pairs that oscillate; missing lags start as the fastest."""
    structure, scales, most = like.structure, fits.scales, float(-np.log(fastest))
    real = structure.order - 2 * pairs
    slow, swing = np.log(np.array([SLOWEST, SLOWEST_PAIR]) / scales.length)
    low = [scales.earliest, *[slow] * real, *[swing, np.log(LEAST_DAMPING)] * pairs]
    high = [scales.latest, *[most] * real, *[most, 0.0] * pairs]
    tried = []
    for one in starts:
        alone = one.poles if not pairs else one.poles[one.poles.imag == 0]
        rates = np.sort(np.log(np.abs(alone)))
        kept = np.minimum(np.append(rates, np.full(real - rates.size, most)), most)
        swinging = one.poles[one.poles.imag > 0] if pairs else one.poles[:0]
        shape = [part for p in swinging for part in np.log([np.abs(p), -p.real / np.abs(p)])]
        # Slower lags take the place of dead time.
        less = float(np.exp(-kept).sum() - np.exp(-rates).sum())
        tried += [[one.dead_time - part * less, *kept, *shape] for part in (0, 1)]
    bounds = Bounds(np.array(low), np.array(high))
    order, degree = structure.order, structure.relative_degree
    family = SlowLags(order, degree, bounds, pairs, scales.length)
    return lowest(fits.problem, family, np.array(tried), scales.dt)
