"""Predict each measured step record with models of the other records of its plant."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np

from .answers import Answer
from .measured import Measured

WAYS = (
    "ctrl_realize: identify",
    "SciPy: curve_fit, first order and dead time",
    "SciPy: curve_fit, second order and dead time",
    "pysib: ARX(3, 3) for each delay",
    "nfoursid: N4SID, order 3",
    "SIPPY: N4SID, order 3",
    "SRIVC (a prototype of ours), order 3",
    "regularised FIR (TC, of ours), dead time by likelihood",
)
Ask = Callable[[str, Measured], Answer | None]


def plant_of(one: Measured) -> str:
    """Records of one plant: the canal has two, one gate with three openings each, on two days."""
    if one.plant != "wis_canal":
        return one.plant
    gate = "1-2" if "gate1_2" in one.name else "2-3"
    return f"wis_canal, gate {gate}" + (", slow" if one.name.endswith("slow") else "")


def predicted(model: Answer, fitted: Measured, other: Measured) -> tuple[float, float]:
    """Fit in percent of a record that was not seen: as it is, and with the best gain."""
    gain = other.task.gain / fitted.task.gain
    return other.predicted(gain * model.simulate(other.task.u))


def crossed_table(records: tuple[Measured, ...], ask: Ask) -> list[str]:
    """Make the table: medians over all pairs of different records of a plant."""
    plants = dict.fromkeys(plant_of(one) for one in records)
    groups = {plant: [one for one in records if plant_of(one) == plant] for plant in plants}
    groups = {plant: some for plant, some in groups.items() if len(some) > 1}
    head = ["plant", "pairs", *WAYS]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for plant, some in groups.items():
        pairs = list(permutations(some, 2))
        cells = []
        for way in WAYS:
            models = {one: ask(way, one) for one in some}
            fits = [
                predicted(model, fitted, other)
                for fitted, other in pairs
                if (model := models[fitted]) is not None
            ]
            cells.append(_cell(np.array(fits)) if fits else "no answer")
        line = f"| {plant} | {len(pairs)} | " + " | ".join(cells) + " |"
        print(line, flush=True)
        lines.append(line)
    return lines


def _cell(fits: np.ndarray) -> str:
    return " / ".join(
        f"{middle:.1f}" if middle > -100 else "below -100"
        for middle in np.median(np.nan_to_num(fits, nan=-1e9), axis=0)
    )
