"""Simulated set-ups with known parameters. Nothing here is measured."""

from __future__ import annotations

from .control_valve import Valve
from .set_up import valve
from .truth import ValveTruth
from .valve_loop import LoopRecord, ValveLoop, valve_loop

__all__ = ["LoopRecord", "Valve", "ValveLoop", "ValveTruth", "valve", "valve_loop"]


def __dir__() -> list[str]:
    return __all__
