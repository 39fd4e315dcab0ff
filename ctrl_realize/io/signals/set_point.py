"""Set points of a controller, and the stretches in which they are not in force.

A set point holds its value until it is stored again. In manual it is not in force: NaN.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import OptionError
from ...numerics.arrays import BoolArray, FloatArray
from ..tables import Table
from .names import MODES, mode_word, strange_modes


def filled(values: FloatArray) -> FloatArray:
    """Values (N,) that hold where one is missing; before the first one they are missing still."""
    known = ~np.isnan(values)
    last = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.asarray(np.where(last < 0, np.nan, values[np.maximum(last, 0)]))


def held(stamps: FloatArray, values: np.ndarray[Any, Any], time: FloatArray) -> FloatArray:
    """Last value at every time (M,), NaN before the first stamp."""
    last = np.searchsorted(stamps, time, side="right") - 1
    return np.where(last < 0, np.nan, np.asarray(values, np.float64)[np.maximum(last, 0)])


def in_manual(table: Table, index: int) -> BoolArray:
    """Rows in which a controller is in manual; a cell without a mode has the one before.

    Raises
    ------
    OptionError
        A cell is no mode that is known.
    """
    if strange := strange_modes(table, index):
        raise OptionError(
            f"{table.path}: {table.title(index)} has the modes {', '.join(sorted(strange)[:5])}; "
            f"expected {', '.join(MODES['manual'][:3])}, {', '.join(MODES['automatic'][:3])}, "
            "cas, or 0 and 1"
        )
    kinds = dict.fromkeys(MODES["manual"], 1.0) | dict.fromkeys(MODES["automatic"], 0.0)
    words = map(mode_word, table.columns[index].cells.tolist())
    return np.asarray(filled(np.array([kinds.get(word, np.nan) for word in words])) == 1)
