"""Estimate of a delay tracker from its sums, and the reasons why there may be none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._wording import plainly
from ...numerics.arrays import FloatArray
from ...numerics.regression.recursive import DelayBank
from ...numerics.state_space.pole_sensitivity import Core, Direction

SPEED_STD = 0.3
"""Prior standard deviation of the relative speed of a pole."""
SIGNIFICANT = 16.0
"""Least decrease of the misfit, in noise variances, for a significant response: four sigma."""
CLEAR_GAIN = 3.0
"""Least ratio of the gain to its standard deviation."""
SHOWN_MOVE = 2.0
"""Largest move of a pole that is computed, as logarithm of the speed ratio."""

EXCESS, EXCESS_AFTER_MOVES = 3.0, 1.2
"""Residual, relative to the model's noise, above which no estimate is given: nine times the power
is not explained by the same plant. Moved poles are accepted only if the residual does not exceed
the noise: otherwise slower poles can take the place of a delay beyond the candidates (a delay of
100 samples, with 90 as the largest candidate, leaves 1.5 times the noise or more)."""
NEGLIGIBLE = 0.005
"""Residual, relative to the response, that is always tolerated: for noise-free data, the error of
the linearisation in the moves of the poles."""


@dataclass(frozen=True, eq=False)
class LinearisedBank:
    """A bank of candidate delays for one set of poles, `moved` from those of the starting model.

    Its sums begin at sample `begin`.
    """

    bank: DelayBank
    core: Core
    directions: list[Direction]
    moved: FloatArray
    begin: int = 0

    @property
    def n_parameters(self) -> int:
        """Parameters of one candidate: the gain, and a move for each direction."""
        return 1 + len(self.directions)


@dataclass(frozen=True, eq=False)
class Solution:
    """Best candidate of a bank, and its uncertainty.

    ``theta`` contains the gain, then the gain times the `moves` of the poles; `delay` is in samples
    and `delay_estimate` the same with its fraction. `response_std` is the size of the response;
    `responds` is false if the output does not respond to the input; `reason` states why the delay
    is not resolved, and is empty if it is.
    """

    delay: int
    delay_estimate: float
    interval: tuple[int, int]
    theta: FloatArray
    offset: float
    gain_std: float
    move_std: FloatArray
    pole_speed_ratios: tuple[float, ...]
    variance: float
    response_std: float
    responds: bool
    reason: str

    @property
    def gain(self) -> float:
        """Gain relative to that of the starting model."""
        return float(self.theta[0])

    @property
    def moves(self) -> FloatArray:
        """Moves of the poles; zero if the gain is zero."""
        return _relative(self.theta)


def solve(now: LinearisedBank, variance: float, inflation: float) -> Solution:
    """Choose among the candidates of a bank.

    Parameters
    ----------
    now : LinearisedBank
    variance : float
        Noise variance known beforehand; with `SPEED_STD` it weights the prior.
    inflation : float
        Number of residual samples that count as one independent sample.
    """
    bank, q = now.bank, now.n_parameters
    spread = np.array([1.0, *(SPEED_STD for _ in now.directions)])
    found = bank.solve(np.eye(1, q)[0], variance / spread**2)
    best = int(np.argmin(found.weighted_sse))
    theta, delay = found.theta[best], bank.low + best
    freedom = max(bank.weight**2 / bank.weight_squared - q - 1, 1.0)
    variance = found.weighted_sse[best] / bank.weight * (1 + (q + 1) / freedom)
    # Not below the resolution of sums of squares in double precision.
    noise = max(variance * inflation, 1e-14 * found.power, 1e-300)
    interval = _interval(found.weighted_sse - found.weighted_sse[best], noise, bank.low)
    # separate roots: the product overflows for an output 1e200 times as large as the input
    std = np.sqrt(noise) * np.sqrt(np.diag(found.inverse[best]))
    gain, gain_std = float(theta[0]), float(std[0])
    moves = _relative(theta)
    speeds = [i for i, (what, _, _) in enumerate(now.directions) if what == "speed"]
    unseen = _no_response(float(found.power - found.weighted_sse[best]) / noise, gain, gain_std)
    open_still = _no_choice(delay, interval, (bank.low, bank.high))
    return Solution(
        delay=delay,
        delay_estimate=delay + _fraction(found.weighted_sse, best),
        interval=interval,
        theta=theta,
        offset=float(found.offset[best]),
        gain_std=gain_std,
        move_std=std[1:] / abs(gain) if gain else np.full(q - 1, np.inf),
        pole_speed_ratios=tuple(
            float(np.exp(now.moved[i] + np.clip(moves[i], -SHOWN_MOVE, SHOWN_MOVE))) for i in speeds
        ),
        variance=variance,
        response_std=float(np.sqrt(max(found.power - found.weighted_sse[best], 0.0) / bank.weight)),
        responds=not unseen,
        reason=unseen or open_still or too_far(max(moves[speeds], key=abs, default=0.0), SPEED_STD),
    )


def _relative(theta: FloatArray) -> FloatArray:
    return theta[1:] / theta[0] if theta[0] else np.zeros(theta.size - 1)


def _interval(excess: FloatArray, noise: float, low: int) -> tuple[int, int]:
    """Return the delays that contain 95 % of the probability; `low` is that of the first entry."""
    # exp(-500) underflows to zero; larger arguments might overflow.
    chance = np.exp(-np.minimum(excess, 1e3 * noise) / noise / 2)
    below = np.cumsum(chance) / chance.sum()
    last = min(int(np.searchsorted(below, 0.975)), below.size - 1)
    return low + int(np.searchsorted(below, 0.025)), low + last


def _fraction(cost: FloatArray, best: int) -> float:
    """Minimum of a parabola through the smallest misfit and its neighbours, -0.5...0.5."""
    if not 0 < best < cost.size - 1:
        return 0.0
    before, here, after = cost[best - 1 : best + 2]
    bend = before - 2 * here + after
    return float((before - after) / (2 * bend)) if bend > 0 else 0.0


def _no_response(explained: float, gain: float, gain_std: float) -> str:
    """State why the output does not respond to the input; `explained` is in noise variances."""
    if explained < SIGNIFICANT:
        return "no movement above the noise within the forgetting time"
    if abs(gain) < CLEAR_GAIN * gain_std:
        return "the output does not respond to the input"
    return ""


def _no_choice(delay: int, interval: tuple[int, int], candidates: tuple[int, int]) -> str:
    """State why no single delay is resolved."""
    low, high = candidates
    if delay == high:
        return f"the best delay is max_delay={high}; try a larger one"
    if delay == low > 0:
        return f"the best delay is min_delay={low}; try a smaller one"
    if interval[1] - interval[0] > (high - low) / 2:
        return f"every delay from {interval[0]} to {interval[1]} samples fits"
    return ""


def too_far(move: float, most: float) -> str:
    """State that a pole has moved beyond the range of the linearisation."""
    if abs(move) <= most:
        return ""
    return (
        f"a pole has moved by {100 * np.expm1(move):+.0f} %, too far from the reference model, "
        "which is being updated"
    )


def excess_residual(found: Solution, noise: float, limit: float) -> str:
    """Report that the residual exceeds `limit` times the noise of the model."""
    left = float(np.sqrt(found.variance))
    if noise == 0 or left <= limit * noise or left <= NEGLIGIBLE * found.response_std:
        return ""
    return (
        f"the track is lost: the residual, {left:.3g}, is {plainly(left / noise, 2)} times the "
        "noise of the model. The delay may be outside the range of candidates, the plant "
        "may have changed, or a disturbance may drift; reset() restarts the tracker"
    )
