"""Points of a frequency response as a problem of the engine, and its fits.

The model is a stable transfer function behind a dead time; the likelihood is that of [1]_, [2]_.
See `signals.sines` for the rows.

References
----------
.. [1] R. Pintelon and L. Van Biesen, Identification of transfer functions with time delay and its
   application to cable fault location, IEEE Trans. Instrum. Meas. 39 (1990) 479-484.
.. [2] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
.. [3] H. White, A heteroskedasticity-consistent covariance matrix estimator and a direct test for
   heteroskedasticity, Econometrica 48 (1980) 817-838, doi:10.2307/1912934.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import ComplexArray, FloatArray
from ..engine.descend import descend, fit_batch
from ..engine.eliminate import evaluate
from ..engine.modal import partial_fractions, poles_from_parameters
from ..engine.problem import Evaluation, KnownFactor, Problem, Structure
from ..engine.profile import Points, profile_curve, profile_limits, with_ends, without_points
from ..engine.structures import Candidate, Scales, parameter_bounds
from ..signals.sines import HeldSines, Sines, stacked_parts

_FIRST_ITERATIONS = 10  # after which the starts are compared, and the best ones go on
_BEYOND, _INTEGRATES, _SHARPEST, _DULLEST = 100.0, 1e4, 1e-4, 1e3
"""Of poles of a frequency response: times beyond the band, and damping of a pair. A pole farther
away turns the phase by 0.6 degrees at most. One that stands for an integrator is slower still, as
one of a dull pair is: of nine intervals of an integrator seven missed the dead time, since second
poles made up for 0.6 degrees."""
_LEAST_INFORMATION = 1e-10
"""Singular value, over the largest, of scaled columns that is rounding: the data do not determine
the parameter."""


@dataclass(frozen=True, eq=False)
class FRFData:
    """A frequency response with weights, scaled so that frequencies are around 1.

    Parameters
    ----------
    s : ndarray, shape (K,)
        ``j omega``.
    response : ndarray, shape (K,)
        Measured.
    weight : ndarray, shape (K,)
        One over the standard deviation of the complex response, up to a factor.
    max_dead_time : float
        Upper bound of the search.
    held : float
        Sample time of the hold that was divided out; 0 if there was none.
    """

    s: ComplexArray
    response: ComplexArray
    weight: FloatArray
    max_dead_time: float
    held: float = 0.0

    @property
    def omega(self) -> FloatArray:
        """Angular frequencies (K,)."""
        return np.abs(self.s)

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Points with a significant phase; all if there are no weights."""
        clear = np.asarray(np.abs(self.response) * self.weight > 1 / 0.3)
        return clear if clear.sum() >= 4 else np.ones(clear.size, dtype=np.bool_)

    @cached_property
    def problem(self) -> Problem:
        """Rows whose sum of squares is that of ``|weight (response - model)|``."""
        parts, weights = stacked_parts(self.response), np.concatenate([self.weight, self.weight])
        no_regressor = np.empty((2 * self.s.size, 0))
        drive = HeldSines(self.omega, self.held) if self.held else Sines(self.omega)
        return Problem(parts, weights, drive, no_regressor, KnownFactor())

    @cached_property
    def scales(self) -> Scales:
        """Range of the dead time and of the poles, in 1 / frequency."""
        low, high = float(self.omega.min()), float(self.omega.max())
        return Scales(1 / high, 1 / low, 1 / low, 1 / high, self.max_dead_time, bounds=self._bounds)

    def _bounds(self, order: int) -> tuple[FloatArray, FloatArray]:
        """Poles two decades beyond the band, resonances sharper than a record can show them."""
        slow = float(np.log(self.omega.min() / (_INTEGRATES if order == 1 else _BEYOND)))
        fast = float(np.log(self.omega.max() * _BEYOND))
        pairs, single = order // 2, order % 2
        low = [slow] * single + [slow, np.log(_SHARPEST)] * pairs
        high = [fast] * single + [fast, np.log(_DULLEST)] * pairs
        return np.array(low), np.array(high)

    def poles_to_grow(self, fit: Candidate) -> ComplexArray:
        """Poles (n,) from which larger orders start: those have no integrator of their own."""
        slowest = float(self.omega.min()) / _BEYOND if fit.structure.order == 1 else 0.0
        return np.asarray(fit.poles * np.maximum(slowest / np.abs(fit.poles), 1.0))

    def at(self, fit: Candidate) -> Evaluation:
        """Evaluate the problem at a fit, as a batch of one."""
        return evaluate(self.problem, fit.structure, fit.parameters[None])

    def misfit(self, fit: Candidate) -> ComplexArray:
        """Weighted residual (K,) of a fit."""
        rows = self.at(fit).residual[0]
        return np.asarray(rows[: self.s.size] + 1j * rows[self.s.size :])


