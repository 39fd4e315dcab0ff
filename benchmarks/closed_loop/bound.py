"""Cramer-Rao bound of a dead time: least error of an unbiased estimate that is told the structure.

The input is known, so that a direct estimate in noise with a known pole is one of least squares
(Ljung, System Identification, 2nd ed., Prentice Hall 1999, section 7.4): lags, gain, level and
drift are estimated beside the dead time. What moves the input has no part in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from .cases import CASES, GAIN, PLANTS, Plant, chain, record

_STEP = 0.01  # of a parameter, for a slope by differences
_APART = 0.02  # of lags that are equal


def bound(seed: int, case: str, plant: str, moves: str) -> float:
    """Least standard deviation of the dead time, in samples."""
    given, noise = PLANTS[plant], CASES[case]
    drive = record(given, noise, moves, seed)[1].input.ravel()
    return least_error(given, drive, noise.noise, noise.pole)


def least_error(plant: Plant, drive: np.ndarray, sigma: float, pole: float = 0.0) -> float:
    """Least standard deviation of the dead time, for an input (N,) and first-order noise."""
    spread = _APART * np.arange(len(plant.lags))
    true = replace(plant, lags=tuple(np.array(plant.lags) * (1 - spread)))
    values = np.array([true.dead_time, *true.lags])
    slopes = [response(true, drive), np.ones(drive.size), np.arange(drive.size) / drive.size]
    for move in np.diag(_STEP * values):
        low, high = (
            response(Plant(tuple(one[1:]), one[0]), drive) for one in (values - move, values + move)
        )
        slopes.append((high - low) / (2 * move.sum()))
    return float(least_errors(np.stack(slopes), sigma, pole)[3])


def least_errors(slopes: np.ndarray, sigma: float, pole: float = 0.0) -> np.ndarray:
    """Least standard deviations (k,) of parameters by which the output has slopes (k, N)."""
    white = lfilter([1.0, -pole], [1.0], slopes, axis=1)[:, 1:].T
    size = np.linalg.norm(white, axis=0)
    inverse = np.linalg.inv(np.linalg.qr(white / size)[1])
    return np.asarray(sigma * np.sqrt(1 - pole**2) * np.linalg.norm(inverse, axis=1) / size)


def response(plant: Plant, drive: np.ndarray) -> np.ndarray:
    """Output of a plant at rest for a held input (N,)."""
    whole = int(plant.dead_time)
    transition, early, late = chain(plant, plant.dead_time - whole)
    before = np.concatenate([np.zeros(whole + 1), drive])
    state, output = np.zeros(len(plant.lags)), np.zeros(drive.size)
    for k in range(drive.size):
        output[k] = GAIN * state[-1]
        state = transition @ state + early * before[k] + late * before[k + 1]
    return output
