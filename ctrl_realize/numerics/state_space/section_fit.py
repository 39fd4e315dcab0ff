"""Output-error fit of a model with several channels, from an approximate initial model.

The misfit is the likelihood of white noise of unknown variance in every output, ``sum_a n_a
log(rss_a / n_a) / 2``. Level and drift of every output and the initial state of every record enter
linearly and are eliminated (variable projection); the other parameters are optimised by damped
Gauss-Newton steps. Each section has two directions in which B and C cancel; the damping prevents
steps along them.

Prediction errors with one unknown variance for each output [1]_; elimination as in [2]_, steps as
in [3]_, with the damping of [5]_.

References
----------
.. [1] T. Soderstrom and P. Stoica, System Identification, Prentice Hall 1989, chapter 7 (Prediction
   error methods).
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [3] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.2 (Numerical solution by iterative search methods).
.. [4] D. P. Bertsekas, Projected Newton methods for optimization problems with simple constraints,
   SIAM J. Control Optim. 20 (1982) 221-246, doi:10.1137/0320018.
.. [5] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray
from .sections import Motion, Sections, motion

MOST_STEPS = 40  # at most
ENOUGH = 0.01
"""Increase of log likelihood below which the iteration ends: insignificant for any data."""
_DAMPING, _LEAST_DAMPING, _FACTOR = 1e-3, 1e-12, 5.0
"""Of the first step, the least, and by what it changes from step to step."""
_TRIES = 16  # shorter steps at most, before a fit ends
_ROWS = 4096
"""Number of samples whose derivatives are computed together."""
LARGEST_POLE = 1 - 1e-7  # slower than any record shows: 1e7 samples to decay to 37 %
_AT_EDGE = 1e-9  # distance from it at which a pole is held there
_FROM_OUTSIDE = 0.999  # where a pole of a start that is unstable begins
_DEPENDENT = 1e-10
"""Part of the largest singular value of responses below which one of them is a sum of others."""
_ROUNDING = 1e-13  # relative
_EXACT = 1e-12
"""Least residual, as a part of the output: what rounding leaves."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """Inputs `v` (m, T) and outputs `y` (p, T), which may drift; NaN in y is a missing sample."""

    v: FloatArray
    y: FloatArray
    drift: bool = False

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Samples (p, T) that are not missing."""
        return np.isfinite(self.y)


@dataclass(frozen=True, eq=False)
class SectionFit:
    """Fitted `model` with its residuals.

    `variance` and `spread` (p,) are the variances of the residuals and of the outputs,
    `counts` the numbers of samples. ``loss`` is minus the log likelihood up to a constant;
    `steps` is the number of Gauss-Newton steps, `drifts` (p,) are changes over each experiment.
    """

    model: Sections
    variance: FloatArray
    spread: FloatArray
    counts: FloatArray
    loss: float
    steps: int
    drifts: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class _Point:
    """A model with its signals for zero initial state, residuals and misfit.

    The residuals of missing samples are zero.

    `initial` (2 q,) are the initial states of the experiments, `drifts` (p,) their drifts.
    """

    model: Sections
    moved: tuple[Motion, ...]
    left: tuple[FloatArray, ...]
    initial: tuple[FloatArray, ...]
    drifts: tuple[FloatArray, ...]
    variance: FloatArray
    cost: float


