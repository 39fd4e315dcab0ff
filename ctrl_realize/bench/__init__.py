"""Simulated set-ups with known parameters. Nothing here is measured."""

from __future__ import annotations

from .control_valve import Valve
from .set_up import valve
from .truth import ValveTruth

__all__ = ["Valve", "ValveTruth", "valve"]


def __dir__() -> list[str]:
    return __all__
