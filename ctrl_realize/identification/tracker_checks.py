"""What a delay tracker can start from, and when it must say that it cannot tell."""

from __future__ import annotations

import control as ct
import numpy as np

from ..errors import OptionError, UnsuitableSystemError
from ..numerics.arrays import FloatArray

SIGNIFICANT = 16.0
"""Fall of the misfit in noise variances below which nothing was seen: four sigma."""


def doubt(
    explained: float,
    gain: float,
    delay: int,
    interval: tuple[int, int],
    candidates: tuple[int, int],
) -> str:
    """Say why the data cannot tell the delay; empty when they can.

    Parameters
    ----------
    explained : float
        Fall of the misfit by the best model, in noise variances.
    gain : float
        Its gain, in standard deviations.
    delay : int
        Its delay in samples.
    interval, candidates : tuple of int
        Delays that are left open, and those that were tried.
    """
    low, high = candidates
    if explained < SIGNIFICANT:
        return "nothing moved within the memory that stands out of the noise"
    if abs(gain) < 3:
        return "the output does not follow the input"
    if delay == high:
        return f"the best delay is max_delay={high}; try a larger one"
    if delay == low > 0:
        return f"the best delay is min_delay={low}; try a smaller one"
    if interval[1] - interval[0] > (high - low) / 2:
        return f"any delay from {interval[0]} to {interval[1]} samples fits"
    return ""


def fraction(misfit: FloatArray, best: int) -> float:
    """Return where a parabola through the least misfit and its neighbours is lowest, -0.5...0.5."""
    if not 0 < best < misfit.size - 1:
        return 0.0
    before, here, after = misfit[best - 1 : best + 2]
    bend = before - 2 * here + after
    return float(np.clip((before - after) / (2 * bend), -0.5, 0.5)) if bend > 0 else 0.0


def check_start(core: ct.StateSpace) -> None:
    """Refuse a model that cannot be followed by simulation."""
    if not isinstance(core, ct.StateSpace) or not core.issiso():
        raise UnsuitableSystemError("the model to start from must be a system of one channel")
    if not core.isdtime(strict=True) or core.dt is True:
        raise UnsuitableSystemError(
            "the model to start from must be discrete, with its sample time"
        )
    worst = np.abs(core.poles()).max(initial=0.0)
    if worst > 1 + 1e-9:
        raise UnsuitableSystemError(
            f"the model to start from is unstable (a pole at |z| = {worst:.6g}), so its output "
            "cannot be followed by simulation"
        )
    if not np.any(core.C) and not np.any(core.D):
        raise OptionError("the model to start from is zero")
