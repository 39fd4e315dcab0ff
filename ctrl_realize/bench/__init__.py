"""Simulated set-ups with known parameters. Nothing here is measured."""

from __future__ import annotations

from .control_loop import LoopRecord, ValveLoop
from .control_valve import Valve
from .plant import Plant
from .plants import flow_loop, heater, tank
from .set_up import paper_valve, valve
from .truth import PlantTruth, ValveTruth
from .valve_loop import valve_loop

__all__ = [
    "LoopRecord",
    "Plant",
    "PlantTruth",
    "Valve",
    "ValveLoop",
    "ValveTruth",
    "flow_loop",
    "heater",
    "paper_valve",
    "tank",
    "valve",
    "valve_loop",
]


def __dir__() -> list[str]:
    return __all__