def fit_sections(
    data: Sequence[Experiment],
    start: Sections,
    *,
    feedthrough: bool,
    enough: float = ENOUGH,
    most: int = MOST_STEPS,
) -> SectionFit:
    """Fit all parameters of a model to experiments.

    Parameters
    ----------
    data : sequence of Experiment
    start : Sections
        Its B and D are estimated again, its poles are moved inside the unit circle.
    feedthrough : bool
        Whether D is free; otherwise it is zero.
    enough : float
        Increase of log likelihood below which the iteration ends.
    most : int
        Largest number of steps.
    """
    counts = np.sum([one.known.sum(axis=1) for one in data], axis=0).astype(np.float64)
    moves = [one.y - np.nanmean(one.y, axis=1, keepdims=True) for one in data]
    spread = np.sum([np.nansum(move**2, axis=1) for move in moves], axis=0) / counts
    floor = _EXACT**2 * spread
    model = _inside(start, _FROM_OUTSIDE)
    model = model if feedthrough else replace(model, D=np.zeros_like(model.D))

    def at(candidate: Sections, weights: FloatArray) -> _Point:
        moved = tuple(motion(candidate, one.v) for one in data)
        solved = [_residual(candidate, m, one, weights) for m, one in zip(moved, data, strict=True)]
        left, initial, drifts = (tuple(parts) for parts in zip(*solved, strict=True))
        squares = np.sum([(r**2).sum(axis=1) for r in left], axis=0)
        variance = np.maximum(squares / counts, floor)
        cost = float(counts @ np.log(variance)) / 2
        return _Point(candidate, moved, left, initial, drifts, variance, cost)

    here = at(model, 1 / spread)
    mask = model.free(feedthrough=feedthrough, poles=False)
    gram, slope = _normal(here, data, 1 / spread, mask)
    there = at(_stepped(model, mask, _damped_step(gram, slope, _LEAST_DAMPING)), 1 / spread)
    if there.cost < here.cost:
        here = there
    free = model.free(feedthrough=feedthrough)

    damping, done = _DAMPING, 0
    while done < most:
        weights = 1 / here.variance
        gram, slope = _held(here.model, *_normal(here, data, weights, free), free)
        for _ in range(_TRIES):
            candidate = _stepped(here.model, free, _damped_step(gram, slope, damping))
            there = at(_inside(candidate, LARGEST_POLE), weights)
            if there.cost < here.cost:
                break
            damping *= _FACTOR
        else:
            break
        gain, here, done = here.cost - there.cost, there, done + 1
        damping = max(damping / _FACTOR, _LEAST_DAMPING)
        if gain < enough:
            break
    return SectionFit(here.model, here.variance, spread, counts, here.cost, done, here.drifts)


def _damped_step(gram: FloatArray, slope: FloatArray, damping: float) -> FloatArray:
    """Solve (J'J + damping diag(J'J)) step = slope, with columns of one size; shape (n,).

    A direction that nothing depends on is not moved.
    """
    size = np.sqrt(np.diag(gram))
    size = np.where(size > 0, size, 1.0)
    scaled = gram / np.outer(size, size)
    scaled[np.diag_indices_from(scaled)] += damping
    return np.asarray(np.linalg.solve(scaled, slope / size) / size)


def _inside(model: Sections, to: float) -> Sections:
    """Move poles beyond the largest one radially inside."""
    if np.abs(model.poles).max(initial=0.0) <= LARGEST_POLE:
        return model
    a = model.a.copy()
    for row in a:
        largest = float(np.abs(np.roots([1.0, *row])).max())
        if largest > LARGEST_POLE:
            row *= np.array([1.0, to / largest]) * to / largest
    return replace(model, a=a)


