"""Tests on what the past does not predict: does the input follow the output, is the plant linear?

The output is predicted from its own past and that of the input by one long regression, with no
model of the plant in between. So the tests stay right where the model that was fitted is wrong:
closed-loop records are often fitted by the controller turned round, which leaves no residual.

References
----------
.. [1] C. A. Sims, Money, income, and causality, Amer. Econ. Rev. 62 (1972) 540-552.
.. [2] L. D. Haugh, Checking the independence of two covariance-stationary time series, J. Amer.
   Statist. Assoc. 71 (1976) 378-385, doi:10.1080/01621459.1976.10480353.
.. [3] C. W. J. Granger, Investigating causal relations by econometric models and cross-spectral
   methods, Econometrica 37 (1969) 424-438, doi:10.2307/1912791.
.. [4] R. S. Tsay, Nonlinearity tests for time series, Biometrika 73 (1986) 461-466,
   doi:10.1093/biomet/73.2.461.
.. [5] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   16.6 (Residual analysis).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import fdtrc

from ..arrays import FloatArray, IntArray
from ..constants import LEAST_FREEDOM
from ..signals.noise import mad_sigma

OWN_PAST = 12
"""Past outputs: with them lags and coloured noise of the usual kinds leave a white residual. This
and the numbers below were set on worlds of `benchmarks.worlds` with and without a loop (see `RARE`
of the flags)."""
_AHEAD = 3
"""Samples after the present for which an input is asked about."""
_OUTPUTS = 8
"""Outputs, the present one among them, that may tell an input."""
_PIECES = 6
"""Means of the past input whose products are asked about."""
_WILD = 3.0
"""Standard deviations at which innovations are cut: set-points move an input more than noise."""
_SPARSE = 0.05
"""Ratio of median and standard deviation below which an input rests between its moves."""
_PREDICTED = 1e-5
"""Part of a signal that is left where its past tells it: a sine or a ramp has no innovations."""
_RANK = 1e-10  # of the largest singular value: rounding


@dataclass(frozen=True, eq=False)
class _Past:
    """Regressors (rows, q) of what came before each of the samples `here`."""

    here: IntArray
    columns: FloatArray

    def left(self, targets: FloatArray) -> tuple[FloatArray, int]:
        """What the past leaves of targets (rows, k), and its rank."""
        size = np.linalg.norm(self.columns, axis=0)
        scaled = self.columns / np.where(size > 0, size, 1.0)
        solution, _, rank, _ = np.linalg.lstsq(scaled, targets, rcond=_RANK)
        return targets - scaled @ solution, int(rank)


def feedback_chance(output: FloatArray, drive: FloatArray, past: int) -> float:
    """Chance that an input follows its output as it does, in open loop.

    In open loop the input knows nothing of the disturbance: what is new in the output has nothing
    to do with what is new in the input now and after (Sims, Money, income, and causality, Am. Econ.
    Rev. 62 (1972) 540-552; by innovations: Haugh, J. Am. Stat. Ass. 71 (1976) 378-385). Nor does
    the output tell more of the input than that tells of itself (Granger, Econometrica 37 (1969)
    424-438), as it does of a relay's. A plant that answers within the same sample looks like
    feedback too.

    Parameters
    ----------
    output, drive : ndarray, shape (N,)
    past : int
        Past inputs in the regression, which should reach beyond the dead time.

    Returns
    -------
    float
        Twice the smaller of the upper tails of two F distributions, at most 1; 1 where the record
        is too short or where its own past tells the input.
    """
    known = _past(output, drive, past, _AHEAD)
    if known is None:
        return 1.0
    ahead = [drive[known.here + i] for i in range(_AHEAD + 1)]
    new, rank = known.left(np.stack([output[known.here], *ahead], axis=1))
    if np.any(new.std(axis=0)[:2] <= _PREDICTED * np.array([output.std(), drive.std()])):
        return 1.0
    cut = np.stack([_tamed(column) for column in new.T], axis=1)
    sims = _chance(cut[:, 1:], cut[:, 0], np.zeros((len(cut), 0)), rank)[0]
    return min(2 * min(sims, _led(output, drive, min(2 * past, output.size // 5))), 1.0)


def _led(output: FloatArray, drive: FloatArray, past: int) -> float:
    """Chance that outputs tell an input beyond its own past as they do (Granger)."""
    here = np.arange(past, output.size)
    own = np.stack([np.ones(here.size), *(drive[here - i] for i in range(1, past + 1))], axis=1)
    outputs = np.stack([output[here - i] for i in range(_OUTPUTS)], axis=1)
    left, rank = _Past(here, own).left(np.column_stack([drive[here], outputs]))
    if left[:, 0].std() <= _PREDICTED * drive.std():
        return 1.0
    return _chance(left[:, 1:], left[:, 0], np.zeros((here.size, 0)), rank)[0]


def nonlinear_chance(output: FloatArray, drive: FloatArray, past: int) -> tuple[float, float]:
    """Chance that a linear plant's innovations go with products of past inputs, and their part.

    Means of the input over six pieces of the past, their products by two and their cubes are
    added to the regression (a Volterra series with few parameters: Tsay, Nonlinearity tests for
    time series, Biometrika 73 (1986) 461-466; Ljung, System Identification, 2nd ed., section
    16.6, on residuals against other functions of the data).

    Parameters
    ----------
    output, drive : ndarray, shape (N,)
    past : int
        Samples within which most of a response happens.

    Returns
    -------
    chance, part : float
        Upper tail of the F distribution, and the part of the innovations' variance explained;
        1 and 0 where the record is too short or where its own past tells the input.
    """
    known = _past(output, drive, past, 0)
    if known is None:
        return 1.0, 0.0
    width = max(past // _PIECES, 1)
    sums = np.concatenate([np.zeros(1), np.cumsum(drive - np.mean(drive))])
    ends = [sums[np.maximum(known.here + 1 - i * width, 0)] for i in range(_PIECES + 1)]
    pieces = [(late - early) / width for late, early in pairwise(ends)]
    products = [a * b for i, a in enumerate(pieces) for b in pieces[i:]]
    products += [a**3 for a in pieces]
    both = [output[known.here], drive[known.here]]
    left, rank = known.left(np.column_stack([*both, *pieces, *products]))
    if np.any(left.std(axis=0)[:2] <= _PREDICTED * np.array([output.std(), drive.std()])):
        return 1.0, 0.0
    first = 2 + _PIECES
    return _chance(left[:, first:], left[:, 0], left[:, 2:first], rank)


def _past(output: FloatArray, drive: FloatArray, past: int, ahead: int) -> _Past | None:
    before = max(OWN_PAST, past)
    rows = output.size - before - ahead
    if rows < LEAST_FREEDOM + 2 * (OWN_PAST + past):
        return None
    here = np.arange(before, before + rows)
    own = [output[here - i] for i in range(1, OWN_PAST + 1)]
    earlier = [drive[here - i] for i in range(1, past + 1)]
    level = [np.ones(rows), here / rows]
    return _Past(here, np.stack([*level, *own, *earlier], axis=1))


def _tamed(values: FloatArray) -> FloatArray:
    """Cut what lies far out; an input that rests between its moves is left as it is."""
    spread = mad_sigma(values)
    if spread <= _SPARSE * float(values.std()):
        return values
    return np.asarray(np.clip(values, -_WILD * spread, _WILD * spread))


def _chance(
    columns: FloatArray, target: FloatArray, beside: FloatArray, taken: int
) -> tuple[float, float]:
    """F test of columns beside others, `taken` parameters being used already."""
    alone, first = _squares(beside, target)
    both, rank = _squares(np.column_stack([beside, columns]), target)
    freedom = target.size - rank - taken
    if rank == first or freedom < LEAST_FREEDOM or both <= 0:
        return 1.0, 0.0
    ratio = max((alone - both) / (rank - first) / (both / freedom), 0.0)
    return float(fdtrc(rank - first, freedom, ratio)), (alone - both) / alone


def _squares(columns: FloatArray, target: FloatArray) -> tuple[float, int]:
    """Sum of squares that columns leave, and their rank."""
    if not columns.shape[1]:
        return float(target @ target), 0
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0, size, 1.0)
    solution, _, rank, _ = np.linalg.lstsq(scaled, target, rcond=1e-8)
    error = target - scaled @ solution
    return float(error @ error), int(rank)
