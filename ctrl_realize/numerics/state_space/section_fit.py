"""Output-error fit of a model of several channels, from a start that is roughly right.

The misfit is the likelihood of white noise of an unknown size in every output,
``sum_a n_a log(rss_a / n_a) / 2``. The level of every output and the initial state of every
record enter linearly and are eliminated (variable projection); the rest moves by damped
Gauss-Newton steps. The sections leave two directions each in which B and C cancel: the damping
keeps still there.

Prediction errors with one unknown variance for each output [1]_; elimination as in [2]_, steps as
in [3]_.

References
----------
.. [1] T. Soderstrom and P. Stoica, System Identification, Prentice Hall 1989, chapter 7 (Prediction
   error methods).
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [3] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.2 (Numerical solution by iterative search methods).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray
from .sections import Motion, Sections, motion

MOST_STEPS = 40
ENOUGH = 0.01
"""Gain of log likelihood below which a step is the last one: far inside what data can tell."""
_DAMPING = 1e-3
_ROWS = 4096
"""Samples whose derivatives are formed at once."""
LARGEST_POLE = 1 - 1e-7
_EXACT = 1e-12
"""Least residual, as a part of the output: what rounding leaves."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """Inputs `v` (m, T) and outputs `y` (p, T); NaN in y takes a sample out."""

    v: FloatArray
    y: FloatArray


@dataclass(frozen=True, eq=False)
class SectionFit:
    """Fitted `model`; `variance` left of the `spread` (p,) of every output, `counts` samples.

    ``loss`` is minus the log likelihood up to a constant; `steps` the Gauss-Newton steps.
    """

    model: Sections
    variance: FloatArray
    spread: FloatArray
    counts: FloatArray
    loss: float
    steps: int


@dataclass(frozen=True, eq=False)
class _Point:
    """A model, its signals, residuals (zero where nothing was measured), and its misfit."""

    model: Sections
    moved: tuple[Motion, ...]
    left: tuple[FloatArray, ...]
    variance: FloatArray
    loss: float


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
        Its B and D are found anew, its poles are drawn inside the unit circle.
    feedthrough : bool
        Whether D is free, else it is zero.
    enough : float
        Gain of log likelihood below which a step is the last one.
    most : int
        Steps at most.
    """
    known = [np.isfinite(one.y) for one in data]
    counts = np.sum([k.sum(axis=1) for k in known], axis=0).astype(np.float64)
    spread = (
        np.sum(
            [
                np.nansum((one.y - np.nanmean(one.y, axis=1, keepdims=True)) ** 2, axis=1)
                for one in data
            ],
            axis=0,
        )
        / counts
    )
    floor = _EXACT**2 * spread
    model = _inside(start, feedthrough)

    def at(candidate: Sections, weights: FloatArray) -> _Point:
        moved = tuple(motion(candidate, one.v) for one in data)
        left = tuple(
            _residual(candidate, m, one, k, weights)
            for m, one, k in zip(moved, data, known, strict=True)
        )
        squares = np.sum([(r**2).sum(axis=1) for r in left], axis=0)
        variance = np.maximum(squares / counts, floor)
        return _Point(candidate, moved, left, variance, float(counts @ np.log(variance)) / 2)

    here = at(model, 1 / spread)
    mask = model.free(feedthrough=feedthrough, poles=False)
    gram, slope = _normal(here, data, known, 1 / spread, mask)
    here = at(_stepped(model, mask, _damped(gram, slope, 1e-12)), 1 / spread)
    mask, damping, done = model.free(feedthrough=feedthrough), _DAMPING, 0
    while done < most:
        weights = 1 / here.variance
        gram, slope = _normal(here, data, known, weights, mask)
        better = None
        while damping < 1e8:
            candidate = _stepped(here.model, mask, _damped(gram, slope, damping))
            if np.abs(candidate.poles).max(initial=0.0) <= LARGEST_POLE:
                there = at(candidate, weights)
                if there.loss < here.loss:
                    better = there
                    break
            damping *= 5
        if better is None:
            break
        gain = here.loss - better.loss
        here, damping, done = better, max(damping / 5, 1e-10), done + 1
        if gain < enough:
            break
    return SectionFit(here.model, here.variance, spread, counts, here.loss, done)


def _inside(start: Sections, feedthrough: bool) -> Sections:
    """Draw unstable poles radially into the unit circle."""
    a = start.a.copy()
    for row in a:
        largest = float(np.abs(np.roots([1.0, *row])).max())
        if largest > 0.999:
            row *= np.array([1.0, 0.999 / largest]) * 0.999 / largest
    D = start.D if feedthrough else np.zeros_like(start.D)
    return Sections(a, start.B, start.C, D, start.single)


def _stepped(model: Sections, mask: NDArray[np.bool_], step: FloatArray) -> Sections:
    full = np.zeros(mask.size)
    full[mask] = step
    return model.moved(full)


def _damped(gram: FloatArray, slope: FloatArray, damping: float) -> FloatArray:
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    scaled = gram / np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += damping
    return np.asarray(np.linalg.solve(scaled, slope / scale) / scale)


def _linear(model: Sections, moved: Motion, p: int) -> FloatArray:
    """Responses (p, columns, T) to the initial state and the levels."""
    free = moved.starts(model)
    levels = np.broadcast_to(np.eye(p)[:, :, None], (p, p, free.shape[-1]))
    return np.concatenate([free, levels], axis=1)


def _residual(
    model: Sections,
    moved: Motion,
    one: Experiment,
    known: NDArray[np.bool_],
    weights: FloatArray,
) -> FloatArray:
    """What is left of the outputs, with the best initial state and levels."""
    left = np.where(known, one.y - moved.output(model, one.v), 0.0)
    columns = _linear(model, moved, one.y.shape[0]) * known[:, None]
    gram = np.einsum("pit,pjt,p->ij", columns, columns, weights, optimize=True)
    for _ in range(2):  # once more for the digits that the normal equations have lost
        right = np.einsum("pit,pt,p->i", columns, left, weights, optimize=True)
        left = left - np.einsum("pit,i->pt", columns, _least(gram) @ right)
    return np.asarray(left)


def _least(gram: FloatArray) -> FloatArray:
    """Pseudo-inverse of normal equations, after scaling."""
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    inner = np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    return np.asarray(inner / np.outer(scale, scale))


def _normal(
    here: _Point,
    data: Sequence[Experiment],
    known: Sequence[NDArray[np.bool_]],
    weights: FloatArray,
    mask: NDArray[np.bool_],
) -> tuple[FloatArray, FloatArray]:
    """Normal equations of the moving parameters, free of levels and initial states."""
    count = int(mask.sum())
    gram, slope = np.zeros((count, count)), np.zeros(count)
    for one, moved, seen, left in zip(data, here.moved, known, here.left, strict=True):
        p, T = one.y.shape
        linear = _linear(here.model, moved, p)
        sums = np.zeros((count + linear.shape[1] + 1,) * 2)
        for begin in range(0, T, _ROWS):
            part = slice(begin, begin + _ROWS)
            for a in range(p):
                slopes = moved.slopes(here.model, one.v, a, part)[mask]
                rows = np.concatenate([slopes, linear[a, :, part], left[a, None, part]])
                if not seen[a, part].all():
                    rows = rows[:, seen[a, part]]
                sums += weights[a] * (rows @ rows.T)
        own, other = sums[:count, count:-1], sums[count:-1, count:-1]
        inverse = _least(other)
        gram += sums[:count, :count] - own @ inverse @ own.T
        slope += sums[:count, -1] - own @ inverse @ sums[count:-1, -1]
    return gram, slope
