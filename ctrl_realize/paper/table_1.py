"""Table 1 of the paper."""

from __future__ import annotations

import numpy as np

from ..numerics.arrays import locked

DELAYS = locked(
    np.array(
        [
            [38, 37, 37, 37],
            [37, 34, 38, 38],
            [38, 37, 38, 38],
            [36, 38, 38, 37],
            [37, 37, 35, 38],
            [34, 37, 32, 38],
            [34, 37, 38, 38],
            [33, 35, 38, 38],
            [36, 36, 34, 35],
            [38, 34, 33, 38],
        ],
        dtype=np.float64,
    )
)
"""Estimated delays in samples: record 1-10 x step size 16, 12, 8, 4 mA."""