def _held(
    model: Sections, gram: FloatArray, slope: FloatArray, mask: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Remove the directions in which poles at the stability boundary would cross it [4]_."""
    place = np.cumsum(mask) - 1
    for i, (a1, a2) in enumerate(model.a):
        single = model.single and i == len(model.a) - 1
        poles = np.array([-a1]) if single else np.roots([1.0, a1, a2])
        for pole in poles[np.abs(poles) > LARGEST_POLE - _AT_EDGE]:
            # Derivative of the pole's modulus: for a pair w.r.t. a2, for a real pole from the
            # derivative of the polynomial.
            outward = np.zeros(slope.size)
            if single:
                outward[place[2 * i]] = -np.sign(pole.real)
            elif pole.imag:
                outward[place[2 * i + 1]] = 1.0
            else:
                outward[place[[2 * i, 2 * i + 1]]] = -pole.real, -1.0
            outward /= np.linalg.norm(outward)
            if outward @ slope > 0:
                slope = slope - outward * (outward @ slope)
                # Zero denominators are avoided for rounding errors.
                bend = outward @ gram @ outward
                gram = gram - np.outer(outward, outward @ gram)
                gram = gram + np.outer(bend * outward - gram @ outward, outward)
    return gram, slope


def _stepped(model: Sections, mask: NDArray[np.bool_], step: FloatArray) -> Sections:
    full = np.zeros(mask.size)
    full[mask] = step
    return model.moved(full)


def _linear(model: Sections, moved: Motion, one: Experiment) -> FloatArray:
    """Responses (p, columns, T) to the initial state; levels, and drifts by 1 of all outputs."""
    p, T = one.y.shape
    shapes = np.stack([np.ones(T), np.linspace(-0.5, 0.5, T)][: 1 + one.drift])
    own = np.eye(p)[:, None, :, None] * shapes[:, None]
    return np.concatenate([moved.starts(model), own.reshape(p, -1, T)], axis=1)


def _basis(
    model: Sections, moved: Motion, one: Experiment, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Orthonormal columns (p T, k) that span the weighted responses of `_linear`.

    And (columns, k), by which their coefficients become those of `_linear`. Normal equations
    would square the condition number: for slow poles, whose responses are similar, the minimum
    would not be found accurately.
    """
    columns = _linear(model, moved, one) * one.known[:, None]
    columns *= np.sqrt(weights)[:, None, None]
    wide = np.swapaxes(columns, 1, 2).reshape(-1, columns.shape[1])
    size = np.sqrt(np.einsum("tk,tk->k", wide, wide))
    size = np.where(size > 0, size, 1.0)
    q, r = np.linalg.qr(wide / size)
    left, values, right = np.linalg.svd(r)
    kept = values > _DEPENDENT * values[0]
    back = right[kept].T / values[kept] / size[:, None]
    return np.asarray(q @ left[:, kept]), np.asarray(back)


def _residual(
    model: Sections, moved: Motion, one: Experiment, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residual of the outputs with the best initial state, levels and drifts.

    And that state (2 q,), and the changes (p,) by the drifts.
    """
    root = np.sqrt(weights)[:, None]
    rest = (np.where(one.known, one.y - moved.output(model, one.v), 0.0) * root).ravel()
    basis, back = _basis(model, moved, one, weights)
    parts = rest @ basis
    left = rest - basis @ parts
    left -= basis @ (left @ basis)  # repeated, for the digits lost the first time
    terms, p = back @ parts, len(one.y)
    drifts = terms[model.a.size + p :] if one.drift else np.zeros(p)
    return np.asarray(left.reshape(one.y.shape) / root), terms[: model.a.size], drifts


def _normal(
    here: _Point, data: Sequence[Experiment], weights: FloatArray, mask: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Normal equations of the remaining parameters, after elimination of levels and states."""
    count = int(mask.sum())
    gram, slope, size = np.zeros((count, count)), np.zeros(count), np.zeros(count)
    for one, rest, left, initial in zip(data, here.moved, here.left, here.initial, strict=True):
        moved = rest.started(here.model, initial)
        p, T = one.y.shape
        linear = _basis(here.model, moved, one, weights)[0].reshape(p, T, -1)
        sums = np.zeros((count + linear.shape[2] + 1,) * 2)
        for begin in range(0, T, _ROWS):
            part = slice(begin, begin + _ROWS)
            for a in range(p):
                root = np.sqrt(weights[a])
                slopes = root * moved.slopes(here.model, one.v, a, part)[mask]
                rows = np.concatenate([slopes, linear[a, part].T, root * left[a, None, part]])
                if not one.known[a, part].all():
                    rows = rows[:, one.known[a, part]]
                sums += rows @ rows.T
        own, other = sums[:count, count:-1], sums[count:-1, -1]
        gram += sums[:count, :count] - own @ own.T
        size += np.diag(sums)[:count]
        slope += sums[:count, -1] - own @ other
    # A column explained by levels and initial states leaves rounding errors of either sign.
    np.fill_diagonal(gram, np.maximum(np.diag(gram), _ROUNDING * size))
    return gram, slope
