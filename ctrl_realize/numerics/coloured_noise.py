"""Likelihood of residuals as autoregressive noise, to compare models of different kinds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arrays import FloatArray

MOST_LAGS = 25
_SAMPLES_PER_LAG = 20


def noise_lags(samples: int) -> int:
    """Lags of autoregressive noise that so many samples can tell."""
    return max(min(MOST_LAGS, samples // _SAMPLES_PER_LAG), 1)


def coloured_criterion(residuals: Sequence[FloatArray]) -> tuple[float, int]:
    """Bayesian information criterion of stretches of one noise, and the lags that it takes.

    ``e[k] = a_1 e[k-1] + ... + a_r e[k-r] + w[k]`` with white w: r is the one with the least
    ``n log(mean w^2) + r log n``, and that is returned. Whatever is tried, the same n samples
    count, those behind `noise_lags` others of their stretch. Means are taken out.
    """
    most = noise_lags(min(e.size for e in residuals))
    rows, targets = [], []
    for e in residuals:
        centred = e - e.mean()
        rows.append(np.stack([centred[most - i : e.size - i] for i in range(most + 1)]))
        targets.append(rows[-1][0])
    sums = np.sum([lagged @ lagged.T for lagged in rows], axis=0)
    n = sum(target.size for target in targets)
    floor = 1e-300
    found = [(n * float(np.log(max(sums[0, 0] / n, floor))), 0)]
    scale = max(float(np.trace(sums)) / (most + 1), floor)
    for r in range(1, most + 1):
        own = sums[1 : r + 1, 1 : r + 1] + 1e-13 * scale * np.eye(r)
        left = float(sums[0, 0] - sums[0, 1 : r + 1] @ np.linalg.solve(own, sums[0, 1 : r + 1]))
        found.append((n * float(np.log(max(left / n, 1e-13 * scale / n))) + r * np.log(n), r))
    return min(found)
