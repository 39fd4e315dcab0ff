"""PID parameters that minimize the absolute load error under a limit on the sensitivity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize

from ...delayed import DelayedStateSpace
from ...errors import UnsuitableSystemError
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.loops.circle import (
    damped_circle,
    gain_gaps,
    largest_gain,
    smallest_on_line,
    step_on_circle,
)
from ...numerics.loops.crossings import follow
from ..loops.loop import open_loop
from ..loops.margins import closed_loop_count
from .controller import PIDController
from .rules import INF, Parameters

LONGEST = 2**18
"""Largest number of samples of a load response."""


@dataclass(frozen=True)
class _Problem:
    """Response of the plant on two sets of points: on `omega` for the limit on the sensitivity, on
    `circle` for the step response of `count` samples; `distance` is 1 / Ms. `direct` is the
    size of a feedthrough of a continuous plant.
    """

    plant: DelayedStateSpace
    distance: float
    filter_ratio: float
    method: str
    omega: FloatArray
    loop: ComplexArray
    circle: ComplexArray
    on_circle: ComplexArray
    count: int
    sign: float
    integrating: bool
    direct: float

    def controller(self, kp: float, ti: float, td: float) -> PIDController:
        tf = td / self.filter_ratio
        return PIDController(kp, ti, td, tf, dt=self.plant.dt, method=self.method)

    def gain(self, ti: float, td: float) -> float:
        """Largest gain within the limit, for given times."""
        return min(self._at_all_samples(ti, td), self._at_infinity(td))

    def _at_infinity(self, td: float) -> float:
        """Largest gain of a continuous loop that ends with a gain, which its dead time turns."""
        if not self.direct:
            return INF
        return (1 - self.distance) / (self.direct * (1 + self.filter_ratio * (td > 0)))

    def _at_all_samples(self, ti: float, td: float) -> float:
        unit = self.controller(self.sign, ti, td)
        z = np.exp(1j * self.omega * self.plant.dt)
        shape = self.loop * _values(unit, z)
        if ti == INF:
            return largest_gain(shape, self.distance)[0]
        # A slow lag is almost an integrator: small gains are badly damped, larger ones are not.
        for low, high in reversed(gain_gaps(shape, self.distance)):
            if low == 0 and not self.integrating:
                return high
            if high < INF and high > low * (1 + 1e-6):
                kp = self.sign * (low * high) ** 0.5 if low else self.sign * high / 2
                loop = open_loop(self.plant, self.controller(kp, ti, td))
                if closed_loop_count(loop, loop.grid()) == (0, False):
                    return high
        return 0.0

    def load_error(self, ti: float, td: float) -> float:
        """Sum of |y| after a unit step of load, at the largest gain within the limit."""
        gain = self.gain(ti, td)
        if not np.isfinite(gain):
            return 0.0
        if gain == 0:
            return INF
        controller = self.controller(self.sign * gain, ti, td)
        back = 1 + self.on_circle * _values(controller, self.circle)
        return float(np.abs(step_on_circle(self.on_circle / back, self.circle, self.count)).sum())


def _values(controller: PIDController, z: ComplexArray) -> ComplexArray:
    """Response of a controller with diagonal A."""
    A, B, C, D = (np.asarray(M) for M in (controller.A, controller.B, controller.C, controller.D))
    out = np.full(z.size, D[0, 0], dtype=np.complex128)
    for i in range(A.shape[0]):
        out += C[0, i] * B[i, 0] / (z - A[i, i])
    return out


def optimal(
    plant: DelayedStateSpace,
    total_time: float,
    kind: str,
    *,
    max_sensitivity: float,
    filter_ratio: float,
    method: str,
    direct: float,
) -> Parameters:
    """Minimize the integrated absolute error after a load step, subject to Ms.

    For given times the largest gain within the limit has a closed form; the error is minimized over
    the times. Without an integral the steady-state error is smallest at the largest gain.

    Parameters
    ----------
    plant : DelayedStateSpace
        Stable or integrating.
    total_time : float
        Dead time and lags of the plant together, in s: the scale of the search.
    kind : {"P", "PI", "PD", "PID"}
    max_sensitivity : float
        Ms, > 1.
    filter_ratio : float
        td / tf.
    method : str
        Discretization of the integral.
    direct : float
        |D| of the continuous plant that is sampled finely: dead time turns the loop there by any
        angle, at frequencies that the samples do not show.

    Returns
    -------
    (kp, ti, td)
    """
    poles = np.abs(np.asarray(plant.delay_free.poles()))
    if np.any(poles > 1 + 1e-9):
        raise UnsuitableSystemError(
            "the plant is unstable, where a limit on the sensitivity does not imply "
            "stability. Use design.lqg"
        )
    loop = open_loop(plant)
    # Finer than for bracketing: the limit is evaluated at the points of the grid.
    omega, values = follow(loop, loop.grid(), largest_turn=0.05)
    count = 2 ** int(np.ceil(np.log2(min(60 * total_time / plant.dt + 64, LONGEST))))
    circle = damped_circle(count)
    on_circle = np.asarray(plant.horner(circle)[0, 0])
    problem = _Problem(
        plant, 1 / max_sensitivity, filter_ratio, method, omega, values, circle, on_circle, count,
        loop.sign(), loop.integrators() > 0, direct,
    )  # fmt: skip
    # behind a short dead time all times are short: 30 / omega at the limit of a P controller
    _, at = largest_gain(problem.sign * problem.loop, problem.distance)
    short = min(total_time, 30 / float(problem.omega[at]))
    low, high = 0.03 * short, 10 * total_time
    if kind == "P":
        ti, td = INF, 0.0
    elif kind == "PI":
        ti, td = smallest_on_line(lambda x: problem.load_error(x, 0.0), low, high)[0], 0.0
    elif kind == "PD":
        ti = INF
        td = smallest_on_line(lambda x: -problem.gain(INF, x), 0.01 * short, total_time)[0]
    else:
        ti, td = _two_times(problem, low, high)
    gain = problem.gain(ti, td)
    if not 0 < gain < INF:
        raise UnsuitableSystemError(
            f"no largest gain within Ms = {max_sensitivity:g} was found (largest: {gain:g}): the "
            "model has too little dead time to limit a controller, or too many integrators"
        )
    return problem.sign * gain, ti, td


def _two_times(problem: _Problem, low: float, high: float) -> tuple[float, float]:
    scan = [
        (problem.load_error(ti, share * ti), ti, share * ti)
        for ti in np.geomspace(low, high, 12)
        for share in (0.05, 0.15, 0.3, 0.6)
    ]
    _, ti, td = min(scan)

    def error(p: Any) -> float:
        return problem.load_error(float(np.exp(p[0])), float(np.exp(p[1])))

    start = np.log([ti, td])
    simplex = start + np.array([[0.0, 0.0], [0.25, 0.0], [0.0, 0.25]])
    with np.errstate(invalid="ignore"):  # errors may be infinite
        found = minimize(
            error,
            start,
            method="Nelder-Mead",
            bounds=[(np.log(0.05 * low), np.log(high))] * 2,  # a very long td is none
            options={"xatol": 1e-3, "fatol": 1e-7 * error(start), "initial_simplex": simplex},
        )
    best = np.exp(found.x)
    return float(best[0]), float(best[1])
