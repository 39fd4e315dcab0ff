"""The four transfer functions of a loop, as one system."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...delayed.operands import common_dt
from ...errors import UnsuitableSystemError
from ..delay_line import DelayLineController
from ..siso import with_dead_time


def gang_of_four(plant: Any, controller: Any) -> Any:
    """Close a loop with all its inputs and outputs: T, P S, C S and S, exact at any dead time.

    `control.gangof4` needs matrices, which do not exist for a dead time in continuous time, and
    takes minutes for a thousand samples of delay.

    Parameters
    ----------
    plant, controller : system or float
        With one input and one output, of the same time base; negative feedback.

    Returns
    -------
    DelaySystem, or DelayedStateSpace without delays in the loop
        From set-point ``r`` and load ``d`` at the plant input to plant output ``y`` and plant
        input ``v``: ``[[P C / (1 + P C), P / (1 + P C)], [C / (1 + P C), 1 / (1 + P C)]]``. As in
        `control.gangof4`, ``ct.bode_plot(..., plot_phase=False)`` draws the four gains.

    Raises
    ------
    UnsuitableSystemError
        Several channels, mixed time bases, no time base, or an algebraic loop without a solution.

    Notes
    -----
    The gang of four of [1]_.

    References
    ----------
    .. [1] K. J. Astrom and R. M. Murray, Feedback Systems, 2nd ed., Princeton University Press
       2021, section 12.1.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = ct.tf([2], [1, 1]) * cr.delay(0.3)
    >>> four = cr.design.gang_of_four(plant, ct.tf([0.8, 0.8], [1, 0]))
    >>> four
    <DelaySystem 'gang_of_four': r, d -> y, v, order 2, internal delay 0.3 s, continuous>
    >>> print(abs(four(0.01j)).round(2))
    [[1.   0.01]
     [0.5  0.01]]
    """
    if all(getattr(system, "dt", None) is None for system in (plant, controller)):
        raise UnsuitableSystemError("neither the plant nor the controller has a time base dt")
    dt = common_dt(plant, controller)
    parts = [
        system if isinstance(system, DelayLineController) else with_dead_time(system, "a loop", dt)
        for system in (plant, controller)
    ]
    both = parts[0].append(parts[1])
    # plant input v = d + u, controller input e = r - y; inputs (d, r), outputs (y, u)
    loop = both.feedback(np.array([[0.0, 1.0], [-1.0, 0.0]]), sign=1)
    four = (loop + np.array([[0.0, 0.0], [1.0, 0.0]]))[:, ::-1]
    four.update_names(name="gang_of_four", inputs=["r", "d"], outputs=["y", "v"])
    return four
