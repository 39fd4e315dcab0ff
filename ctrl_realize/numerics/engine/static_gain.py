"""Accuracy of the gain and the total delay of a fitted model.

Errors by the delta method [1]_, mixtures of structures as in [2]_.

References
----------
.. [1] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., Springer 1998, section 1.8
   (the delta method), doi:10.1007/b98854.
.. [2] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, section 4.3, doi:10.1007/b97636.
.. [3] C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters, Proc.
   Cambridge Philos. Soc. 44 (1948) 50-57, doi:10.1017/S0305004100023987.
.. [4] E. C. Fieller, Some problems in interval estimation, J. R. Stat. Soc. B 16 (1954) 175-185,
   doi:10.1111/j.2517-6161.1954.tb00159.x.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr, ndtri

from ..arrays import BoolArray, ComplexArray, FloatArray, unit_columns
from ..constants import PIECE, SMALLEST, Z_95
from .eliminate import eliminate, evaluate
from .local_terms import LocalTerms
from .modal import lag_sum, partial_fractions, poles_from_parameters, responses
from .problem import Family, Problem
from .structures import Candidate

INTEGRATOR = 5e-3
"""Poles slower than this, times the length of the record, cannot be distinguished from integrators:
over the record they bend by an eighth of that, 0.06 % of the excursion."""

NEARLY_STRAIGHT = 0.1
"""The same of lags that may be integrators: they bend by 1.2 % of the excursion. Of 16 loops
about an integrator nine had a lag of 4 to 137 records in its place, with a gain of any size."""

SIGNIFICANT = Z_95  # standard errors: a gain of less may as well be none, or have the other sign

_STEP = 1e-4  # of logarithms, and part of a numerator: for slopes by differences
_CLEAR = 0.01  # relative distance of poles, twice that below which they are set apart
_ROUNDED = 1e-7  # part of a derivative that differences leave of nothing
_HALVINGS = 60  # of an interval, until a double has no more digits
_NOTHING = 1e-13  # part of the largest singular value that is rounding
_INDEPENDENT = 1e-10  # part of it, from which on columns count as several
_OTHERS = 1e-3  # part of a column that the other terms leave: less is theirs


@dataclass(frozen=True, eq=False)
class StaticGain:
    """Static response, with standard errors (delta method, structure given).

    `gain` is that at zero frequency (the slope per second of a model with an integrator) and
    `total` dead time and lags less leads, in s. `slowest` is the length of the record in units of
    the slowest time constant that is no integrator's; `integrates`: there is one. `reached` is the
    response to a unit step at the end of the record, with its relative standard error
    `reached_std`; `share_std` is that of the part of the gain that this is.
    """

    gain: float
    gain_std: float
    total: float
    total_std: float
    slowest: float
    integrates: bool
    reached: float
    reached_std: float
    share_std: float

    @property
    def significant(self) -> bool:
        """Whether the gain is significant, and has the sign of the observed response.

        Several slow poles are integrators where they bend no more than one that is taken for one.
        """
        seen = np.inf if self.integrates else abs(self.reached)
        known = SIGNIFICANT * self.gain_std < abs(self.gain) < seen / INTEGRATOR
        return known and self.reached * self.gain > 0

    @property
    def resolved(self) -> bool:
        """Whether a pole as slow as the record, or an integrator, has a significant gain."""
        return self.significant or not (self.slowest < 1.0 or self.integrates)

    @property
    def sign_known(self) -> bool:
        """Whether the response at the end is significant, and has the sign of a gain."""
        seen = SIGNIFICANT * self.reached_std < 1 and self.reached * self.gain > 0
        return seen and not self.integrates

    @property
    def ends(self) -> tuple[float, float]:
        """95 % interval of the gain if it is not resolved: what was reached, and more."""
        if not self.sign_known:
            return -np.inf, np.inf
        seen = min(abs(self.reached), abs(self.gain))
        return (seen, np.inf) if self.gain > 0 else (-np.inf, -seen)

    def widened(self, gain: float, total: float) -> StaticGain:
        """With factors on the errors of gain and total delay."""
        return replace(
            self,
            gain_std=gain * self.gain_std,
            reached_std=gain * self.reached_std,
            share_std=gain * self.share_std,
            total_std=total * self.total_std,
        )

    def below(self, value: float, rounding: float) -> float:
        """Probability that the gain is below a value; `rounding` is a further standard error.

        The gain is the ratio of the response at the end of the record and the part of the gain that
        this is. Of a response that has not settled the part may be nothing, and the gain without
        end: Fieller's theorem [4]_. It is a normal distribution where the sign is open.
        """
        off = (value - self.gain) / max(abs(self.gain), SMALLEST)
        if not self.sign_known:
            std = np.hypot(self.gain_std, rounding) / max(abs(self.gain), SMALLEST)
            return float(ndtr(off / max(std, _NOTHING)))
        off *= np.sign(self.gain)
        if off < -1:  # of the other sign
            return float(self.gain < 0)
        # The logarithm of the response is the sum of those of its part and of the gain.
        std = self.gain_std / abs(self.gain)
        both = (self.reached_std**2 - self.share_std**2 - std**2) / 2
        square = std**2 - 2 * off * both + (off * self.share_std) ** 2 + (rounding / self.gain) ** 2
        return float(ndtr(np.sign(self.gain) * off / np.sqrt(max(square, _NOTHING**2))))


def static_gain(
    problem: Problem,
    candidate: Candidate,
    variance: float,
    length: float,
    rounding: Callable[[FloatArray], FloatArray] | None = None,
) -> StaticGain:
    """Propagate the errors of dead time, poles and numerator to gain and total delay.

    Parameters
    ----------
    problem : Problem
    candidate : Candidate
    variance : float
        Of the noise, per sample.
    length : float
        Duration of the record after the change of the input, in s.
    rounding : callable, optional
        Variances (k,) from the rounding of an output, of sums of the data with weights (k, m).
    """
    theta = candidate.theta
    numerator = eliminate(problem, candidate.structure, candidate.parameters[None]).numerator[0]
    point = np.concatenate([theta, numerator])
    there = np.concatenate([_clear(candidate), numerator])
    moves = parameter_steps(candidate, numerator, length)

    # Poles that are nearly equal would jump apart in one difference, and not in the other.
    def steady_values(at: FloatArray, apart: bool = False) -> FloatArray:
        """Gain, total delay, and the response at the end of the record."""
        poles = poles_from_parameters(at[None, 1 : theta.size], apart=apart)[0][0]
        powers, moving = at[theta.size :], poles[np.abs(poles) * length >= INTEGRATOR]
        gain = (powers[0] / np.prod(-moving)).real
        distinct = poles_from_parameters(at[None, 1 : theta.size])[0][0]
        reached = reached_after(distinct, powers, max(length - at[0], 0.0))
        return np.array([gain, at[0] + lag_sum(moving, powers), reached])

    gradient = np.stack(
        [(steady_values(there + m) - steady_values(there - m)) / (2 * m.sum()) for m in moves],
        axis=1,
    )
    errors = local_errors(problem, candidate, numerator, length)
    free = not isinstance(candidate.structure, Family)
    if free and np.any(np.abs(candidate.poles) * length < INTEGRATOR):
        turned = _by_single_poles(there, theta.size)
        errors = replace(errors, slopes=errors.slopes @ turned, tangent=turned)
    value = steady_values(there)
    logs = gradient / np.where(value == 0, 1.0, value)[:, None]
    gain_std = errors.std(gradient[:2], variance)[0]
    rounded = np.zeros(2)
    if rounding is not None:
        rounded = np.sqrt(rounding(errors.influence(gradient[:2]) * problem.root_weight))
    share_std, reached_std = errors.std(np.stack([logs[2] - logs[0], logs[2]]), variance)
    if free and theta.size > 1:
        # A lag that no sample shows has a slope of nothing, but is one of those between a sample
        # and the record: the standard deviation of a uniform distribution of its logarithm.
        count = errors.slopes.shape[1] + errors.own.shape[1]
        known = np.eye(count)[1 : theta.size] * np.sqrt(12 * variance) / np.log(problem.data.size)
        slopes, own = np.split(known, [errors.slopes.shape[1]], axis=1)
        errors = LocalErrors(np.vstack([errors.slopes, slopes]), np.vstack([errors.own, own]))
    total_std = np.hypot(errors.std(gradient[:2], variance)[1], rounded[1])
    gain, total, reached = (float(value) for value in steady_values(point, apart=True))
    slow = np.abs(candidate.poles)
    # An integrator has no slowest time constant, but a constant slope.
    slow = slow[slow * length >= INTEGRATOR]
    return StaticGain(
        gain=gain,
        gain_std=float(np.hypot(gain_std, rounded[0])),
        total=total,
        total_std=float(total_std),
        slowest=float(slow.min(initial=np.inf)) * length,
        integrates=slow.size < candidate.poles.size,
        reached=reached,
        reached_std=float(reached_std),
        share_std=float(share_std),
    )


@dataclass(frozen=True, eq=False)
class LocalErrors:
    """Curvature of the sum of squares about a model: errors of its parameters.

    `slopes` (m, p) are the weighted derivatives of the model with respect to dead time, pole
    parameters and numerator, `own` (m, q) the columns of the terms that are estimated with it.
    Along the `tangent` (p, j) of a family these may change; the slopes (m, j) are then along it.
    What is `local` to segments has been projected out of both.
    """

    slopes: FloatArray
    own: FloatArray
    tangent: FloatArray | None = None
    local: LocalTerms | None = None

    def lowered(self, data: FloatArray, columns: FloatArray) -> FloatArray:
        """Decrease (k,) of the sum of squares by each of further weighted columns (m, k).

        Rao's score test [3]_: linear in all that is estimated. What the other terms leave of a
        column counts as a thousandth of it at least.
        """
        least = _OTHERS**2 * np.einsum("mk,mk->k", columns, columns) + SMALLEST
        left = self.without(columns)
        square = np.maximum(np.einsum("mk,mk->k", left, left), least)
        return np.asarray((data @ left) ** 2 / square)

    def without(self, columns: FloatArray) -> FloatArray:
        """What all that is estimated leaves of weighted columns (m, k)."""
        if self.local is not None:
            columns = self.local.without(columns[None])[0]
        return np.asarray(columns - self._basis @ (self._basis.T @ columns))

    @property
    def columns(self) -> FloatArray:
        """All that is estimated (m, p + q), every column of unit size."""
        return unit_columns(np.concatenate([self.slopes, self.own], axis=1))[0]

    @cached_property
    def _basis(self) -> FloatArray:
        basis, singular, _ = np.linalg.svd(self.columns, full_matrices=False)
        return np.asarray(basis[:, singular > _INDEPENDENT * singular[0]])

    def covariance(self) -> FloatArray:
        """Covariance (p, p) of dead time, pole parameters, numerator, for noise of variance 1."""
        root, _ = self._root(np.ones(self.slopes.shape[1], dtype=np.bool_))
        if self.tangent is not None:
            root = root @ self.tangent.T
        return np.asarray(root.T @ root)

    def std(self, gradient: FloatArray, variance: float) -> FloatArray:
        """Standard errors (k,) of functions with these gradients (k, p), by the delta method.

        Parameters that none of them depends on, like the slowness of a pole that is taken for an
        integrator, are no unknowns.
        """
        if self.tangent is not None:
            size = np.abs(gradient) @ np.abs(self.tangent)
            gradient = gradient @ self.tangent
            gradient[np.abs(gradient) < _ROUNDED * size] = 0.0
        seen = np.any(gradient != 0, axis=0)
        along = self._root(seen)[0] @ gradient[:, seen].T
        return np.asarray(np.sqrt(variance * np.sum(along**2, axis=0)))

    def influence(self, gradient: FloatArray) -> FloatArray:
        """Change (k, m) of functions with these gradients (k, p) with each of the weighted data."""
        if self.tangent is not None:
            gradient = gradient @ self.tangent
        root, basis = self._root(np.ones(self.slopes.shape[1], dtype=np.bool_))
        return np.asarray((basis @ (root @ gradient.T)).T)

    def _root(self, seen: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Root R (r, s) of the covariance ``R^T R`` of some of the slopes' parameters.

        With the directions (m, r) in the data that its rows stand for.
        """
        columns, size = unit_columns(np.concatenate([self.slopes[:, seen], self.own], axis=1))
        basis, singular, turned = np.linalg.svd(columns, full_matrices=False)
        singular = np.maximum(singular, max(_NOTHING * singular.max(initial=0.0), SMALLEST))
        count = int(seen.sum())
        return np.asarray((turned / singular[:, None])[:, :count] / size[:count]), basis


