"""Smith predictors in continuous time: controllers with an internal delay."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..._checks import positive
from ...delayed import DelaySystem, delay
from ...delayed.parts import check_single
from ...errors import OptionError, UnsuitableSystemError
from ..loops.loop_check import verified
from ..siso import core_and_dead_time, proper_ss

ON_AXIS = 1e-9
STABILIZE = (
    "Its closed loop is that of the core and the controller: choose a controller that stabilizes "
    "the core without dead time (design.margins(core, controller))"
)


def more_robust(filter_time: float | None, dead_time: float) -> str:
    """What to try if the loop with a Smith predictor is not robust."""
    time = dead_time if filter_time is None else 2 * filter_time
    return f"Try filter_time={time:.3g}, or a slower controller"


def continuous_smith_predictor(
    plant: DelaySystem, controller: Any, filter_time: float | None, name: str
) -> DelaySystem:
    """Make ``C F / (1 + C (G - F G exp(-tau s)))`` of a plant ``G exp(-tau s)``, exactly.

    One copy of the core serves both models, and the dead time is an internal delay.
    """
    core, dead_time = core_and_dead_time(plant, "a Smith predictor")
    unstable = core.poles()
    unstable = unstable[unstable.real > -ON_AXIS * (1 + np.abs(unstable))]
    if unstable.size:
        raise UnsuitableSystemError(
            f"the core has a pole at s = {complex(unstable[0]):.6g}: a Smith predictor contains "
            "uncontrolled copies of its modes, which drift or grow. Sample the plant "
            "(sys.to_discrete) for design.smith_predictor with filter_time or design.lqg"
        )
    if isinstance(controller, (int, float)):
        controller = ct.ss([], [], [], float(controller), 0)
    primary = proper_ss(controller, "a Smith predictor")
    check_single(primary, "a controller for a Smith predictor")
    if not primary.isctime():
        raise UnsuitableSystemError(
            f"the controller has dt={primary.dt!r}, the plant is continuous; expected a continuous "
            "controller"
        )
    filtered: Any = 1.0
    if filter_time is not None:
        filtered = ct.ss(ct.tf([1], [positive(filter_time, "filter_time", "time in s"), 1]))
    if dead_time == 0:
        raise OptionError("the plant has no dead time to predict over; use the controller itself")
    late = filtered * delay(dead_time)
    # the inner loop sees G (1 - F exp(-tau s)), with one G
    made = (DelaySystem(ct.ss(primary))).feedback((1 - late) * core) * filtered
    verified(plant, made, "the Smith predictor", STABILIZE, more_robust(filter_time, dead_time))
    names = {"inputs": ["e"], "outputs": plant.input_labels, "name": name}
    return DelaySystem(made.core, made.internal_delays, **names)
