"""A stem with the friction of the LuGre model, whose limit is Kano's where commands pause.

The force of friction on a stem of velocity v is [1]_, equations (3) to (6)::

    F = s0 z + s1 dz/dt + s2 v,    dz/dt = v - s0 |v| z / g(v),
    g(v) = Fc + (Fs - Fc) exp(-(v / vs)^2),

with the mean deflection z of the bristles. The stem is a mass on a spring, as in the physical
valve model of [2]_, section 5.

References
----------
.. [1] C. Canudas de Wit, H. Olsson, K. J. Astrom and P. Lischinsky, A new model for control of
   systems with friction, IEEE Trans. Automatic Control 40 (1995) 419-425, doi:10.1109/9.376053.
.. [2] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, Modelling valve stiction, Control
   Engineering Practice 13 (2005) 641-658, doi:10.1016/j.conengprac.2004.05.005.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from ctrl_realize.numerics.arrays import FloatArray

# Tolerances of the integration, the latter of the deviation that static friction holds.
_RELATIVE, _ABSOLUTE = 1e-6, 1e-9


@dataclass(frozen=True)
class LuGre:
    """Parameters of a stem with LuGre friction, in consistent units.

    `mass` and `spring` are those of the stem, `coulomb` and `static` Fc and Fs, `stribeck` vs;
    `bristle`, `damping` and `viscous` are s0, s1 and s2.
    """

    mass: float
    spring: float
    coulomb: float
    static: float
    stribeck: float
    bristle: float
    damping: float
    viscous: float

    def slopes(self, _time: float, state: FloatArray, force: float) -> FloatArray:
        """Time derivatives of (position, velocity, deflection) under a constant force."""
        position, velocity, deflection = state
        level = self.coulomb + (self.static - self.coulomb) * np.exp(
            -((velocity / self.stribeck) ** 2)
        )
        slip = velocity - self.bristle * abs(velocity) * deflection / level
        friction = self.bristle * deflection + self.damping * slip + self.viscous * velocity
        return np.array([velocity, (force - self.spring * position - friction) / self.mass, slip])


def lugre_step(state: FloatArray, position: float, stem: LuGre, dt: float) -> FloatArray:
    """Advance (position, velocity, deflection) by one sample with the drive at `position`."""
    # The deviation that static friction holds is the scale of the motion.
    scale = _ABSOLUTE * stem.static / stem.spring
    found = solve_ivp(
        stem.slopes,
        (0.0, dt),
        state,
        method="LSODA",
        args=(stem.spring * position,),
        rtol=_RELATIVE,
        atol=scale * np.array([1.0, 1.0 / dt, stem.spring / stem.bristle]),
    )
    return np.asarray(found.y[:, -1])


def lugre_stem(position: FloatArray, stem: LuGre, dt: float) -> FloatArray:
    """Positions (N,) of a stem whose drive would hold it at `position` without friction.

    The drive's force is ``spring * position``, held from sample to sample; the stem starts at rest
    with relaxed bristles.
    """
    state = np.array([float(position[0]), 0.0, 0.0])
    out = np.empty(position.size)
    for k, wanted in enumerate(position.tolist()):
        out[k] = state[0]
        state = lugre_step(state, wanted, stem, dt)
    return out
