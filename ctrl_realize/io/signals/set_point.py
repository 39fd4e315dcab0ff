"""Set points of a controller, and the stretches in which they are not in force.

A set point holds its value until it is stored again. In manual it is not in force: NaN.
"""

from __future__ import annotations

import numpy as np

from ...errors import OptionError
from ...numerics.arrays import BoolArray
from ...numerics.signals.sample_grid import filled
from ..tables import Table
from .names import MODES, mode_word, strange_modes


def in_manual(table: Table, index: int) -> BoolArray:
    """Rows in which a controller is in manual; a cell without a mode has the one before.

    Raises
    ------
    OptionError
        A cell is no mode that is known.
    """
    if strange := strange_modes(table, index):
        raise OptionError(
            f"{table.at(index)} has the modes {', '.join(sorted(strange)[:5])}; "
            f"expected {', '.join(MODES['manual'][:3])}, {', '.join(MODES['automatic'][:3])}, "
            "cas, or 0 and 1"
        )
    kinds = dict.fromkeys(MODES["manual"], 1.0) | dict.fromkeys(MODES["automatic"], 0.0)
    words = map(mode_word, table.columns[index].cells.tolist())
    return np.asarray(filled(np.array([kinds.get(word, np.nan) for word in words])) == 1)
