"""A plant that a relay switches, sample by sample: our own loop of the test of [1]_.

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
