"""Families of models whose response is a gain times a shape, and those of them that are lags.

The gain enters linearly. Where it has bounds, the best one within them is that of least squares,
clipped: for given other parameters the sum of squares is a parabola of the gain. What is left is
Kaufman's form of variable projection [1]_.

Lags have rates, a pair and a zero that depend on few parameters. Real poles are paired as in
`engine.poles`, neighbours together: a pair of rates f >= s has omega = sqrt(f s) and
zeta = cosh(log(f / s) / 2), so that derivatives with respect to logarithms of rates are finite for
equal ones. The response and its derivatives are those of partial fractions [2]_.

References
----------
.. [1] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
.. [2] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
   section 2.3.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..constants import SMALLEST
from ..engine.compared_fits import CLOSE
from ..engine.descend import descend
from ..engine.local_terms import solve_upper
from ..engine.modal import moved_amplitudes, partial_fractions
from ..engine.newton import settle
from ..engine.poles import poles_from_parameters
from ..engine.problem import Evaluation, Family, Problem
from ..engine.structures import Candidate, apart

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
class Linearised:
    """One model without its linear terms, in units of the noise.

    ``unit`` (m,) and ``slopes`` (m, k) are the response with gain 1 and the derivatives of the
    model, both orthogonal to the regressors; `within`: the gain is not at a bound.
    """

    gain: float
    within: bool
    numerator: FloatArray
    regression: FloatArray
    residual: FloatArray
    unit: FloatArray
    slopes: FloatArray
    sensitivity: FloatArray

    @property
    def jacobian(self) -> FloatArray:
        """Minus the derivative of the residual (m, k)."""
        square = float(self.unit @ self.unit)
        if not self.within or square == 0:
            return self.slopes
        return self.slopes - np.outer(self.unit, (self.unit @ self.slopes) / square)


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
        model = self.linearised(problem, x)
        return np.column_stack([model.slopes, model.unit]), self.tangent(x, model.gain)

    def linearised(self, problem: Problem, x: FloatArray) -> Linearised:
        """Eliminate gain, regressors and local terms at x (k,)."""
        response = self.response(problem, x)
        data = problem.weighted_data
        shape = problem.weighted(response.values[:, None])
        columns = np.column_stack([shape, problem.weighted_regressors])
        remainder = np.column_stack([columns, data])
        terms = None
        if problem.segments is not None:
            terms = problem.local_terms(response.poles[None])
            remainder = terms.without(remainder[None])[0]
        q, r = problem.regressor_basis if terms is None else np.linalg.qr(remainder[:, 1:-1])
        inside = q.T @ remainder
        unit, resolved = (remainder[:, [0, -1]] - q @ inside[:, [0, -1]]).T
        square = float(unit @ unit)
        best = float(unit @ resolved) / square if square > 0 else 0.0
        gain = float(np.clip(best, *self.gains))
        size = np.maximum(np.linalg.norm(r, axis=0), SMALLEST)
        forced = (inside[:, -1] - gain * inside[:, 0])[None]
        regression = solve_upper((r / size)[None], forced)[0] / size
        slopes = gain * problem.weighted(response.slopes)
        if terms is not None:
            free = data - columns @ np.append(gain, regression)
            slopes += terms.moved(free[None], response.dpoles[None])[0]
        sensitivity = np.linalg.norm(slopes, axis=0)
        if terms is not None:
            slopes = terms.without(slopes[None])[0]
        slopes -= q @ (q.T @ slopes)
        return Linearised(
            gain=gain,
            within=self.gains[0] < best < self.gains[1],
            numerator=gain * response.numerator,
            regression=regression,
            residual=resolved - gain * unit,
            unit=unit,
            slopes=slopes,
            sensitivity=sensitivity,
        )

    def evaluate(self, problem: Problem, parameters: FloatArray) -> Evaluation:
        """Eliminate the linear terms at parameters (B, k)."""
        models = [self.linearised(problem, x) for x in parameters]
        return Evaluation(
            cost=np.array([model.residual @ model.residual for model in models]),
            residual=np.stack([model.residual for model in models]),
            jacobian=np.stack([model.jacobian for model in models]),
            sensitivity=np.stack([model.sensitivity for model in models]),
            numerator=np.stack([model.numerator for model in models]),
            regression=np.stack([model.regression for model in models]),
        )


class Mapped(NamedTuple):
    """Dead time and pole parameters (1 + n,), numerator (z + 1,), and their derivatives."""

    theta: FloatArray
    dtheta: FloatArray
    numerator: FloatArray
    dnumerator: FloatArray


@dataclass(frozen=True, eq=False)
class LagFamily(ShapedFamily):
    """Rational models, the numerator of which is a gain times a shape."""

    @abstractmethod
    def mapped(self, x: FloatArray) -> Mapped:
        """Model with gain 1, and its derivatives with respect to the parameters (k,)."""

    def theta(self, parameters: FloatArray) -> FloatArray:
        """Dead time and pole parameters (1 + n,) of one model."""
        return self.mapped(parameters).theta

    def tangent(self, x: FloatArray, gain: float) -> FloatArray:
        """Derivatives of `theta` and numerator with respect to parameters and gain."""
        theta, dtheta, shape, dshape = self.mapped(x)
        along = np.concatenate([dtheta, gain * dshape])
        return np.column_stack([along, np.append(np.zeros(theta.size), shape)])

    def response(self, problem: Problem, x: FloatArray) -> UnitResponse:
        """Response with gain 1, and its derivatives."""
        theta, dtheta, numerator, dnumerator = self.mapped(x)
        known, zeros, n = problem.known, numerator.size - 1, theta.size - 1
        free, by_parameters = poles_from_parameters(theta[None, 1:])
        poles = np.append(free[0], known.poles)[None]
        static, mode, slope = problem.drive.modes(theta[:1], poles)
        residues, gain, dresidues = partial_fractions(poles, known.numerator, zeros + 1)
        amplitudes = residues[0] @ numerator
        moved = moved_amplitudes(poles, amplitudes[None], dresidues, numerator[None])[0, :, :n]
        dpoles = by_parameters[0] @ dtheta[1:]
        # Derivatives through the amplitudes, the static part, and the modes.
        weights = residues[0] @ dnumerator + moved @ dpoles
        weights -= np.outer(amplitudes * poles[0], dtheta[0])
        level = gain[0] * (dnumerator[0] - numerator[0] * (1 / free[0] @ dpoles).real)
        stretch = amplitudes[:n, None] * dpoles
        return UnitResponse(
            _real(mode[0], amplitudes) + gain[0] * numerator[0] * static[0],
            _real(mode[0], weights) + _real(slope[0, :, :n], stretch) + np.outer(static[0], level),
            numerator,
            free[0],
            dpoles,
        )


def _real(modes: FloatArray, weights: FloatArray) -> FloatArray:
    """Real part of a product of modes, which may be real."""
    return np.asarray((modes @ (weights if np.iscomplexobj(modes) else weights.real)).real)


def paired(log_rates: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pole parameters (r,) of real poles with rates (r,), and derivatives, from theirs (r, k)."""
    order = np.argsort(log_rates, kind="stable")
    a, da = log_rates[order], slopes[order]
    odd = a.size % 2
    slow, fast = slice(odd, None, 2), slice(odd + 1, None, 2)
    half = (a[fast] - a[slow]) / 2
    theta, dtheta = a.copy(), da.copy()
    theta[slow], dtheta[slow] = (a[fast] + a[slow]) / 2, (da[fast] + da[slow]) / 2
    theta[fast] = np.log(np.cosh(half))
    dtheta[fast] = np.tanh(half)[:, None] * (da[fast] - da[slow]) / 2
    return theta, dtheta


def lowest(
    problem: Problem,
    family: Family,
    starts: FloatArray,
    dt: float,
    enough: float = np.inf,
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
