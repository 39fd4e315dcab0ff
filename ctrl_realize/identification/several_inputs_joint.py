"""Parameters of the models of all inputs together, where fits in turn converge slowly.

Steps of which one begins before the response to another is over take a hundred turns. All models
together, with the structures that they have, minimise a sum of squares, then one of Huber's losses
[1]_, by a trust-region method [2]_. A record that begins in operation has a free response of every
model, which the fit of one input does not know of the others.

References
----------
.. [1] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, chapter 7
   (Regression), doi:10.1002/9780470434697.
.. [2] M. A. Branch, T. F. Coleman and Y. Li, A subspace, interior, and conjugate gradient method
   for large-scale bound-constrained minimization problems, SIAM J. Sci. Comput. 21 (1999) 1-23,
   doi:10.1137/S1064827595289108.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import orth
from scipy.optimize import least_squares

from ..data import Record
from ..numerics.arrays import FloatArray
from ..numerics.constants import HUBER, SMALLEST, STRONG
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.output_error.any_input.data import BEYOND
from ..numerics.output_error.step_data import own_regressors
from ..numerics.signals.noise import mad_sigma
from .bound import Bound, operating_terms
from .output_error.result import OutputErrorFit

_MOST_STEPS = 50  # the next turn begins where it ends
_STEP = 1e-4  # of these logarithms, for derivatives
_REACH = 5.0  # logarithm of the factor by which a time constant or a damping may change


def from_rest(fit: OutputErrorFit) -> bool:
    """Whether a fit has no free response to what was before its record."""
    return not fit.data.relaxing


def prescribed(fit: OutputErrorFit) -> bool:
    """Whether parameters are fixed, or at a bound."""
    process = fit.estimate.process
    return bool(process.at_bound) or (process.form is not None and bool(process.form.fixed))


def bounds_of(fits: Sequence[OutputErrorFit]) -> list[Bound]:
    """Models of fits, with their derivatives."""
    return [
        Bound(PlausibleModel(fit.dead_time, fit.poles, fit.estimate.numerator), fit.data.dt)
        for fit in fits
    ]


def fitted_together(
    fits: Sequence[OutputErrorFit], record: Record, rested: bool
) -> tuple[FloatArray, FloatArray]:
    """Responses (m, N) to all inputs, and the free responses (N,), level and drift beside them.

    The latter are zero from rest, and NaN where inputs before the record may act. A record that
    `rested` before its first move is fitted from rest if that has strong evidence by BIC over drift
    and free responses: fits in turn may have been made without these.
    """
    steps = all(np.isfinite(fit.onset) and from_rest(fit) for fit in fits)
    found = _together(fits, record, at_rest=steps)
    if steps or not rested:
        return found
    seen = ~np.isnan(found[1])
    size = np.count_nonzero(seen)
    ways = _together(fits, record, at_rest=True), found
    rest, free = (np.var((np.ravel(record.output) - r.sum(axis=0) - e)[seen]) for r, e in ways)
    terms = 1 + sum(np.count_nonzero(fit.poles) for fit in fits)
    return ways[0] if size * np.log(rest / free) + STRONG < terms * np.log(size) else found


def _together(
    fits: Sequence[OutputErrorFit], record: Record, at_rest: bool
) -> tuple[FloatArray, FloatArray]:
    inputs, output = np.atleast_2d(record.input), np.ravel(record.output)
    seen, clock = ~np.isnan(output), record.time - record.time[0]
    starts = bounds_of(fits)
    if not at_rest:  # what inputs before the record do may arrive as late as this
        seen &= clock >= min(BEYOND * max(fit.dead_time for fit in fits), clock[-1] / 2)
    own = orth(np.hstack([own_columns(fit, clock[seen], at_rest) for fit in fits]))
    ends = np.cumsum([start.point.size for start in starts])

    def models(x: FloatArray) -> list[Bound]:
        parts = np.split(x, ends)[:-1]  # the last one is of the columns
        return [start.at(part) for start, part in zip(starts, parts, strict=True)]

    def columns(x: FloatArray) -> FloatArray:
        if at_rest:
            return own
        every = [operating_terms(clock[seen], model.model.poles) for model in models(x)]
        return np.hstack([every[0], *(one[:, 2:] for one in every[1:])])  # one level, one drift

    def responses(x: FloatArray) -> FloatArray:
        return np.array([one.response(u) for one, u in zip(models(x), inputs, strict=True)])

    def left(x: FloatArray) -> FloatArray:
        return np.asarray((output - responses(x).sum(axis=0))[seen] - columns(x) @ x[ends[-1] :])

    def slopes(x: FloatArray) -> FloatArray:
        every = zip(models(x), inputs, strict=True)
        found = np.hstack([*(model.slopes(u)[0][seen] for model, u in every), columns(x)])
        for j in np.flatnonzero(np.isfinite(most)) if not at_rest else ():
            move = _STEP * (np.arange(x.size) == j)
            bent = columns(x + move) - columns(x - move)
            found[:, j] += bent @ x[ends[-1] :] / (2 * _STEP)
        return -found

    x = np.concatenate([start.point for start in starts])
    beside, rest = columns(x), (output - responses(x).sum(axis=0))[seen]
    x = np.concatenate([x, np.linalg.lstsq(beside, rest, rcond=None)[0]])
    least, most = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    moves = np.ones(x.size, dtype=np.bool_)
    for fit, start, end in zip(fits, starts, ends, strict=True):
        first, form = end - start.point.size, fit.estimate.process.form
        least[first], moves[first] = 0.0, form is None or form.dead_time
        poles = slice(first + 1, end - start.model.numerator.size)
        least[poles], most[poles] = x[poles] - _REACH, x[poles] + _REACH

    def among(moving: FloatArray) -> FloatArray:
        every = x.copy()
        every[moves] = moving
        return every

    def residual(moving: FloatArray) -> FloatArray:
        return left(among(moving))

    def jacobian(moving: FloatArray) -> FloatArray:
        return slopes(among(moving))[:, moves]

    for loss in ("linear", "huber"):
        found = least_squares(
            residual, x[moves], jacobian, bounds=(least[moves], most[moves]), x_scale="jac",
            gtol=None, loss=loss, f_scale=max(HUBER * mad_sigma(left(x)), SMALLEST),
            max_nfev=_MOST_STEPS,
        )  # fmt: skip
        x = among(found.x)
    earlier = np.where(seen, 0.0, np.nan)
    if not at_rest:
        earlier[seen] = columns(x) @ x[ends[-1] :]
    return responses(x), earlier


def own_columns(fit: OutputErrorFit, clock: FloatArray, at_rest: bool) -> FloatArray:
    """Columns (N, q) of level, drift and what else is estimated beside a model."""
    if at_rest and not np.isfinite(fit.onset):
        return np.ones((clock.size, 1))
    # A fit may have left out the first samples, or spikes.
    if at_rest and fit.data.rows.size == clock.size:
        return own_regressors(fit.data, fit.poles)
    return operating_terms(clock, fit.poles)
