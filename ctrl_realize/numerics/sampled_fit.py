"""Output-error fit for inputs that are no steps: random, pseudo-random, sweeps, operation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .arrays import FloatArray
from .delayed_modes import SampledInput
from .fit_window import Window, fit_window
from .noise_level import quantisation_step
from .output_error import OutputErrorFit, likelihood_fit
from .separable_fit import KnownFactor, Problem, Structure
from .structure_search import Candidate, Scales, search

MOST_SAMPLES = 4000
"""Longer records are cut: every sample counts, so that time grows with the length."""

WHITE = 3.0
"""Correlation time of the residual, in samples, up to which a model is taken for right."""

ORDERS = tuple(Structure(n, r) for n in range(1, 4) for r in range(n, 0, -1))
_RISES = (2.0, 10.0, 50.0)
_ONSETS = (1.0, 5.0, 20.0)
_SMALLEST = 1e-4


def fit_sampled(
    output: FloatArray,
    signal: FloatArray,
    dt: float,
    *,
    structures: Sequence[Structure] | None = None,
    latest: float | None = None,
    known: KnownFactor | None = None,
    huber: bool = True,
) -> OutputErrorFit:
    """Estimate the dead time of a record with any input that moves.

    Parameters
    ----------
    output, signal : ndarray, shape (N,)
    dt : float
        Sample time in s.
    structures, latest, known, huber
        See `fit_output_error`; orders up to 3 by default, `latest` a quarter of the record.

    Notes
    -----
    The model starts from rest at the mean of the input. What was before the record decays
    during the first samples, which are left out: three times the lags of a first-order model,
    at most a fifth of the record.
    """
    n = min(output.size, MOST_SAMPLES)
    output, signal = output[:n], signal[:n] - float(np.mean(signal[:n]))
    factor = known or KnownFactor()
    limit = 0.25 * n * dt if latest is None else latest
    drive = SampledInput(signal, dt)
    columns = np.ones((n, 1))
    weight = np.ones(n)
    weight[: n // 20] = 0.0
    problem = Problem(output, weight, drive, columns, factor)
    rough = _first_order(problem, n, dt, limit)
    lag = float(-1.0 / rough.poles[0].real)
    weight[: int(min(3 * (lag + rough.delay) / dt, n // 5))] = 0.0
    start = int(np.argmax(weight > 0))
    window = Window(start, output, replace(problem, root_weight=weight), drive, columns, None)
    scales = Scales(max(rough.delay, 0.5 * dt), max(lag, 2 * dt), (n - start) * dt, dt, limit)
    noise = _SMALLEST * float(np.ptp(output)), quantisation_step(output)
    tried = ORDERS if structures is None else tuple(structures)
    whole = fit_window(window, tried, scales, noise, huber)
    return likelihood_fit(whole, adequate=whole.correlation <= WHITE)


def _first_order(problem: Problem, n: int, dt: float, limit: float) -> Candidate:
    """Best first-order model from a grid of delays and time constants."""
    tries = [
        search(
            problem,
            [Structure(1, 1)],
            Scales(min(onset * dt, limit), min(rise, n / 4) * dt, n * dt, dt, limit),
        )[Structure(1, 1)]
        for rise in _RISES
        for onset in _ONSETS
    ]
    return min(tries, key=lambda candidate: candidate.cost)
