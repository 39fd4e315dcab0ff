"""Families of models with few parameters: by a map to a structure, or by a shape of their own.

Lags have rates, a pair and a zero that depend on few parameters: a family maps these to dead time,
poles and numerator of a structure, which the engine eliminates and differentiates. Real poles are
paired as in `engine.modal`, neighbours together: a pair of rates f >= s has omega = sqrt(f s) and
zeta = cosh(log(f / s) / 2), so that derivatives with respect to logarithms of rates are finite for
equal ones.

Others have a response that is a gain times a shape. The gain enters linearly. Where it has bounds,
the best one within them is that of least squares, clipped: for given other parameters the sum of
squares is a parabola of the gain. What is left is Kaufman's form of variable projection [1]_.

References
----------
.. [1] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.descend import descend
from ..engine.eliminate import compress_mapped, evaluate_mapped, evaluate_shaped
from ..engine.newton import settle
from ..engine.problem import Compressed, Evaluation, Family, Mapped, Problem
from ..engine.structures import CLOSE, Candidate, apart

_OTHERS = 1  # ends beside the best that are followed to their minimum, if they are as close


@dataclass(frozen=True, eq=False)
class UnitResponse:
    """Response (m,) with gain 1, its derivatives (m, k), and those of the poles (n, k).

    `numerator` (z + 1,) is that for gain 1, lowest power first.
    """

    values: FloatArray
    slopes: FloatArray
    numerator: FloatArray
    poles: ComplexArray
    dpoles: ComplexArray


@dataclass(frozen=True, eq=False)
class ShapedFamily(Family):
    """Models with a gain within bounds, and a shape that depends on the parameters (k,)."""

    gains: tuple[float, float]

    @abstractmethod
    def response(self, problem: Problem, x: FloatArray) -> UnitResponse:
        """Response of the shape."""

    @abstractmethod
    def tangent(self, x: FloatArray, gain: float) -> FloatArray:
        """Derivatives of `theta` and numerator (p, k + 1) with respect to parameters and gain."""

    def directions(self, problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of model, and of `theta` and numerator, by parameters and gain."""
        unit = self.response(problem, x)
        numerator = self._evaluated(problem, [unit], self.gains).numerator
        gain = float(numerator[0, 0] / unit.numerator[0])
        # Of the gain, which is a parameter here, nothing is eliminated.
        held = replace(
            unit,
            values=gain * unit.values,
            slopes=np.column_stack([gain * unit.slopes, unit.values]),
            dpoles=np.column_stack([unit.dpoles, np.zeros_like(unit.poles)]),
        )
        return self._evaluated(problem, [held], (1.0, 1.0)).jacobian[0], self.tangent(x, gain)

    def evaluate(self, problem: Problem, parameters: FloatArray) -> Evaluation:
        """Eliminate the linear terms at parameters (B, k)."""
        return self._evaluated(problem, [self.response(problem, x) for x in parameters], self.gains)

    def _evaluated(
        self, problem: Problem, units: list[UnitResponse], gains: tuple[float, float]
    ) -> Evaluation:
        parts = zip(*((u.values, u.slopes, u.poles, u.dpoles) for u in units), strict=True)
        shape, slopes, poles, dpoles = (np.stack(part) for part in parts)
        state = evaluate_shaped(problem, shape, slopes, gains, poles, dpoles)
        return replace(state, numerator=state.numerator * [u.numerator for u in units])


@dataclass(frozen=True, eq=False)
class MappedFamily(Family):
    """Models of a structure with dead time and poles that depend on the parameters."""

    @abstractmethod
    def mapped(self, parameters: FloatArray) -> Mapped:
        """Models at parameters (B, k), and their derivatives."""

    def theta(self, parameters: FloatArray) -> FloatArray:
        """Dead time and pole parameters (1 + n,) of one model."""
        return np.asarray(self.mapped(parameters[None]).theta[0])

    def evaluate(self, problem: Problem, parameters: FloatArray) -> Evaluation:
        """Eliminate the linear terms at parameters (B, k)."""
        return evaluate_mapped(problem, self.plain, self.mapped(parameters))

    def compress(self, problem: Problem, parameters: FloatArray) -> Compressed:
        """Eliminate the linear terms at parameters (B, k), in as few rows as can be."""
        return compress_mapped(problem, self.plain, self.mapped(parameters))


@dataclass(frozen=True, eq=False)
class LagFamily(MappedFamily):
    """Rational models, the numerator of which is a gain times a shape."""

    gains: tuple[float, float]

    def gain(self, problem: Problem, x: FloatArray) -> float:
        """Best gain of a model x (k,)."""
        unit = self.mapped(x[None]).numerator
        assert unit is not None
        return float(self.compress(problem, x[None]).numerator[0, 0] / unit[0, 0])

    def directions(self, problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of model, and of `theta` and numerator, by parameters and gain."""
        unit, gain = self.mapped(x[None]), self.gain(problem, x)
        assert unit.dtheta is not None
        assert unit.numerator is not None
        assert unit.dnumerator is not None
        dtheta = np.concatenate([unit.dtheta, np.zeros_like(unit.theta)[:, :, None]], axis=2)
        along = [gain * unit.dnumerator, unit.numerator[:, :, None]]
        dnumerator = np.concatenate(along, axis=2)
        # Of the gain, which is a parameter here, nothing is eliminated.
        held = Mapped(unit.theta, dtheta, gain * unit.numerator, dnumerator, (1.0, 1.0))
        state = evaluate_mapped(problem, self.plain, held)
        return state.jacobian[0], np.concatenate([dtheta[0], dnumerator[0]])


def paired(log_rates: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pole parameters (B, r) of real poles with log rates (B, r); derivatives, from (B, r, k)."""
    order = np.argsort(log_rates, axis=1, kind="stable")
    theta = np.take_along_axis(log_rates, order, axis=1)
    dtheta = np.take_along_axis(slopes, order[:, :, None], axis=1)
    odd = theta.shape[1] % 2
    slow, fast = slice(odd, None, 2), slice(odd + 1, None, 2)
    half = (theta[:, fast] - theta[:, slow]) / 2
    dhalf = (dtheta[:, fast] - dtheta[:, slow]) / 2
    theta[:, slow] += half
    dtheta[:, slow] += dhalf
    theta[:, fast] = np.log(np.cosh(half))
    dtheta[:, fast] = np.tanh(half)[:, :, None] * dhalf
    return theta, dtheta


def lowest(
    problem: Problem, family: Family, starts: FloatArray, dt: float, enough: float = np.inf
) -> Candidate:
    """Model of a family with the smallest sum of squares that is reached from starts (B, k).

    Models with more than `enough` are not followed to their minimum.
    """
    ends, costs = descend(problem, family, starts, family.bounds, dt)
    order = np.argsort(costs)
    best, least = ends[order[0]], float(costs[order[0]])
    if least > enough:
        return Candidate(family, best, least)
    near = ends[order[costs[order] <= least * (1 + CLOSE / problem.data.size)]]
    followed = (best, *apart(near)[:_OTHERS])
    fits = [settle(problem, family, end, family.bounds, dt) for end in followed]
    return Candidate(family, *min(fits, key=lambda fit: fit[1]))
