"""Sections in which a flow rests while the controller output moves: Kano's method A.

Kano and others [1]_ look for the sections in which the position of the valve, or the flow, stays
the same although the output changes, and take the part of the time that they fill as the index.
In the plane of output and flow these sections are the flat sides of a parallelogram, whose length
is S [1]_. The paper itself was not at hand: how sections are found, the smoothing, and what counts
as the same and as a change are our own.

References
----------
.. [1] M. Kano, H. Maruta, H. Kugemoto and K. Shimizu, Practical model and detection algorithm for
   valve stiction, IFAC Symposium on Dynamics and Control of Process Systems, Cambridge 2004.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from .cycles import smoothed

REST_LIMIT, REST_NONE = 0.4, 0.05
"""Our own, set on simulated loops."""
_SMOOTHED = 0.06
"""Part of a period over which both signals are averaged."""
_SAME, _CHANGED = 0.12, 0.25
"""Largest range of the flow, and smallest of the output, in a section, over their swings."""


@dataclass(frozen=True)
class Rests:
    """Part of the time in which the flow rests while the output moves, and how far that moves.

    ``side`` is the median change of the output in a section, over its swing; NaN without sections.
    """

    part: float
    side: float


def rests(output: FloatArray, flow: FloatArray, period: float) -> Rests | None:
    """Find the sections in output and flow (N,), without drift; None if one does not move."""
    output, flow = (smoothed(each, period, _SMOOTHED) for each in (output, flow))
    # 2 sqrt(2) standard deviations are the peak-to-peak value of a sine
    swings = [2 * np.sqrt(2) * float(each.std()) for each in (output, flow)]
    if min(swings) == 0:
        return None
    within = _SAME * swings[1]
    changes, lengths = [], []
    first, low, high = 0, float(flow[0]), float(flow[0])
    for k, value in enumerate([*flow.tolist(), np.inf]):
        if max(high, value) - min(low, value) > within:
            change = float(np.ptp(output[first:k])) / swings[0]
            if change >= _CHANGED:
                changes.append(change)
                lengths.append(k - first)
            first, low, high = k, value, value
        else:
            low, high = min(low, value), max(high, value)
    side = float(np.median(changes)) if changes else np.nan
    return Rests(sum(lengths) / flow.size, side)
