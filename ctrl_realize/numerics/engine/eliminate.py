"""Eliminate what enters linearly: residual and Jacobian of a batch of dead times and poles.

Numerator, regressors and local terms enter linearly and are eliminated (variable projection [2]_,
[3]_); for dead time and poles Kaufman's Jacobian [1]_ is used. A whole batch of models is evaluated
by the same array operations.

Response, derivatives, regressors and data of a delayed transfer function lie in the space of the
static part, the modes exp(p t) and their derivatives t exp(p t), the regressors and the data.
`compress` takes the rows of a record, hundreds or thousands, to as many as these columns are, by an
orthogonal transformation [4]_: squares and products of residual and Jacobian, all that a search
needs, do not change. `evaluate` leaves the rows as they are.

References
----------
.. [1] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
.. [2] G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least
   squares problems whose variables separate, SIAM J. Numer. Anal. 10 (1973) 413-432,
   doi:10.1137/0710036.
.. [3] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [4] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section
   5.3 (the full-rank least squares problem).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..signals.sines import Sines
from .local_terms import LocalTerms, solve_upper, triangle
from .modal import RealModes, moved_amplitudes, partial_fractions, poles_from_parameters
from .problem import Compressed, Eliminated, Evaluation, Family, Mapped, Problem, Structure

# The C library of Linux returns freed memory to the system beyond twice the largest block that was
# ever freed (mallopt(3), M_MMAP_THRESHOLD), and every evaluation would fetch it again: 47 000 page
# faults and a tenth of the time of a fit of 1000 samples.
np.empty(2**21)


def eliminate(problem: Problem, structure: Structure, parameters: FloatArray) -> Eliminated:
    """Eliminate the linear terms at parameters (B, 1 + n), and leave derivatives aside."""
    if isinstance(structure, Family):
        return structure.compress(problem, parameters)
    residual, weights, _ = _eliminated(_linear(problem, structure, parameters))
    numerator = weights[:, : structure.zeros + 1]
    return Eliminated(np.add.reduce(residual * residual, axis=1), numerator)


def drawn_numerators(
    problem: Problem,
    structure: Structure,
    parameters: FloatArray,
    std: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Numerators (B, n - r + 1) at parameters (B, 1 + n), each fitted to data with errors anew.

    The errors have a standard deviation in units of the noise. Those that no linear term follows
    are left out.
    """
    linear = _linear(problem, structure, parameters)
    basis = _eliminated(linear)[2]
    moves = std * rng.standard_normal((len(basis), basis.shape[2], 1))
    linear[:, :, -1:] += basis @ moves
    return _eliminated(linear)[1][:, : structure.zeros + 1]


def _linear(problem: Problem, structure: Structure, parameters: FloatArray) -> FloatArray:
    """Responses to powers of s (B, k, n - r + 1), regressors and data, in few rows."""
    models, q = _Models(problem, structure, parameters), problem.regressors.shape[1]
    columns = models.columns(slopes=False)
    if models.local is None:
        return models.linear(triangle(columns)[:, q:, q:])
    left = [part.left for part in models.local.reduced(columns)]
    return models.linear(np.concatenate(left, axis=1), q)


def compress(problem: Problem, structure: Structure, parameters: FloatArray) -> Compressed:
    """Eliminate the linear terms at parameters (B, 1 + n), in as few rows as can be."""
    if isinstance(structure, Family):
        return structure.compress(problem, parameters)
    return compress_mapped(problem, structure, Mapped(parameters))


def compress_mapped(problem: Problem, structure: Structure, mapped: Mapped) -> Compressed:
    """`compress` for models of a structure that depend on other parameters."""
    models, q = _Models(problem, structure, mapped.theta), problem.regressors.shape[1]
    columns, parts = models.columns(), []
    if models.local is None:
        left, q = triangle(columns)[:, q:, q:], 0
        k = left.shape[2]
    else:
        k = columns.shape[2]
        # Beside them, the derivatives of the modes of free responses.
        free = models.modes.columns(models.local.slope) * problem.root_weight[:, None]
        parts = models.local.reduced(np.concatenate([columns, free], axis=2))
        left = np.concatenate([part.left for part in parts], axis=1)
    linear, count = models.linear(left[:, :, :k], q), structure.zeros + 1
    residual, weights, basis, gain = _within(linear, mapped.numerator, mapped.gains)
    derivative = left[:, :, q : k - 1] @ models.slopes(weights[:, :count])
    if models.local is not None:
        remainder = models.remainder(weights, k)
        moved = [
            part.left[:, :, k:] @ models.moved(models.local.amplitudes(part, remainder))
            for part in parts
        ]
        derivative[:, :, 1:] += np.concatenate(moved, axis=1)
    derivative = mapped.along(derivative, linear[:, :, :count], gain)
    cost = np.add.reduce(residual * residual, axis=1)
    return Compressed(cost, weights[:, :count], residual, _orthogonal(derivative, basis))


def evaluate(problem: Problem, structure: Structure, parameters: FloatArray) -> Evaluation:
    """Eliminate the linear terms at parameters (B, 1 + n), in the rows of the problem."""
    if isinstance(structure, Family):
        return structure.evaluate(problem, parameters)
    return evaluate_mapped(problem, structure, Mapped(parameters))