def refined(
    data: FRFData, structure: Structure, starts: Sequence[FloatArray], kept: int
) -> list[Candidate]:
    """Refine several starts: all of them a little, the best few to the end; the best first."""
    bounds = parameter_bounds(structure, data.scales)
    x, cost = fit_batch(
        data.problem, structure, np.array(starts), bounds, most_iterations=_FIRST_ITERATIONS
    )
    best = np.argsort(cost, kind="stable")[:kept]
    x, cost = descend(data.problem, structure, x[best], bounds, data.scales.dt)
    return [Candidate(structure, x[k], float(cost[k])) for k in np.argsort(cost, kind="stable")]


def dead_time_interval(
    data: FRFData, fit: Candidate, points: Points, variance: float, *, solved: bool
) -> tuple[float, float]:
    """95 % interval of the profile likelihood of one structure.

    Parameters
    ----------
    data : FRFData
    fit : Candidate
    points : Points
        Of its profile.
    variance : float
        Variance of a row, half of that of a point.
    solved : bool
        Solve for the ends. Between points of the profile they are known to a few parts in a
        hundred, which is enough for the weight of one structure among others.
    """
    least = min(point.cost for point in points.values())
    excess = {at: (point.cost - least) / variance for at, point in points.items()}
    which = (True, True) if solved else without_points(excess)
    points = with_ends(data.problem, points, variance, data.scales, which)
    low, high = profile_limits(*profile_curve(points, fit, variance, data.scales))
    return min(low, fit.dead_time), max(high, fit.dead_time)


def pole_deviations(
    data: FRFData, fit: Candidate, scale: float, *, robust: bool
) -> tuple[ComplexArray, FloatArray]:
    """Return the poles, slow ones first, and the standard error of each.

    Parameters
    ----------
    data : FRFData
    fit : Candidate
    scale : float
        Variance of the weighted misfit at a point, real and imaginary part together.
    robust : bool
        Compute it from the residuals of the individual points. Also valid if the noise is not
        proportional to the weights [3]_: poles that depend on a noisy part of the band are more
        uncertain. The excess of `scale` over the mean square of the residuals, due to their
        correlation, is kept.
    """
    state = data.at(fit)
    J, residual = state.jacobian[0], state.residual[0]
    # With the numerator eliminated, J'J is the Schur complement of the information matrix. A pole
    # far beyond the band makes its pair uncertain by many decades, but not the others: this is
    # preserved in a factor R of the covariance R R', but not in their products.
    size = np.maximum(np.linalg.norm(J, axis=0), _LEAST_INFORMATION * state.sensitivity[0])
    size[size == 0] = 1.0
    _, sv, Vt = np.linalg.svd(J / size, full_matrices=False)
    root = (Vt.T / np.maximum(sv, _LEAST_INFORMATION * (sv[0] or 1.0))) / size[:, None]
    if robust:
        lost = fit.structure.order + fit.structure.zeros + 2
        freedom, power = max(residual.size - lost, 1), float(residual @ residual)
        excess = 0.5 * scale * freedom / power if power > 0 else 1.0
        # White (1980): inv(J'J) J' diag(e^2) J inv(J'J) as a product R R'.
        root = root @ (root.T @ (J * residual[:, None]).T)
        root *= np.sqrt(excess * residual.size / freedom)
    else:
        root *= np.sqrt(0.5 * scale)  # half of the complex variance is in each row of a point
    poles, derivative = poles_from_parameters(fit.parameters[None, 1:])
    error = np.linalg.norm(derivative[0] @ root[1:], axis=1)
    sequence = np.argsort(np.abs(poles[0]), kind="stable")
    return poles[0][sequence], error[sequence]


def modal_state_space(
    data: FRFData, fit: Candidate
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Convert a fit without its dead time to a sum of modes, with balanced input and output.

    Returns
    -------
    A, B, C, D : ndarray, shapes (n, n), (n, 1), (1, n), (1, 1)
    """
    numerator, n = data.at(fit).numerator[0], fit.structure.order
    poles = fit.poles
    residues, gain, _ = partial_fractions(poles[None], np.ones(1), numerator.size)
    step = residues[0] @ numerator
    weight = step * poles
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for i, (p, c) in enumerate(zip(poles, weight, strict=True)):
        part = float(np.sqrt(abs(c)))
        if p.imag == 0:
            A[i, i], B[i, 0], C[0, i] = p.real, part, np.sign(c.real) * part
        elif p.imag > 0:
            # c / (s - p) and its conjugate, which is the next one
            A[i : i + 2, i : i + 2] = [[p.real, p.imag], [-p.imag, p.real]]
            B[i, 0] = part
            C[0, i : i + 2] = 2 * c.real / (part or 1.0), 2 * c.imag / (part or 1.0)
    direct = float(gain[0] * numerator[0] + step.sum().real) if numerator.size > n else 0.0
    return A, B, C, np.array([[direct]])
