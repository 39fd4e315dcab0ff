"""Families of models with an actuator, and the residual of one of their members.

Gain, lead, and the terms of the records enter linearly and are eliminated (variable projection
[1]_); what is left is improved by `regression.marquardt` with differences for derivatives.

References
----------
.. [1] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import BoolArray, FloatArray
from ..engine.structures import Scales, parameter_bounds
from ..engine.varpro import Structure
from ..regression.marquardt import Damping, damped_step, descend
from .kinds import FORMS, Acting, Form, Kind, Place, Size
from .motions import forced_responses
from .records import ActuatedRecord

_OF_DT, _OF_LOG, _OF_START = 0.05, 1e-3, 1e-2  # steps of differences
_AT_ONCE = 100_000  # samples of responses
_ALIKE = 12  # decimals of residuals, and of sums of squares, over those of the data
_MOST_TURNS = 30
_LONGEST = 1.0  # of a logarithm, in one step
_DAMPING = Damping(first=1e-2, rise=8.0, fall=5.0, least=1e-9, tries=6)
_FREELY = 1e-2  # damping up to which a short step tells that the bottom is reached


@dataclass(frozen=True)
class Family:
    """Order and zeros of the linear part, kind of actuator, its place, and levels it depends on."""

    structure: Structure
    kind: Kind = "none"
    place: Place = "input"
    levels: tuple[float, ...] = ()

    @property
    def form(self) -> Form:
        """What is to be known about the kind of actuator."""
        return FORMS[self.kind]

    @property
    def values(self) -> slice:
        """Where x has the parameters of the actuator."""
        first = 1 + self.structure.order
        return slice(first, first + (self.form.count or max(len(self.levels) - 2, 0)))

    @property
    def jump(self) -> int | None:
        """Where x has a slip jump."""
        return None if self.form.jump is None else self.values.start + self.form.jump

    def natural(self, entries: FloatArray) -> FloatArray:
        """Parameters of the actuator from their entries in x."""
        return np.exp(entries) if self.form.logged else entries


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
        return tuple(self.family.natural(self.x[self.family.values]).tolist())

    @property
    def starts(self) -> FloatArray:
        """Place within play or friction at the beginning of each record; empty if there is none."""
        return self.x[self.family.values.stop :]

    @property
    def acting(self) -> Acting:
        """The actuator."""
        return Acting(self.family.kind, self.family.place, self.values, self.family.levels)

    @property
    def parameters(self) -> int:
        """Number of parameters, gain and zeros included."""
        return self.x.size + 1 + self.family.structure.zeros


@dataclass(frozen=True, eq=False)
class _Point:
    """Parameters on the way down, and the damping of the step that led to them."""

    x: FloatArray
    residual: FloatArray
    cost: float
    damping: float


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
        values = self.family.values
        count = values.stop - values.start
        least, most = self.family.form.bounds(self.size)
        starts = len(self.records.parts) if self.family.form.starts else 0
        return (
            np.concatenate([linear.low, np.full(count, least), np.full(starts, -1.0)]),
            np.concatenate([linear.high, np.full(count, most), np.full(starts, 1.0)]),
        )

    @property
    def size(self) -> Size:
        """What the size of parameters is measured by."""
        return Size(
            self.records.range, self.scales.rise, self.scales.length, self.scales.dt,
            self.family.levels,
        )  # fmt: skip

    @cached_property
    def steps(self) -> FloatArray:
        """Steps of differences."""
        steps = np.full(self.bounds[0].size, _OF_START)
        steps[0] = _OF_DT * self.scales.dt
        steps[1 : self.family.values.stop] = _OF_LOG
        return steps

    def responses(self, xs: FloatArray) -> list[FloatArray]:
        """Responses of unit gain (1 + zeros, K, M) of every record, for K members (K, ...)."""
        family, parts = self.family, self.records.parts
        actings = [Member(family, x, np.nan).acting for x in xs]
        starts = xs[:, family.values.stop :]
        if not starts.size:
            starts = np.zeros((len(xs), len(parts)))
        theta = xs[:, 1 : 1 + family.structure.order]
        return [
            forced_responses(part, actings, xs[:, 0], theta, start, family.structure.zeros)
            for part, start in zip(parts, starts.T, strict=True)
        ]

    def columns(self, x: FloatArray) -> list[FloatArray]:
        """Responses of unit gain (M, 1 + zeros) of every record."""
        return [one[:, 0].T for one in self.responses(x[None])]

    def residuals(self, xs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residuals (K, M) of the best members with xs, and linear coefficients."""
        zeros, data = self.family.structure.zeros, self.records.data
        columns = self.records.projected(
            [one.reshape(-1, one.shape[2]).T for one in self.responses(xs)]
        )
        size = np.sqrt((columns**2).sum(axis=0))
        size[size == 0] = 1.0
        columns /= size
        table = columns.T.reshape(1 + zeros, len(xs), -1)
        if zeros:
            found = [
                np.linalg.lstsq(one.T, data, rcond=1e-9)[0] for one in table.transpose(1, 0, 2)
            ]
            coefficients = np.array(found)
        else:
            coefficients = (table[0] @ data)[:, None]
        fitted = np.einsum("jkm,kj->km", table, coefficients)
        return data - fitted, coefficients / size.reshape(1 + zeros, -1).T

    def residual(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (M,) of the best member with x, and its linear coefficients."""
        left, coefficients = self.residuals(x[None])
        return left[0], coefficients[0]

    def moved(self, x: FloatArray, index: int, value: float) -> FloatArray:
        """The same x with another entry; S and J move together, by which S - J is kept.

        The distance at which a stem follows tells S - J much better than either.
        """
        found = x.copy()
        found[index] = value
        first, jump = self.family.values.start, self.family.jump
        if jump == first + 1 and index in (first, jump):
            other = first + jump - index
            least = float(np.exp(self.bounds[0][other]))
            along = np.exp(x[other]) + np.exp(value) - np.exp(x[index])
            found[other] = np.log(max(along, least))
        return found

    def best(self, xs: Sequence[FloatArray], count: int) -> list[FloatArray]:
        """Best `count` of xs; the first of those that are alike, as rates that limit nothing."""
        power = max(float(self.records.data @ self.records.data), 1e-300)
        few = max(_AT_ONCE // self.records.data.size, 1)
        costs = [
            (self.residuals(np.array(xs[k : k + few]))[0] ** 2).sum(axis=1)
            for k in range(0, len(xs), few)
        ]
        parts = np.round(np.concatenate([np.empty(0), *costs]) / power, _ALIKE)
        return [xs[i] for i in np.argsort(parts, kind="stable")[:count]]

    def slopes(self, x: FloatArray, residual: FloatArray, free: BoolArray) -> FloatArray:
        """Derivatives (M, k) of the residual by the free entries of x."""
        steps = np.where(x + self.steps <= self.bounds[1], self.steps, -self.steps)[free]
        moved = x + np.eye(x.size)[free] * steps[:, None]
        change = self.residuals(moved)[0] - residual
        # What changes nothing has no slope: rounding would send it anywhere.
        nothing = 10.0**-_ALIKE * float(np.abs(self.records.data).max())
        change[np.abs(change).max(axis=1) <= nothing] = 0.0
        return np.asarray((change / steps[:, None]).T)

    def improved(
        self,
        x: FloatArray,
        *,
        fixed: Sequence[int] = (),
        turns: int = _MOST_TURNS,
        tolerance: float = 1e-5,
    ) -> Member:
        """Follow a start down `turns` steps at most; entries of x that are `fixed` stay."""
        low, high = self.bounds
        free = np.ones(x.size, dtype=np.bool_)
        free[list(fixed)] = False
        if self.family.form.stepwise:
            free[self.family.values] = False
        low, high = low[free], high[free]
        longest = np.where(np.flatnonzero(free) == 0, self.scales.rise, _LONGEST)
        tried = 0

        def at(place: FloatArray, damping: float) -> _Point:
            residual = self.residual(place)[0]
            return _Point(place, residual, float(residual @ residual), damping)

        def linearised(here: _Point) -> Callable[[float], _Point]:
            jacobian, inside = self.slopes(here.x, here.residual, free), here.x[free]
            downhill = jacobian.T @ here.residual
            jacobian[:, (inside <= low) & (downhill > 0) | (inside >= high) & (downhill < 0)] = 0.0
            gram, slope = jacobian.T @ jacobian, jacobian.T @ here.residual

            def ahead(damping: float) -> _Point:
                nonlocal tried
                tried += 1
                step = damped_step(gram, -slope, damping)
                step /= max(float(np.abs(step / longest).max()), 1.0)
                place = here.x.copy()
                place[free] = np.clip(inside + step, low, high)
                return at(place, damping)

            return ahead

        def finished(gain: float, here: _Point) -> bool:
            little = gain < tolerance * (here.cost + gain) and here.damping <= _FREELY
            return little or tried >= turns

        start = at(np.clip(x, *self.bounds), _DAMPING.first)
        best, _ = descend(start, linearised, finished, _DAMPING, turns)
        return Member(self.family, best.x, best.cost)