def evaluate_mapped(problem: Problem, structure: Structure, mapped: Mapped) -> Evaluation:
    """`evaluate` for models of a structure that depend on other parameters."""
    models, q = _Models(problem, structure, mapped.theta), problem.regressors.shape[1]
    columns, count = models.columns(), structure.zeros + 1
    linear = models.linear(columns, q)

    def slopes(numerator: FloatArray, gain: FloatArray | None) -> FloatArray:
        made = columns[:, :, q:-1] @ models.slopes(numerator)
        return mapped.along(made, linear[:, :, :count], gain)

    dpoles = models.dfree if mapped.dtheta is None else models.dfree @ mapped.dtheta[:, 1:]
    return _in_rows(linear, count, (mapped.numerator, mapped.gains), slopes, models.local, dpoles)


def evaluate_shaped(
    problem: Problem,
    shape: FloatArray,
    slopes: FloatArray,
    gains: tuple[float, float],
    poles: ComplexArray,
    dpoles: ComplexArray,
) -> Evaluation:
    """`evaluate` for gains times shapes (B, m), which have derivatives (B, m, k).

    Free responses have poles (B, n) with derivatives (B, n, k). The numerator is the gain.
    """
    fixed = np.append(problem.weighted_regressors, problem.weighted_data[:, None], axis=1)
    made = problem.weighted(np.append(shape[:, :, None], slopes, axis=2))
    linear = np.append(made[:, :, :1], np.tile(fixed, (len(shape), 1, 1)), axis=2)
    local = None if problem.segments is None else problem.local_terms(poles)
    own = np.ones((len(shape), 1)), gains
    return _in_rows(
        linear, 1, own, lambda gain, _: gain[:, :, None] * made[:, :, 1:], local, dpoles
    )


def _in_rows(
    linear: FloatArray,
    count: int,
    shape: tuple[FloatArray | None, tuple[float, float]],
    slopes: Callable[[FloatArray, FloatArray | None], FloatArray],
    local: LocalTerms | None,
    dpoles: ComplexArray,
) -> Evaluation:
    """Eliminate columns (B, m, k), the first of which are `count` of the numerator.

    `shape` is the numerator for gain 1, if only the gain is free, and the bounds of the gain.
    `slopes` has the derivatives of models by their numerators and gains, free responses aside.
    """
    left = linear if local is None else local.without(linear)
    residual, weights, basis, gain = _within(left, *shape)
    derivative = slopes(weights[:, :count], gain)
    if local is not None:
        remainder = linear[:, :, -1] - (linear[:, :, :-1] @ weights[:, :, None])[:, :, 0]
        moved = local.moved(remainder, dpoles)  # of a structure, without the dead time
        derivative[:, :, derivative.shape[2] - moved.shape[2] :] += moved
    sensitivity = np.sqrt(np.einsum("bmp,bmp->bp", derivative, derivative))
    if local is not None:
        derivative = local.without(derivative)
    return Evaluation(
        np.add.reduce(residual * residual, axis=1),
        weights[:, :count],
        residual,
        _orthogonal(derivative, basis),
        sensitivity,
        weights[:, count:],
    )


