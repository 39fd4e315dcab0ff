"""A plant that a relay switches, sample by sample, and how a record shows it: the test of [1]_.

References
----------
.. [1] K. J. Astrom and T. Hagglund, Automatic tuning of simple regulators with specifications on
   phase and amplitude margins, Automatica 20 (1984) 645-651, doi:10.1016/0005-1098(84)90014-1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import FloatArray

Sampled = tuple[FloatArray, FloatArray, FloatArray, FloatArray, int]
"""A, B, C, D and the samples of input delay of a plant behind a hold."""

_FEWEST = 6  # switches: the first two start a test, and two of each direction are no accident


def relay_loop(
    plant: Sampled,
    samples: int,
    levels: tuple[float, float],
    hysteresis: float,
    seen: Callable[[int, float], float],
    switches: int | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Input and output (N,) of a plant at rest whose input a relay switches.

    Parameters
    ----------
    plant : tuple
    samples : int
    levels : tuple of float
        Inputs while the output rises and while it falls; the first comes first.
    hysteresis : float
    seen : callable
        What the relay sees of the output at a sample, over the level about which it switches;
        positive where the first level has brought it up.
    switches : int, optional
        The loop ends at this one, which is left out; N is `samples` where it does not come.
    """
    A, B, C, D, delay = plant
    arrived, output = np.zeros(samples + delay), np.zeros(samples)  # input, `delay` samples later
    state, up, count = np.zeros(A.shape[0]), True, 0
    for k in range(samples):
        output[k] = C[0] @ state + D[0, 0] * arrived[k]
        above = seen(k, float(output[k]))
        if above > hysteresis if up else above < -hysteresis:
            up, count = not up, count + 1
            if count == switches:
                return arrived[delay : delay + k], output[:k]
        arrived[k + delay] = levels[0] if up else levels[1]
        state = A @ state + B[:, 0] * arrived[k]
    return arrived[delay:], output


def switched_by_relay(output: FloatArray, drive: FloatArray) -> bool:
    """Whether the input (N,) of a record is that of a relay: the output (N,) tells every switch.

    From the third switch on there are two levels, each of which ends where the output of the same
    sample, or of the one before, has passed a threshold, and nowhere else.
    """
    switches = np.flatnonzero(np.diff(drive)) + 1
    if switches.size < _FEWEST:
        return False
    here = np.arange(switches[1] + 1, drive.size)
    before = drive[here - 1]
    ends, upper = drive[here] != before, before > before.mean()
    held = upper[~ends]
    if np.unique(before).size != 2 or held.all() or not held.any():
        return False
    # The output falls to the threshold at which the lower level ends, or rises to it.
    return any(
        np.max(seen[~upper & ends]) < np.min(seen[~upper & ~ends])
        and np.min(seen[upper & ends]) > np.max(seen[upper & ~ends])
        for late in (0, 1)
        for seen in (output[here - late], -output[here - late])
    )
