"""Delays of step records in coloured noise, beside the bound for that noise."""

from __future__ import annotations

import functools

import control as ct
import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr
from tests import rigs

from . import plants
from .study import Shown, repeated

SLOW = np.array([1.0, -0.9])
"""Autoregression with its pole at 0.9: 19 samples count as one."""
RIPPLE = np.array([1.0, -2 * 0.97 * np.cos(2 * np.pi / 70), 0.97**2])
"""It rings with a period of 70 samples, as the commutator of a motor does."""
NOISES = {"slow (pole at 0.9)": SLOW, "ripple (period 70)": RIPPLE}

WAYS = ("auto", "white")
_SETTLED = 3000


def noise_of(filter_: np.ndarray, size: int, rng: np.random.Generator) -> np.ndarray:
    """Draw autoregressive noise of unit variance."""
    drawn = lfilter([1.0], filter_, rng.standard_normal(size + _SETTLED))[_SETTLED:]
    return drawn / _deviation(filter_)


def _deviation(filter_: np.ndarray) -> float:
    """Standard deviation of the noise over that of the white noise in it."""
    pulse = np.zeros(_SETTLED)
    pulse[0] = 1.0
    return float(np.linalg.norm(lfilter([1.0], filter_, pulse)))


def one(plant: ct.TransferFunction, noise: float, colour: str, way: str, *, seed: int) -> Shown:
    """Error, whether the interval covers, and its width, in samples."""
    clean, truth = plants.record(plant, 0.0, seed)
    rng = np.random.default_rng([seed, 77])
    height = noise * float(np.ptp(clean.input))
    y = clean.output + height * noise_of(NOISES[colour], clean.n_samples, rng)
    fit = cr.fit_output_error(cr.Record(clean.time, clean.input, y), noise=way).fit
    low, high = fit.delay_interval
    return fit.delay - truth, bool(low <= truth <= high), high - low


def bound(plant: ct.TransferFunction, noise: float, colour: str) -> float:
    """Cramer-Rao bound of the delay in samples: of the record made white by its own filter.

    Unknown are delay, gain, level, and the coefficients of the denominator.
    """
    k = np.arange(plants.BEFORE + plants.AFTER)
    poles = plant.poles()
    denominator = np.real(np.poly(poles))

    def step(delay: float, a: np.ndarray) -> np.ndarray:
        return rigs.exact_step(ct.tf([denominator[-1]], a), (k - plants.BEFORE - delay) * rigs.TS)

    # Not a whole number: the derivative jumps where the response begins at a sample.
    delay = 37.3
    columns = [(step(delay + 0.01, denominator) - step(delay - 0.01, denominator)) / 0.02]
    columns += [step(delay, denominator), np.ones(k.size)]
    for i in range(1, denominator.size):
        moved = 1e-4 * denominator[i] * np.eye(denominator.size)[i]
        columns.append(step(delay, denominator + moved) - step(delay, denominator - moved))
    white = lfilter(NOISES[colour], [1.0], np.stack(columns), axis=1)[:, NOISES[colour].size :]
    size = np.linalg.norm(white, axis=1)
    triangle = np.linalg.qr((white / size[:, None])[::-1].T)[1]
    least = noise / _deviation(NOISES[colour])
    return float(least / abs(triangle[-1, -1]) / size[0])


def coloured_table(seeds: int, jobs: int) -> list[str]:
    """Tabulate errors with the noise made white, and with all samples weighed alike."""
    lines = [
        "| plant | noise | `noise=` | rms error | bound | error / bound | coverage "
        "| median width |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in ("R1", "R2", "R3"):
        plant = plants.RIGS[name]
        for colour in NOISES:
            best = bound(plant, 0.005, colour)
            for way in WAYS:
                rows = repeated(functools.partial(one, plant, 0.005, colour, way), seeds, jobs)
                rms = float(np.sqrt(np.mean(rows[:, 0] ** 2)))
                lines.append(
                    f'| {name} | 0.5 %, {colour} | "{way}" | {rms:.3g} | {best:.3g} '
                    f"| {rms / best:.3g} | {100 * rows[:, 1].mean():.0f} % "
                    f"| {np.median(rows[:, 2]):.3g} |"
                )
    return lines
