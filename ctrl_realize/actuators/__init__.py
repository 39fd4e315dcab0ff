"""Models of what actuators do that no linear model says: stiction, backlash, slew limits.

Each is a frozen record of its parameters; it simulates a command, and becomes a system of
python-control, so that control loops with it can be simulated.

Examples
--------
>>> import ctrl_realize as cr
>>> sticking = cr.actuators.Stiction(S=4.0, J=2.0)
>>> sticking.simulate([50, 52, 54, 56]).tolist()
[50.0, 50.0, 50.0, 55.0]
>>> sticking.nlsys(0.1).nstates
7
"""

from __future__ import annotations

from .base import Actuator, Series
from .characteristic import Characteristic
from .limits import Backlash, DeadZone, Resolution, Saturation, SlewRateLimit
from .lugre import LuGreFriction
from .stiction import HeStiction, KanoStiction, Stiction

__all__ = [
    "Actuator",
    "Backlash",
    "Characteristic",
    "DeadZone",
    "HeStiction",
    "KanoStiction",
    "LuGreFriction",
    "Resolution",
    "Saturation",
    "Series",
    "SlewRateLimit",
    "Stiction",
]


def __dir__() -> list[str]:
    return __all__
