"""Movements of controller output and valve: the indices of Yamashita.

Signals are described by the symbols I (increasing), S (steady) and D (decreasing); a valve that
sticks stays steady while the controller output moves [1]_. The samples between two symbols and
the change that counts as a movement are our own.

References
----------
.. [1] Y. Yamashita, An automatic method for detection of valve stiction in process control loops,
   Control Engineering Practice 14 (2006) 503-510.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..arrays import FloatArray

LIMIT = 0.25
_SYMBOLS_PER_CYCLE = 16
_STEADY = 0.3
"""Of the root mean square of the changes: smaller changes are none."""
_OTHER = {
    ((1, 0), second) for second in ((-1, -1), (-1, 1), (0, -1), (1, -1), (-1, 0))
} | {((-1, 0), second) for second in ((-1, 1), (0, 1), (1, -1), (1, 1), (1, 0))}  # fmt: skip
"""Successive pairs of movements that do not belong to a valve that sticks."""


def movement_indices(
    output: FloatArray, position: FloatArray, period: float
) -> tuple[float, float] | None:
    """Return rho_1 and rho_3 of controller output and position, or flow, both (N,).

    rho_1 is the part of the time in which the position is steady while the output moves; rho_3 is
    rho_1 without the sequences that are not those of stiction. None if nothing moves.
    """
    block = max(round(period / _SYMBOLS_PER_CYCLE), 1)
    many = output.size // block
    if many < 8:
        return None
    symbols = []
    for signal in (output, position):
        means = signal[: many * block].reshape(many, block).mean(axis=1)
        changes = np.diff(means)
        size = float(np.sqrt(np.mean(changes**2)))
        if size == 0:
            return None
        symbols.append((np.sign(changes) * (np.abs(changes) > _STEADY * size)).astype(int))
    pairs = list(zip(symbols[0].tolist(), symbols[1].tolist(), strict=True))
    counted = sum(pair != (0, 0) for pair in pairs)
    if counted == 0:
        return None
    steady = sum(pair in {(1, 0), (-1, 0)} for pair in pairs)
    other = sum(each in _OTHER for each in pairwise(pairs))
    return steady / counted, (steady - other) / counted