def local_errors(
    problem: Problem, candidate: Candidate, numerator: FloatArray, length: float
) -> LocalErrors:
    """Derivatives of a model with respect to its parameters, by differences.

    Those of a family are its own.
    """
    if isinstance(candidate.structure, Family):
        slopes, tangent = candidate.structure.directions(problem, candidate.parameters)
        along = tangent.any(axis=0)
        return LocalErrors(slopes[:, along], slopes[:, ~along], tangent[:, along])
    theta = _clear(candidate)
    moves = parameter_steps(candidate, numerator, length)
    # A dead time is not negative: the derivatives at zero are those slightly later.
    inside = np.concatenate([[max(theta[0], moves[0, 0])], theta[1:], numerator])
    there = np.concatenate([inside + moves, inside - moves])
    # Models of long records one by one, which bounds the memory.
    parts = np.array_split(there, min(len(there), 1 + len(there) * problem.data.size // PIECE))
    setting = problem.drive, problem.known
    every = [responses(*setting, x[:, theta.size :], x[:, : theta.size]) for x in parts]
    ahead, behind = np.split(np.concatenate(every), 2)
    slopes = (ahead - behind).T / (2 * moves.diagonal())
    columns, local = problem.weighted(np.concatenate([slopes, problem.regressors], axis=1)), None
    if problem.segments is not None:
        # The free response that the records are fitted with moves with the poles as well.
        poles, turned = poles_from_parameters(theta[None, 1:])
        local = problem.local_terms(poles)
        model = responses(*setting, numerator[None], theta[None])[0]
        weights = evaluate(problem, candidate.structure, candidate.parameters[None]).regression[0]
        model += problem.regressors @ weights
        left = problem.weighted_data - problem.weighted(model[:, None])[:, 0]
        columns[:, 1 : theta.size] += local.moved(left[None], turned)[0]
        columns = local.without(columns[None])[0]
    count = moves.shape[0]
    return LocalErrors(columns[:, :count], columns[:, count:], local=local)


def _by_single_poles(point: FloatArray, count: int) -> FloatArray:
    """Derivatives (p, p) of parameters (p,) by the logarithms of the real poles of pairs.

    Of `count` parameters for dead time and poles; the rest is the numerator. That a pole which is
    taken for an integrator moves alone is no unknown then. Between frequency and damping of its
    pair it was one that rounding alone told: with a pole at its bound, the standard error of the
    slope was 0.030 or 0.033 by the processor, and is 0.003.
    """
    found = np.eye(point.size)
    for i in range(2 - count % 2, count, 2):
        damping = float(np.exp(point[i + 1]))
        if damping > 1:
            more = np.sqrt(1 - damping**-2) / 2
            found[i : i + 2, i : i + 2] = [[0.5, 0.5], [more, -more]]
    return found


def _clear(candidate: Candidate) -> FloatArray:
    """Dead time and pole parameters, with factors so far apart that no step jumps.

    `poles_from_parameters` sets poles that coincide apart: a difference over its limit is no slope.
    """
    theta = np.array(candidate.theta)
    if isinstance(candidate.structure, Family):
        return theta
    order = theta.size - 1
    for head in range(2 - order % 2, order, 2):
        while True:
            poles = poles_from_parameters(theta[None, 1:], apart=False)[0][0]
            own, others = poles[head : head + 2, None], poles[:head]
            if not (np.abs(own - others) < _CLEAR * np.abs(own)).any():
                break
            theta[1 + head] += _CLEAR
    return theta


def parameter_steps(candidate: Candidate, numerator: FloatArray, length: float) -> FloatArray:
    """Steps of the parameters for derivatives by differences, on the diagonal of a matrix."""
    # Coefficients have the units of powers of a time, here the longest lag. A response of nothing
    # has a numerator of zeros, from which any step is as good.
    slowest = max(float(np.abs(candidate.poles).min(initial=np.inf)), 1 / length)
    times = slowest ** -np.arange(float(numerator.size))
    largest = float(np.abs(numerator / times).max()) or 1.0
    steps = np.concatenate(
        [
            [_STEP * min(1 / float(np.abs(candidate.poles).max(initial=1 / length)), length)],
            np.full(candidate.theta.size - 1, _STEP),
            _STEP * np.maximum(np.abs(numerator), _STEP * largest * times),
        ]
    )
    return np.diag(steps)


def gain_ends(parts: Sequence[tuple[StaticGain, float]], rounding: float) -> tuple[float, float]:
    """95 % interval of the gain from several structures, each with its evidence.

    As `averaged_ends`, but for `StaticGain.below`; `rounding` is a further standard error.
    """
    reach = max(abs(one.gain) + one.gain_std for one, _ in parts) / INTEGRATOR
    total = sum(weight for _, weight in parts)

    def below(value: float) -> float:
        return sum(weight * one.below(value, rounding) for one, weight in parts) / total

    low = _where(below, 0.025, -reach, reach) if below(-reach) < 0.025 else -np.inf
    high = _where(below, 0.975, -reach, reach) if below(reach) > 0.975 else np.inf
    return low, high


def averaged_ends(parts: Sequence[tuple[float, float, float]]) -> tuple[float, float]:
    """95 % interval from several structures: (estimate, standard error, evidence) each.

    Middle of the mixture of their normal distributions (model averaging: Burnham and Anderson,
    Model Selection and Multimodel Inference, 2nd ed., 2002, section 4.3): a structure with a
    superfluous zero, which leaves the gain undetermined, is weighted by its evidence.

    Examples
    --------
    >>> low, high = averaged_ends([(1.0, 0.1, 1.0)])
    >>> print(round(low, 3), round(high, 3))
    0.804 1.196
    """
    means, errors, weights = np.array(parts, dtype=np.float64).T
    mixture = means, np.maximum(errors, 1e-12 * np.abs(means) + 1e-300), weights
    return mixture_quantile(0.025, *mixture), mixture_quantile(0.975, *mixture)


def mixture_quantile(
    level: float, centres: FloatArray, spreads: FloatArray, shares: FloatArray
) -> float:
    """Return a quantile of a mixture of normal distributions.

    Parameters
    ----------
    level : float
        In 0...1, ends excluded.
    centres, spreads, shares : ndarray, shape (K,)
        Means, standard deviations and weights (of any sum).

    Examples
    --------
    >>> import numpy as np
    >>> print(f"{mixture_quantile(0.975, np.zeros(2), np.ones(2), np.ones(2)):.4f}")
    1.9600
    """
    weights = shares / shares.sum()
    # The quantiles of the components bracket that of the mixture.
    parts = centres + spreads * ndtri(level)

    def below(value: float) -> float:
        return float(weights @ ndtr((value - centres) / spreads))

    return _where(below, level, float(parts.min()), float(parts.max()))


def _where(below: Callable[[float], float], level: float, low: float, high: float) -> float:
    """Value between two at which a probability is reached."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) < level else (low, middle)
    return 0.5 * (low + high)


def reached_after(poles: ComplexArray, numerator: FloatArray, length: float) -> float:
    """Value of the step response of b(s)/a(s) after a time."""
    residues, level, _ = partial_fractions(poles[None], np.ones(1), numerator.size)
    modes = np.exp(poles * length) @ residues[0]
    return float(modes.real @ numerator + level[0] * numerator[0])
