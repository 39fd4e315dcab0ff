"""Table 1 of the paper."""

from __future__ import annotations

import numpy as np

from .._facts import facts
from ..numerics.arrays import locked

DELAYS = locked(np.array(facts("paper/table_1.toml")["delays"], dtype=np.float64))
"""Estimated delays in samples: record 1-10 x step size 16, 12, 8, 4 mA."""
