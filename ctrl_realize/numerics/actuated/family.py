"""Families of models with an actuator before lags and dead time, or behind them.

In front (`place` "input") the actuator changes the command, and lags and dead time follow: a
Hammerstein model. At the stem, lags and dead time come first: a Wiener model [1]_. A dead time
commutes with any actuator, so that there is only one. Stiction before linear dynamics was
identified in this way in [2]_. Gain and the terms of the records are eliminated, and the others
improved by `regression.marquardt` with differences for derivatives.

References
----------
.. [1] F. Giri and E.-W. Bai (eds.), Block-oriented Nonlinear System Identification, Springer 2010,
   doi:10.1007/978-1-84996-513-2.
.. [2] M. Jelali, Estimation of valve stiction in control loops using separable least-squares and
   global search algorithms, Journal of Process Control 18 (2008) 632-642.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from ..arrays import BoolArray, ComplexArray, FloatArray
from ..constants import SMALLEST
from ..engine.modal import partial_fractions
from ..engine.poles import poles_from_parameters
from ..engine.problem import Structure
from ..engine.responses import TOGETHER
from ..engine.structures import Scales, parameter_bounds
from ..regression.marquardt import Damping, damped_step, descend
from .motions import KINDS, Kind, Motion, Place, Properties, Size
from .records import Records

_OF_DT, _OF_LOG, _OF_START = 0.05, 1e-3, 1e-2  # steps of differences
_AT_ONCE = 2_000_000  # samples of responses
_ALIKE = 12  # decimals of sums of squares over that of the data
_MOST_TURNS = 30
_LONGEST = 1.0  # of a logarithm, in one step
_TOLERANCE = 1e-5  # of the sum of squares, gained by a step that is the last one
_FREELY = 1e-2  # damping up to which a short step tells that the bottom is reached
_ROUNDING = 1e-12  # of a response
_DAMPING = Damping(first=1e-2, rise=8.0, fall=5.0, least=1e-9, tries=6)


@dataclass(frozen=True, eq=False)
class Member:
    """One model of a family: ``x`` = [dead time, pole parameters, values, starts]."""

    family: ActuatedFamily
    x: FloatArray
    cost: float

    @property
    def poles(self) -> ComplexArray:
        """Poles in 1/s."""
        return np.asarray(poles_from_parameters(self.x[None, 1 : 1 + self.family.order])[0][0])

    @property
    def motion(self) -> Motion:
        """The actuator."""
        return self.family.motion(self.x)

    @property
    def starts(self) -> FloatArray:
        """Place within play or friction at the beginning of each record; empty if there is none."""
        return self.x[self.family.values.stop :]

    @property
    def parameters(self) -> int:
        """Number of parameters, gain included."""
        return self.x.size + 1


@dataclass(frozen=True, eq=False)
class _Point:
    """Parameters on the way down, and the damping of the step that led to them."""

    x: FloatArray
    residual: FloatArray
    cost: float
    damping: float


@dataclass(frozen=True, eq=False)
class ActuatedFamily:
    """Models of records with a kind of actuator at one place.

    Attributes
    ----------
    records : Records
    scales : Scales
        Initial guess of the response, see `structures`.
    order : int
        Number of lags.
    kind, place : str
        Of the actuator.
    levels : tuple of float
        Of the commands.
    """

    records: Records
    scales: Scales
    order: int
    kind: Kind
    place: Place
    levels: tuple[float, ...]

    @property
    def properties(self) -> Properties:
        """What is to be known about the kind of actuator."""
        return KINDS[self.kind]

    @property
    def structure(self) -> Structure:
        """That of the linear part."""
        return Structure(self.order, self.order)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of the actuator."""
        return self.properties.names or tuple(f"flow_at_{u:g}" for u in self.levels[1:-1])

    @property
    def values(self) -> slice:
        """Where x has the parameters of the actuator."""
        return slice(1 + self.order, 1 + self.order + len(self.names))

    @property
    def jump(self) -> int | None:
        """Where x has a slip jump."""
        jump = self.properties.jump
        return None if jump is None else self.values.start + jump

    def natural(self, entries: FloatArray) -> FloatArray:
        """Parameters of the actuator from their entries in x."""
        return np.exp(entries) if self.properties.logged else entries

    def motion(self, x: FloatArray) -> Motion:
        """The actuator of one member."""
        return Motion(self.kind, tuple(self.natural(x[self.values]).tolist()), self.levels)

    @property
    def size(self) -> Size:
        """What the size of parameters is measured by."""
        scales, levels = self.scales, np.array(self.levels)
        return Size(self.records.range, scales.rise, scales.length, scales.dt, levels)

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of x."""
        linear = parameter_bounds(self.structure, self.scales)
        starts = np.ones(len(self.records.parts) if self.properties.starts else 0)
        least, most = (np.full(len(self.names), end) for end in self.properties.bounds(self.size))
        low, high = (linear.low, least, -starts), (linear.high, most, starts)
        return np.concatenate(low), np.concatenate(high)

    @cached_property
    def steps(self) -> FloatArray:
        """Steps of differences."""
        steps = np.full(self.bounds[0].size, _OF_START)
        steps[0] = _OF_DT * self.scales.dt
        steps[1 : self.values.stop] = _OF_LOG
        return steps

    def forced(self, part: int, xs: FloatArray) -> FloatArray:
        """Responses of unit gain (K, N) of a record to its command, at every sample."""
        record, values = self.records.parts[part], self.values
        starts = xs[:, values.stop + part] if xs.shape[1] > values.stop else np.zeros(len(xs))
        cases = [(self.motion(x), start) for x, start in zip(xs, starts.tolist(), strict=True)]
        alike: dict[tuple[float, ...], list[int]] = {}
        for k, linear in enumerate(xs[:, : values.start].tolist()):
            alike.setdefault(tuple(linear), []).append(k)
        lags = np.array(list(alike))
        poles = poles_from_parameters(lags[:, 1:])[0]
        residues, gain, _ = partial_fractions(poles, np.ones(1), 1)
        weights = residues[:, :, 0] / gain[:, None]
        found = np.empty((len(xs), record.command.size))
        positions = {}
        if self.place == "input":
            positions = {case: case[0].driven(record, case[1]) for case in dict.fromkeys(cases)}
        waits = lags[:, 0] / record.dt - record.late
        for wait, each, weight, rows in zip(waits, poles, weights, alike.values(), strict=True):
            if positions:
                signals = np.array([positions[cases[k]] for k in rows])
                found[rows] = _lagged(signals, wait, each * record.dt, weight)
                continue
            demand = _lagged(record.command[None], wait, each * record.dt, weight)[0]
            for k in rows:
                motion, start = cases[k]
                found[k] = motion.followed(record.command[0] + demand, record.dt, start)
        return found

    def columns(self, xs: FloatArray) -> FloatArray:
        """Responses of unit gain (K, M) of all records, without what the regressors explain."""
        parts = enumerate(self.records.parts)
        return self.records.projected(
            np.concatenate([self.forced(i, xs)[:, part.rows] for i, part in parts], axis=1)
        )

    def residuals(self, xs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (K, M) of the best members with xs, and their gains (K,)."""
        columns = self.columns(xs)
        power = (columns**2).sum(axis=1)
        gains = columns @ self.records.data / np.where(power > 0, power, 1.0)
        return self.records.data - gains[:, None] * columns, gains

    def moved(self, x: FloatArray, index: int, value: float) -> FloatArray:
        """The same x with another entry; S and J move together, by which S - J is kept.

        The distance at which a stem follows tells S - J much better than either.
        """
        found = x.copy()
        found[index] = value
        first, jump = self.values.start, self.jump
        if jump == first + 1 and index in (first, jump):
            other = first + jump - index
            least = float(np.exp(self.bounds[0][other]))
            along = np.exp(x[other]) + np.exp(value) - np.exp(x[index])
            found[other] = np.log(max(along, least))
        return found

    def best(self, xs: FloatArray, count: int) -> list[FloatArray]:
        """Best `count` of xs; the first of those that are alike, as rates that limit nothing."""
        power = max(float(self.records.data @ self.records.data), SMALLEST)
        pieces = np.array_split(xs, 1 + xs.shape[0] * self.records.data.size // _AT_ONCE)
        costs = [(self.residuals(piece)[0] ** 2).sum(axis=1) for piece in pieces]
        parts = np.round(np.concatenate(costs) / power, _ALIKE)
        _, first = np.unique(parts, return_index=True)
        return [xs[i] for i in first[:count]]

    def free(self, fixed: Sequence[int] = ()) -> BoolArray:
        """Entries of x that steps move: all but those that are `fixed`."""
        free = np.ones(self.bounds[0].size, dtype=np.bool_)
        free[list(fixed)] = False
        free[self.values] &= not self.properties.stepwise
        return free

    def slopes(self, x: FloatArray, free: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of a model by the free entries of x (M, k), and by its gain (M,)."""
        steps = np.where(x + self.steps <= self.bounds[1], self.steps, -self.steps)[free]
        columns = self.columns(
            np.append(x[None], x + np.eye(x.size)[free] * steps[:, None], axis=0)
        )
        column, change = columns[0], columns[1:] - columns[0]
        # What changes nothing has no slope: rounding would send it anywhere.
        change[np.abs(change).max(axis=1) <= _ROUNDING * np.abs(column).max()] = 0.0
        gain = column @ self.records.data / max(float(column @ column), SMALLEST)
        return gain * (change / steps[:, None]).T, column

    def improved(
        self, x: FloatArray, *, fixed: Sequence[int] = (), turns: int = _MOST_TURNS
    ) -> Member:
        """Follow a start down `turns` steps at most; entries of x that are `fixed` stay."""
        free = self.free(fixed)
        low, high = (bound[free] for bound in self.bounds)
        longest = np.where(np.flatnonzero(free) == 0, self.scales.rise, _LONGEST)

        def at(place: FloatArray, damping: float = _DAMPING.first) -> _Point:
            residual = self.residuals(place[None])[0][0]
            return _Point(place, residual, float(residual @ residual), damping)

        def linearised(here: _Point) -> Callable[[float], _Point]:
            slopes, column = self.slopes(here.x, free)
            # Without what another gain would do (Kaufman's form).
            slopes -= np.outer(column, column @ slopes / max(float(column @ column), SMALLEST))
            inside, downhill = here.x[free], slopes.T @ here.residual
            slopes[:, (inside <= low) & (downhill < 0) | (inside >= high) & (downhill > 0)] = 0.0

            def ahead(damping: float) -> _Point:
                step = damped_step(slopes.T @ slopes, slopes.T @ here.residual, damping)
                step /= max(float(np.abs(step / longest).max()), 1.0)
                place = here.x.copy()
                place[free] = np.clip(inside + step, low, high)
                return at(place, damping)

            return ahead

        def finished(gain: float, here: _Point) -> bool:
            return gain < _TOLERANCE * (here.cost + gain) and here.damping <= _FREELY

        best, _ = descend(at(np.clip(x, *self.bounds)), linearised, finished, _DAMPING, turns)
        return Member(self, best.x, best.cost)


def _lagged(
    signals: FloatArray, wait: float, poles: ComplexArray, weights: ComplexArray
) -> FloatArray:
    """Responses (K, N) of unit gain to held signals (K, N), without their first values.

    The dead time and the poles (n,) are in samples; `weights` (n,) are the residues of a step.
    """
    whole = int(np.ceil(wait - TOGETHER))
    found = np.zeros_like(signals)
    kept = signals.shape[1] - whole
    if kept <= 1:
        return found
    found[:, whole:] = signals[:, :kept] - signals[:, :1]
    moves = signals[:, 1:kept] - signals[:, : kept - 1]
    late = found[:, whole + 1 :]
    for pole, residue in zip(poles.tolist(), weights.tolist(), strict=True):
        if pole.imag < 0:
            continue  # counted with its conjugate
        weight, decay = residue * np.exp(pole * max(whole - wait, 0.0)), np.exp(pole)
        if pole.imag == 0:
            late += lfilter([weight.real], [1.0, -decay.real], moves, axis=1)
        else:
            late += 2 * lfilter([weight], [1.0, -decay], moves, axis=1).real
    return found
