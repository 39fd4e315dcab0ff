"""Random stable plants and noisy responses, for comparisons of fast and dense routes."""

import numpy as np
from scipy.signal import butter, sosfilt, sosfiltfilt

from tests.rigs import R3, TS, exact_step


def modal(rng: np.random.Generator, order: int, p: int = 1, m: int = 1, radius: float = 0.97):
    """Minimal A, B, C, D with spread poles inside the radius: well conditioned on purpose.

    Poles lie on a spiral, so that no two are close, and every mode is
    excited and seen with a gain of order one.
    """
    A = np.zeros((order, order))
    i = 0
    while i < order:
        if order - i == 1:
            A[i, i] = rng.uniform(0.3, 0.6)
            i += 1
            continue
        angle = np.pi * (i + 1 + rng.uniform(0, 0.5)) / (order + 2)
        size = rng.uniform(0.8, radius)
        c, s = size * np.cos(angle), size * np.sin(angle)
        A[i : i + 2, i : i + 2] = [[c, s], [-s, c]]
        i += 2
    B = rng.choice([-1.0, 1.0], (order, m)) * rng.uniform(0.5, 1.5, (order, m))
    C = rng.choice([-1.0, 1.0], (p, order)) * rng.uniform(0.5, 1.5, (p, order))
    D = rng.uniform(-1, 1, (p, m))
    return A, B, C, D


def valve_pulse(
    kind: str, *, noise: float = 2e-3, delay: float = 37.0, seed: int = 1, n: int = 1101
) -> np.ndarray:
    """Pulse response of the simulated valve R3 as the paper's preprocessing leaves it.

    ``"clean"``: exact; ``"zero-phase"``, ``"causal"``: central difference and
    Butterworth 50 Hz of a step with noise; ``"unfiltered"``: no filter.
    """
    before = 400
    k = np.arange(-before, n + 200)
    step = exact_step(R3, (k - delay) * TS)
    if kind == "clean":
        return np.diff(step, prepend=0.0)[before : before + n]
    step = step + noise * np.random.default_rng(seed).standard_normal(step.size)
    pulse = np.zeros_like(step)
    pulse[2:-2] = (step[:-4] - 8 * step[1:-3] + 8 * step[3:-1] - step[4:]) / 12
    sos = butter(5, 50, fs=1 / TS, output="sos")
    if kind == "zero-phase":
        pulse = sosfiltfilt(sos, pulse)
    elif kind == "causal":
        pulse = sosfilt(sos, pulse)
    return pulse[before : before + n]