class _Models:
    """Models of a structure at parameters (B, 1 + n), and the columns that they consist of.

    ``weights`` (B, 1 + J, n - r + 1) of static part and modes make the responses to one power of s
    in the numerator each.
    """

    def __init__(self, problem: Problem, structure: Structure, parameters: FloatArray) -> None:
        self._problem, self._tau = problem, parameters[:, 0]
        self._free, self.dfree = poles_from_parameters(parameters[:, 1:])
        self._poles = np.concatenate(
            [self._free, np.tile(problem.known.poles, (len(parameters), 1))], axis=1
        )
        self.modes = RealModes(self._poles, structure.order)
        residues, gain, self._dresidues = partial_fractions(
            self._poles, problem.known.numerator, structure.zeros + 1
        )
        self._residues, self._gain = residues, gain
        self.weights = np.zeros((len(residues), 1 + residues.shape[1], residues.shape[2]))
        self.weights[:, 0, 0] = gain
        self.weights[:, 1:] = self.modes.weights(residues)
        jumps = structure.relative_degree == 0
        self._sines = problem.drive if jumps and isinstance(problem.drive, Sines) else None
        self.local = None if problem.segments is None else problem.local_terms(self._free)

    def columns(self, *, slopes: bool = True) -> FloatArray:
        """Weighted regressors, static part, modes, their derivatives, and data (B, m, k).

        Before the data of points of a frequency response there is the derivative of a direct term.
        """
        problem, n = self._problem, self._free.shape[1]
        static, mode, slope = problem.drive.modes(self._tau, self._poles)
        parts = [static[:, :, None], self.modes.columns(mode)]
        if slopes:
            parts.append(self.modes.columns(slope[:, :, :n]))
        if slopes and self._sines is not None:
            parts.append(self._sines.direct_slope(self._tau)[:, :, None])
        fixed = problem.weighted_regressors, problem.weighted_data[:, None]
        q, width = fixed[0].shape[1], sum(part.shape[2] for part in parts)
        # A column is contiguous, as LAPACK has it.
        space = np.empty((len(self._tau), q + width + 1, problem.data.size)).swapaxes(1, 2)
        space[:, :, :q], space[:, :, -1:] = fixed
        np.concatenate(parts, axis=2, out=space[:, :, q:-1])
        space[:, :, q:-1] = problem.weighted(space[:, :, q:-1])
        return space

    def linear(self, columns: FloatArray, regressors: int = 0) -> FloatArray:
        """Responses (B, m, n - r + 1), regressors and data, from columns."""
        made = columns[:, :, regressors : regressors + self.weights.shape[1]] @ self.weights
        return np.concatenate([made, columns[:, :, :regressors], columns[:, :, -1:]], axis=2)

    def slopes(self, numerator: FloatArray) -> FloatArray:
        """Weights (B, k, 1 + n) of the columns in the derivatives of the models."""
        n, count = self._free.shape[1], self._poles.shape[1]
        amplitudes = (self._residues @ numerator[:, :, None])[:, :, 0]
        through = np.empty((len(numerator), count, 1 + n), dtype=np.complex128)
        through[:, :, 0] = -amplitudes * self._poles
        turned = moved_amplitudes(self._poles, amplitudes, self._dresidues, numerator)
        through[:, :, 1:] = turned[:, :, :n] @ self.dfree
        found = np.zeros((len(numerator), 1 + count + n + (self._sines is not None), 1 + n))
        level = ((-1.0 / self._free)[:, None] @ self.dfree)[:, 0].real
        found[:, 0, 1:] = level * (self._gain * numerator[:, 0])[:, None]
        found[:, 1 : 1 + count] = self.modes.weights(through)
        found[:, 1 + count : 1 + count + n, 1:] = self.moved(amplitudes[:, :n])
        if self._sines is not None:
            found[:, -1, 0] = numerator[:, -1]
        return found

    def moved(self, amplitudes: ComplexArray) -> FloatArray:
        """Weights (B, n, n) of the modes' derivatives, where modes of amplitudes (B, n) move."""
        return self.modes.weights(amplitudes[:, :, None] * self.dfree)

    def remainder(self, weights: FloatArray, count: int) -> FloatArray:
        """Weights (B, count) of all columns in the data without regressors and responses."""
        q, (made, powers) = self._problem.regressors.shape[1], self.weights.shape[1:]
        found = np.zeros((len(weights), count))
        found[:, :q] = -weights[:, powers:]
        found[:, q : q + made] = -(self.weights @ weights[:, :powers, None])[:, :, 0]
        found[:, -1] = 1.0
        return found


def _eliminated(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residual (B, k) of the last column, weights (B, z) of the others, their orthonormal basis."""
    columns, data = columns[:, :, :-1], columns[:, :, -1:]
    # Columns scaled to equal norm: the powers of s differ by many decades.
    norm = np.sqrt(np.add.reduce(columns * columns, axis=1))
    norm[norm == 0] = 1.0
    columns = columns / norm[:, None]
    if columns.shape[2] == 1:
        inside = np.swapaxes(columns, 1, 2) @ data
        return (data - columns @ inside)[:, :, 0], inside[:, :, 0] / norm, columns
    # Variable projection: residual = (I - Q Q') data (Golub and Pereyra 1973).
    q, r = np.linalg.qr(columns)
    inside = np.swapaxes(q, 1, 2) @ data
    return (data - q @ inside)[:, :, 0], solve_upper(r, inside[:, :, 0]) / norm, q


def _within(
    linear: FloatArray, shape: FloatArray | None, gains: tuple[float, float]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]:
    """`_eliminated`; where only the gain of a numerator is free, the best within its bounds."""
    if shape is None:
        return *_eliminated(linear), None
    count = shape.shape[1]
    unit = linear[:, :, :count] @ shape[:, :, None]
    linear = np.concatenate([unit, linear[:, :, count:]], axis=2)
    residual, weights, basis = _eliminated(linear)
    (low, high), best = gains, weights[:, 0]
    gain, held = np.clip(best, low, high), (best <= low) | (best >= high) | ~unit.any(axis=(1, 2))
    if held.any():
        # The sum of squares is a parabola of the gain: the best one is at the bound.
        rest, basis[held] = linear[held], 0.0
        rest[:, :, -1] -= gain[held, None] * rest[:, :, 0]
        residual[held] = rest[:, :, -1]
        if rest.shape[2] > 2:
            residual[held], weights[held, 1:], basis[held, :, 1:] = _eliminated(rest[:, :, 1:])
    numerator = gain[:, None] * shape
    return residual, np.concatenate([numerator, weights[:, 1:]], axis=1), basis, gain


def _orthogonal(columns: FloatArray, basis: FloatArray) -> FloatArray:
    """Project an orthonormal basis (B, m, k) out of columns (B, m, l)."""
    return np.asarray(columns - basis @ (np.swapaxes(basis, 1, 2) @ columns))
