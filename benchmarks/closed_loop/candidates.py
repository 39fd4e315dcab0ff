"""Ways of taking a dead time and its interval from a likelihood on a grid."""

from __future__ import annotations

import numpy as np

from .surface import MOST, Surface

_DEAD_TIMES = np.arange(MOST, dtype=float)
Answer = tuple[float, float, float]
"""Dead time and the ends of its interval, in samples."""


def candidates(found: Surface, lags: int) -> dict[str, Answer]:
    """Answers by the name of their way; `lags` is the number that a user may know."""
    profiles = [found.profile(n) for n in (1, 2, 3)]
    tops = np.array([profile.max() for profile in profiles])
    own = [(_maximum(profile), *_likely(profile)) for profile in profiles]
    charge = np.log(found.samples) * np.arange(3)
    bic = -2 * tops + charge
    kept = [one for one, value in zip(own, bic, strict=True) if value <= bic.min() + 10]
    joined = min(one[1] for one in kept), max(one[2] for one in kept)
    answers = {
        "BIC": (own[int(np.argmin(bic))][0], *joined),
        "AIC": (own[int(np.argmin(-2 * tops + 2 * np.arange(3)))][0], *joined),
        "maximum, lags known": own[lags - 1],
    }
    weights = [np.exp(profile - tops.max()) for profile in profiles]
    for name, price in (("no charge", 0.0), ("Akaike", 2.0), ("twice", 4.0), ("BIC", charge[1])):
        shares = [np.exp(-price * n / 2) * weight for n, weight in enumerate(weights)]
        answers[f"mean, {name}"] = _mean(np.sum(shares, axis=0))
    answers["mean, lags known"] = _mean(weights[lags - 1])
    marginal = [found.marginal(n) for n in (1, 2, 3)]
    answers["flat weights on the lags"] = _mean(np.sum(marginal, axis=0))
    return answers


def _maximum(profile: np.ndarray) -> float:
    """Place of the maximum, between the samples by a parabola."""
    top = int(profile.argmax())
    if not 0 < top < MOST - 1:
        return float(top)
    before, here, after = profile[top - 1 : top + 2]
    bend = before - 2 * here + after
    return top + float(np.clip(0.5 * (before - after) / bend if bend < 0 else 0.0, -0.5, 0.5))


def _likely(profile: np.ndarray) -> tuple[float, float]:
    """Dead times that a likelihood ratio does not rule out (95 %), and half a step of the grid."""
    inside = np.flatnonzero(profile >= profile.max() - 1.92)
    return inside[0] - 0.5, inside[-1] + 0.5


def _mean(weight: np.ndarray) -> Answer:
    """Mean dead time, and the middle 95 % of the weight."""
    share = weight / weight.sum()
    low, high = np.searchsorted(np.cumsum(share), (0.025, 0.975))
    return float(share @ _DEAD_TIMES), low - 0.5, high + 0.5
