"""Families of models with an actuator, and the residual of one of their members.

Gain, lead, and the terms of the records enter linearly and are eliminated (variable projection
[1]_); what is left is improved by Levenberg-Marquardt steps [2]_ with differences for derivatives.

References
----------
.. [1] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [2] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import BoolArray, FloatArray
from ..separable.structures import Scales, parameter_bounds
from ..separable.varpro import Structure
from .motions import Acting, Kind, Place, forced_response
from .records import ActuatedRecord

_OF_DT, _OF_LOG, _OF_START = 0.05, 1e-3, 1e-2  # steps of differences
_MOST_TURNS = 30
_LONGEST = 1.0  # of a logarithm, in one step
_MOST_FAILURES = 5
_FREELY = 1e-2  # damping up to which a short step tells that the bottom is reached

VALUES: dict[Kind, int] = {"none": 0, "slew_rate": 1, "dead_band": 1, "kano": 2, "choudhury": 2}
"""Number of parameters of each kind of actuator."""
STICKING: tuple[Kind, ...] = ("dead_band", "kano", "choudhury")


@dataclass(frozen=True)
class Family:
    """Order and zeros of the linear part, kind of actuator, and its place."""

    structure: Structure
    kind: Kind = "none"
    place: Place = "input"


@dataclass(frozen=True, eq=False)
class Records:
    """Records that are fitted together, projected on what is not their own."""

    parts: tuple[ActuatedRecord, ...]

    @cached_property
    def bases(self) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """Root weights (M,), and orthogonal basis (M, q) of the weighted own terms of each."""
        found = []
        for part in self.parts:
            weight = np.sqrt(part.width.astype(np.float64))
            own = part.averaged(part.own[part.rows]) * weight[:, None]
            found.append((weight, np.linalg.qr(own)[0]))
        return tuple(found)

    def projected(self, columns: Sequence[FloatArray]) -> FloatArray:
        """Weighted columns (M, k) of each record without its own terms, concatenated."""
        left = []
        for (weight, basis), values in zip(self.bases, columns, strict=True):
            heavy = values * weight[:, None]
            left.append(heavy - basis @ (basis.T @ heavy))
        return np.concatenate(left)

    @cached_property
    def data(self) -> FloatArray:
        """Outputs as `projected`."""
        return self.projected(
            [part.averaged(part.measured[part.rows])[:, None] for part in self.parts]
        )[:, 0]

    @property
    def samples(self) -> int:
        """Number of samples of all records."""
        return sum(part.rows.size for part in self.parts)

    @property
    def range(self) -> float:
        """Largest range of a command."""
        return max(float(np.ptp(part.command)) for part in self.parts)


@dataclass(frozen=True, eq=False)
class Member:
    """One model of a family: ``x`` = [dead time, pole parameters, log values, starts]."""

    family: Family
    x: FloatArray
    cost: float

    @property
    def dead_time(self) -> float:
        """Dead time in s."""
        return float(self.x[0])

    @property
    def theta(self) -> FloatArray:
        """Parameters of the poles."""
        return self.x[1 : 1 + self.family.structure.order]

    @property
    def values(self) -> tuple[float, ...]:
        """Parameters of the actuator."""
        first = 1 + self.family.structure.order
        return tuple(np.exp(self.x[first : first + VALUES[self.family.kind]]).tolist())

    @property
    def starts(self) -> FloatArray:
        """Place within play or friction at the beginning of each record; empty if there is none."""
        return self.x[1 + self.family.structure.order + VALUES[self.family.kind] :]

    @property
    def acting(self) -> Acting:
        """The actuator."""
        return Acting(self.family.kind, self.family.place, self.values)

    @property
    def parameters(self) -> int:
        """Number of parameters, gain and zeros included."""
        return self.x.size + 1 + self.family.structure.zeros


@dataclass(frozen=True, eq=False)
class Task:
    """Fit of one family to records."""

    records: Records
    family: Family
    scales: Scales

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of x."""
        linear = parameter_bounds(self.family.structure, self.scales)
        reach, dt = self.records.range, self.scales.dt
        low, high = [linear.low], [linear.high]
        if self.family.kind == "slew_rate":
            low.append(np.log([0.2 * reach / self.scales.length]))
            high.append(np.log([2.0 * reach / dt]))
        elif self.family.kind != "none":
            count = VALUES[self.family.kind]
            low.append(np.log(np.full(count, 1e-4 * reach)))
            high.append(np.log(np.full(count, 1.5 * reach)))
            low.append(np.full(len(self.records.parts), -1.0))
            high.append(np.full(len(self.records.parts), 1.0))
        return np.concatenate(low), np.concatenate(high)

    @cached_property
    def steps(self) -> FloatArray:
        """Steps of differences."""
        order, values = self.family.structure.order, VALUES[self.family.kind]
        low = self.bounds[0]
        steps = np.full(low.size, _OF_START)
        steps[0] = _OF_DT * self.scales.dt
        steps[1 : 1 + order + values] = _OF_LOG
        return steps

    def columns(self, x: FloatArray) -> list[FloatArray]:
        """Responses of unit gain (M, 1 + zeros) of every record."""
        member = Member(self.family, x, np.nan)
        starts = member.starts if member.starts.size else np.zeros(len(self.records.parts))
        found = []
        for part, start in zip(self.records.parts, starts.tolist(), strict=True):
            response, slope = forced_response(
                part, member.acting, member.dead_time, member.theta, start
            )
            zeros = self.family.structure.zeros
            found.append(np.stack([response, slope][: 1 + zeros], axis=1))
        return found

    def residual(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (M,) of the best member with x, and its linear coefficients."""
        columns = self.records.projected(self.columns(x))
        size = np.sqrt((columns**2).sum(axis=0))
        size[size == 0] = 1.0
        coefficients = np.linalg.lstsq(columns / size, self.records.data, rcond=1e-9)[0] / size
        return self.records.data - columns @ coefficients, coefficients

    def moved(self, x: FloatArray, index: int, value: float) -> FloatArray:
        """The same x with another entry; S and J move together, by which S - J is kept.

        The distance at which a stem follows tells S - J much better than either.
        """
        found = x.copy()
        found[index] = value
        first = 1 + self.family.structure.order
        if VALUES[self.family.kind] == 2 and index in (first, first + 1):
            other = 2 * first + 1 - index
            least = float(np.exp(self.bounds[0][other]))
            along = np.exp(x[other]) + np.exp(value) - np.exp(x[index])
            found[other] = np.log(max(along, least))
        return found

    def cost(self, x: FloatArray) -> float:
        """Sum of squares."""
        residual = self.residual(x)[0]
        return float(residual @ residual)

    def slopes(self, x: FloatArray, residual: FloatArray, free: BoolArray) -> FloatArray:
        """Derivatives (M, k) of the residual by the free entries of x."""
        high = self.bounds[1]
        found = []
        for i in np.flatnonzero(free):
            step = self.steps[i] if x[i] + self.steps[i] <= high[i] else -self.steps[i]
            moved = x.copy()
            moved[i] += step
            found.append((self.residual(moved)[0] - residual) / step)
        return np.stack(found, axis=1)

    def improved(
        self,
        x: FloatArray,
        *,
        fixed: Sequence[int] = (),
        turns: int = _MOST_TURNS,
        tolerance: float = 1e-5,
    ) -> Member:
        """Follow a start to its minimum; entries of x that are `fixed` stay."""
        low, high = self.bounds
        x = np.clip(x, low, high)
        free = np.ones(x.size, dtype=np.bool_)
        free[list(fixed)] = False
        residual = self.residual(x)[0]
        cost, damping, failures = float(residual @ residual), 1e-2, 0
        jacobian = self.slopes(x, residual, free)
        for _ in range(turns):
            downhill = jacobian.T @ residual
            held = (x[free] <= low[free]) & (downhill > 0) | (x[free] >= high[free]) & (
                downhill < 0
            )
            normal = jacobian.T @ jacobian
            normal[held], normal[:, held] = 0.0, 0.0
            scale = np.maximum(np.diag(normal), 1e-12 * max(np.diag(normal).max(), 1e-300))
            scale[held] = 1.0
            step = np.linalg.solve(
                normal + np.diag(damping * scale + held), np.where(held, 0.0, -downhill)
            )
            longest = np.where(np.flatnonzero(free) == 0, self.scales.rise, _LONGEST)
            step /= max(float(np.abs(step / longest).max()), 1.0)
            trial = x.copy()
            trial[free] = np.clip(x[free] + step, low[free], high[free])
            left = self.residual(trial)[0]
            new = float(left @ left)
            if new < cost:
                done = cost - new < tolerance * cost and damping <= _FREELY
                x, residual, cost = trial, left, new
                damping, failures = max(0.2 * damping, 1e-9), 0
                if done:
                    break
                jacobian = self.slopes(x, residual, free)
            else:
                damping, failures = 8 * damping, failures + 1
                if failures > _MOST_FAILURES:
                    break
        return Member(self.family, x, cost)
