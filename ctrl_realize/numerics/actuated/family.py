"""Families of models with an actuator before lags and dead time, or behind them.

In front (`place` "input") the actuator changes the command, and lags and dead time follow: a
Hammerstein model. At the stem, lags and dead time come first: a Wiener model [1]_. A dead time
commutes with any actuator, so that there is only one. Stiction before linear dynamics was
identified in this way in [2]_. Derivatives are differences.

References
----------
.. [1] F. Giri and E.-W. Bai (eds.), Block-oriented Nonlinear System Identification, Springer 2010,
   doi:10.1007/978-1-84996-513-2.
.. [2] M. Jelali, Estimation of valve stiction in control loops using separable least-squares and
   global search algorithms, Journal of Process Control 18 (2008) 632-642.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from ..arrays import ComplexArray, FloatArray
from ..engine.modal import partial_fractions, poles_from_parameters
from ..engine.problem import Bounds, Problem, Structure
from ..engine.responses import TOGETHER
from ..engine.structures import Scales, parameter_bounds
from ..families.shaped import ShapedFamily, UnitResponse
from .motions import KINDS, Kind, Motion, Place, Properties, Size
from .records import Records

_OF_DT, _OF_LOG, _OF_START = 0.05, 1e-3, 1e-2  # steps of differences
_ROUNDING = 1e-12  # of a response


@dataclass(frozen=True, eq=False)
class ActuatedFamily(ShapedFamily):
    """Models over x = [dead time, pole parameters, values, starts] with a kind of actuator.

    Attributes
    ----------
    records : Records
        Of which the commands are used.
    scales : Scales
        Initial guess of the response, see `structures`.
    kind, place : str
        Of the actuator.
    levels : tuple of float
        Of the commands.
    """

    records: Records
    scales: Scales
    kind: Kind
    place: Place
    levels: tuple[float, ...]

    @property
    def free(self) -> int:
        """Number of free parameters beside dead time and gain."""
        return self.bounds.low.size - 1

    @property
    def properties(self) -> Properties:
        """What is to be known about the kind of actuator."""
        return KINDS[self.kind]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of the actuator."""
        return self.properties.named(self.levels)

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

    def held(self, index: int, value: float) -> ActuatedFamily:
        """Members with an entry of x that is given."""
        low, high = self.bounds.low.copy(), self.bounds.high.copy()
        low[index] = high[index] = value
        return replace(self, bounds=Bounds(low, high, smooth=True))

    def theta(self, parameters: FloatArray) -> FloatArray:
        """Dead time and pole parameters (1 + n,) of one model."""
        return parameters[: 1 + self.order]

    def tangent(self, x: FloatArray, gain: float) -> FloatArray:
        """Derivatives of `theta` and numerator with respect to parameters and gain."""
        poles, dpoles = self._poles(x)
        unit = np.prod(-poles).real
        found = np.eye(2 + self.order, x.size + 1)
        found[-1] = np.append(gain * unit * np.sum(dpoles / poles[:, None], axis=0).real, unit)
        return found

    def response(self, problem: Problem, x: FloatArray) -> UnitResponse:
        """Response with gain 1, and its derivatives."""
        steps = np.full(x.size, _OF_LOG)
        steps[0], steps[self.values.stop :] = _OF_DT * self.scales.dt, _OF_START
        steps = np.where(x + steps <= self.bounds.high, steps, -steps)
        moving = self.bounds.low < self.bounds.high
        # It decides alone which steps of a command move a stem: no slope tells it.
        moving[self.values] &= self.properties.jump != 0
        rows = self.unit(np.append(x[None], (x + np.diag(steps))[moving], axis=0))
        column, change = rows[0], rows[1:] - rows[0]
        # What changes nothing has no slope: rounding would send it anywhere.
        change[np.abs(change).max(axis=1) <= _ROUNDING * np.abs(column).max()] = 0.0
        slopes = np.zeros((x.size, column.size))
        slopes[moving] = change / steps[moving, None]
        poles, dpoles = self._poles(x)
        return UnitResponse(column, slopes.T, np.prod(-poles).real * np.ones(1), poles, dpoles)

    def _poles(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Poles (n,) in 1/s, and their derivatives (n, k)."""
        poles, derivative = poles_from_parameters(x[None, 1 : 1 + self.order])
        dpoles = np.zeros((self.order, x.size), dtype=np.complex128)
        dpoles[:, 1 : 1 + self.order] = derivative[0]
        return poles[0], dpoles

    def unit(self, xs: FloatArray) -> FloatArray:
        """Responses of unit gain (K, M) of all records."""
        parts = enumerate(self.records.parts)
        return np.concatenate([self._forced(i, xs)[:, part.rows] for i, part in parts], axis=1)

    def _forced(self, part: int, xs: FloatArray) -> FloatArray:
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

    def moved(self, x: FloatArray, index: int, value: float) -> FloatArray:
        """The same x with another entry; S and J move together, by which S - J is kept.

        The distance at which a stem follows tells S - J much better than either.
        """
        found = x.copy()
        found[index] = value
        first, jump = self.values.start, self.jump
        if jump == first + 1 and index in (first, jump):
            other = first + jump - index
            least = float(np.exp(self.bounds.low[other]))
            along = np.exp(x[other]) + np.exp(value) - np.exp(x[index])
            found[other] = np.log(max(along, least))
        return found


def actuated_family(
    records: Records,
    scales: Scales,
    order: int,
    kind: Kind,
    place: Place,
    levels: tuple[float, ...],
) -> ActuatedFamily:
    """Models of records with a number of lags and a kind of actuator at one place.

    `scales` is an initial guess of the response, `levels` are those of the commands.
    """
    properties, linear = KINDS[kind], parameter_bounds(Structure(order, order), scales)
    ends = properties.bounds(sizes(records, scales, levels))
    values = [np.full(len(properties.named(levels)), end) for end in ends]
    starts = np.ones(len(records.parts) if properties.starts else 0)
    low = np.concatenate([linear.low, values[0], -starts])
    high = np.concatenate([linear.high, values[1], starts])
    bounds, gains = Bounds(low, high, smooth=True), (-np.inf, np.inf)
    return ActuatedFamily(order, order, bounds, gains, records, scales, kind, place, levels)


def sizes(records: Records, scales: Scales, levels: tuple[float, ...]) -> Size:
    """What the parameters of an actuator are measured by."""
    reach = max(float(np.ptp(part.command)) for part in records.parts)
    return Size(reach, scales.rise, scales.length, scales.dt, np.array(levels))


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
