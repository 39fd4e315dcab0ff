"""Chains of many lags (tanks in series, diffusion) with three parameters.

The response of many lags is similar to that of fewer lags with a longer dead time. The free
structures have at most five poles; a chain may have more, because its rates follow a law. For tanks
in series they are nearly equal, as in Strejc's method: here, spread evenly around one rate. For
diffusion of heat or matter they grow as (k - c)^2, with c between 0 and 1/2 depending on the
boundaries.

Tanks follow [1]_, diffusion [2]_ (eigenvalues of a slab); the spread of the rates and the penalty
on a kind of chain are our own.

References
----------
.. [1] V. Strejc, Naherungsverfahren fur aperiodische Ubergangscharakteristiken, Regelungstechnik 7
   (1959) 124-128.
.. [2] H. S. Carslaw and J. C. Jaeger, Conduction of Heat in Solids, 2nd ed., Oxford University
   Press 1959, chapter 3 (Linear flow of heat in the solid bounded by two parallel planes).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray
from ..constants import Z_95
from ..engine.eliminate import eliminate
from ..engine.modal import lag_sum
from ..engine.problem import Bounds, Mapped, Problem, Structure
from ..engine.profile import dead_time_error
from ..engine.structures import Candidate, Scales
from ..engine.window_fit import WindowFit
from ..rules import Rule
from .shaped import LagFamily, lowest, paired

SHORTEST, LONGEST = 4, 8
"""Shorter ones have few parameters when they are free; of longer ones rounding shows."""

FREE_IN_A_CHAIN = 2
"""Parameters beside dead time and gain: the lag, and how many; the shape is bounded."""

_DIFFUSION_CHARGE = 8.0
"""Two lags far apart look like diffusion, and are more common. Ablation: charge for diffusion."""
_WORSE = 100.0  # in the criterion: a longer chain will not come back from there in a few lags


@dataclass(frozen=True, eq=False)
class LagChain:
    """Best fit of a chain of lags, with the standard error of its dead time in s.

    `criterion` includes the penalty on the kind of chain. `truncated` is the sum of the lags, in s,
    of the law beyond those fitted: they are too fast to be visible in a record, and part of the
    dead time.
    """

    candidate: Candidate
    criterion: float
    error: float
    truncated: float = 0.0


@dataclass(frozen=True)
class _Law:
    """Law of the rates of a chain, and the bounds of the shape.

    ``rates(order, shape)`` are logarithms of the rates (..., n), and their derivatives.
    """

    rates: Callable[[int, float | FloatArray], tuple[FloatArray, FloatArray]]
    low: float
    first: float
    high: float


def _spread_rates(order: int, square: float | FloatArray) -> tuple[FloatArray, FloatArray]:
    # The square of half the range, because the response is an even function of the range.
    half, away = np.sqrt(square), np.linspace(-1, 1, order)
    return np.log1p(half * away), away / (2 * half * (1 + half * away))


def _diffusion_rates(order: int, shift: float | FloatArray) -> tuple[FloatArray, FloatArray]:
    number = np.arange(1, order + 1) - shift
    return 2 * np.log(number / (1 - shift)), 2 / (1 - shift) - 2 / number


TANKS = _Law(_spread_rates, 0.08**2, 0.1**2, 0.5**2)  # partial fractions need distinct poles
_DIFFUSION = _Law(_diffusion_rates, 0.0, 0.25, 0.5)


@dataclass(frozen=True, eq=False)
class _Chain(LagFamily):
    """Lags that follow a law, over x = (dead time, logarithm of a lag, shape).

    After these there may be the logarithm of a lag in series.
    """

    law: _Law

    def mapped(self, parameters: FloatArray) -> Mapped:
        """Models at parameters (B, 3) or (B, 4), and their derivatives."""
        x, k = parameters, parameters.shape[1]
        within, by_shape = self.law.rates(self.order - k + 3, x[:, 2:3])
        rates = np.hstack([within - x[:, 1:2], -x[:, 3:]])
        slopes = np.zeros((*rates.shape, k))
        of_law, alone = slice(within.shape[1]), slice(within.shape[1], None)
        slopes[:, of_law, 1], slopes[:, of_law, 2], slopes[:, alone, 3:] = -1.0, by_shape, -1.0
        theta, dtheta = paired(rates, slopes)
        level = np.exp(np.sum(rates, axis=1, keepdims=True))
        first = np.tile(np.eye(1, k), (len(x), 1, 1))
        return Mapped(
            np.append(x[:, :1], theta, axis=1), np.append(first, dtheta, axis=1),
            level, level[:, :, None] * slopes.sum(axis=1, keepdims=True), self.gains,
        )  # fmt: skip


def fit_chains(fits: WindowFit) -> list[LagChain]:
    """Fit chains of four to eight lags, as long as the fit improves.

    Parameters
    ----------
    fits : WindowFit
        The best of them has the dead time and the spread in time (mean and variance of the impulse
        response) of the initial values.

    Returns
    -------
    list of LagChain
        Empty if the best fit has no positive spread, as with an inverse response.
    """
    chains: list[LagChain] = []
    moments = time_moments(fits.problem, fits.best)
    if not moments[1] > 0:
        return chains
    for order in range(SHORTEST, LONGEST + 1):
        chain, _ = _chain(fits, order, TANKS, moments)
        worse = bool(chains) and chain.criterion > chains[-1].criterion + _WORSE
        if worse or _over_within_a_sample(chain, fits.scales):
            break
        chains.append(chain)
    return chains


def free_lags(
    problem: Problem, scales: Scales, like: Candidate, orders: Sequence[int]
) -> Iterator[Candidate]:
    """Starts of so many lags without zeros: the best of them that are nearly equal.

    The initial values of the chains are those of a fit, as in `fit_chains`.
    """
    moments = time_moments(problem, like)
    for order in orders if moments[1] > 0 else ():
        chain = _lowest(problem, scales, order, TANKS, moments)
        yield Candidate(Structure(order, order), chain.theta, chain.cost)


def fit_diffusion(
    fits: WindowFit, modes: int = LONGEST, behind: Sequence[float] = ()
) -> list[LagChain]:
    """Fit the first modes of diffusion; see `fit_chains`. One chain, or none.

    With `behind` there is a lag in series, of which these are starts, over the spread of all.
    """
    moments = time_moments(fits.problem, fits.best)
    if not moments[1] > 0:
        return []
    chain, (_, log_lag, shape, *_) = _chain(fits, modes, _DIFFUSION, moments, behind)
    if _over_within_a_sample(chain, fits.scales):
        return []
    # The sum of 1 / (k - c)^2 beyond n is approximated by the integral from n + 1/2 - c on.
    truncated = float(np.exp(log_lag)) * (1 - shape) ** 2 / (modes + 0.5 - shape)
    charge = _DIFFUSION_CHARGE if Rule.DIFFUSION_CHARGE.on else 0.0
    return [replace(chain, criterion=chain.criterion + charge, truncated=truncated)]


def _over_within_a_sample(chain: LagChain, scales: Scales) -> bool:
    """Whether the lags are invisible in all samples, so that their curvature is rounding."""
    return float(np.sum(1 / np.abs(chain.candidate.poles))) < scales.dt


def still_improving(chains: Sequence[LagChain], least: float) -> bool:
    """Whether the fit would improve beyond the longest chain; `least` is the best criterion.

    Where the plant is a chain every lag improves the fit. Far from the best the excess of the
    criterion then falls faster and faster, towards the length of the plant; that of another plant
    levels off at what no chain explains. Near it a parabola of the last three tells.
    """
    if not chains or chains[-1].candidate.structure.order < LONGEST:
        return False
    excess = np.array([chain.criterion for chain in chains]) - least
    if not np.all(np.diff(excess) < 0):
        return False
    last, bend = excess[-2] - excess[-1], np.diff(excess, 2)[-1]
    # A hundredth of the excess is what the law leaves of a plant that is as long as the chain.
    far = excess[-1] > max(_WORSE, excess[-2] / _WORSE)
    goes_on = np.all(np.diff(np.log(excess), 2) < 0) if far else bend <= 0 or last / bend > 1.0
    return bool(goes_on) and Rule.IMPROVING.on


def chain_profile(chain: LagChain, scales: Scales) -> tuple[FloatArray, FloatArray]:
    """Misfit over the dead time as `dead_time_profile`; with few parameters it is a parabola."""
    dead_time = chain.candidate.dead_time
    # The error may be zero or infinite if no sample depends on the dead time.
    widest = scales.latest - scales.earliest + scales.dt
    error = float(np.clip(chain.error, 1e-9 * scales.dt, widest))
    grid = np.clip(dead_time + error * np.linspace(-3, 3, 13), scales.earliest, scales.latest)
    grid = np.unique(np.append(grid, dead_time))
    return grid, ((grid - dead_time) / error) ** 2


def chain_limits(chain: LagChain, scales: Scales) -> tuple[float, float]:
    """Ends of the 95 % interval of the dead time; the lower is without the truncated lags."""
    dead_time, half = chain.candidate.dead_time, Z_95 * chain.error
    low = max(dead_time - half - chain.truncated, scales.earliest)
    return low, min(dead_time + half, scales.latest)


def time_moments(problem: Problem, like: Candidate) -> tuple[float, float]:
    """Mean and variance in time of the impulse response, from the cumulants of poles and zeros."""
    numerator = eliminate(problem, like.structure, like.parameters[None]).numerator[0]
    zeros = np.roots(numerator[::-1])
    mean = like.dead_time + lag_sum(like.poles, numerator)
    return mean, float(np.sum(like.poles**-2.0).real - np.sum(zeros**-2.0).real)


def _lowest(
    problem: Problem,
    scales: Scales,
    order: int,
    law: _Law,
    moments: tuple[float, float],
    behind: Sequence[float] = (),
) -> Candidate:
    """The best fit of a law."""
    more, mean, spread = int(bool(behind)), moments[0], float(np.sqrt(moments[1]))
    lags = np.exp(-law.rates(order, law.first)[0])
    starts = []
    for part in behind or (0.0,):
        lag = spread * float(np.sqrt((1 - part**2) / (lags @ lags)))
        dead_time = mean - lag * float(lags.sum()) - part * spread
        alone = [np.log(part * spread)] if behind else []
        starts.append([dead_time, np.log(lag), law.first, *alone])
    # A response that begins with the fourth power of the time has no kinks.
    low = [scales.earliest, -np.inf, law.low] + [-np.inf] * more
    high = [scales.latest, np.inf, law.high] + [np.inf] * more
    bounds, order = Bounds(np.array(low), np.array(high), smooth=True), order + more
    family = _Chain(order, order, bounds, (-np.inf, np.inf), law)
    return lowest(problem, family, np.array(starts), scales.dt)


def _chain(
    fits: WindowFit,
    order: int,
    law: _Law,
    moments: tuple[float, float],
    behind: Sequence[float] = (),
) -> tuple[LagChain, list[float]]:
    """The best chain, and its parameters."""
    problem = fits.problem
    fit = _lowest(problem, fits.scales, order, law, moments, behind)
    order = fit.structure.order
    value = fit.cost / fits.variance + (FREE_IN_A_CHAIN + bool(behind) + 2) * fits.penalty
    value += problem.local_count(order)
    error = dead_time_error(problem, fit, fits.variance)
    found = LagChain(Candidate(Structure(order, order), fit.theta, fit.cost), value, error)
    return found, fit.parameters.tolist()
