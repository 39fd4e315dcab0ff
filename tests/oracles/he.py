"""A stem with static and kinetic friction, by the model of He and others.

The command acts like a force that static friction holds; when it yields, the stem moves until
kinetic friction holds the rest [1]_, section 2.

References
----------
.. [1] Q. P. He, J. Wang, M. Pottmann and S. J. Qin, A curve fitting method for detecting valve
   stiction in oscillating control loops, Ind. Eng. Chem. Res. 46 (2007) 4549-4560,
   doi:10.1021/ie061219a.
"""

from __future__ import annotations

import numpy as np


def he(command: np.ndarray, static: float, kinetic: float, start: float) -> np.ndarray:
    """Positions (N,) of the stem; `start` times `kinetic` is the force that is held at first."""
    held = start * kinetic
    position, out = command[0] - held, []
    for change in np.diff(command, prepend=command[0]):
        force = held + change
        held = force
        if abs(force) > static:
            held = np.copysign(kinetic, force)
            position += force - held
        out.append(position)
    return np.array(out)
