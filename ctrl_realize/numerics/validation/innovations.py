"""Tests based on innovations: does the input depend on the output, is the plant linear?

The output is predicted from its own past and that of the input by one long regression, without a
model of the plant. So the tests remain valid if the fitted model is wrong: in closed loop a fit may
be that of the inverse controller, which leaves no residual.

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
.. [6] P. W. Holland and R. E. Welsch, Robust regression using iteratively reweighted least-squares,
   Comm. Statist. A 6 (1977) 813-827, doi:10.1080/03610927708827533.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter
from scipy.special import fdtrc

from ..arrays import FloatArray, IntArray, unit_columns
from ..constants import LEAST_FREEDOM, SMALLEST
from ..rules import Rule
from ..signals.correlation import autoregression
from ..signals.noise import mad_sigma, quantisation_step

RARE = 1e-4
"""Probability of a false alarm of each test. In 290 records without feedback (29 worlds of
`benchmarks.worlds`) the smallest p-value was 1e-3; in 60 loops other than pure limit cycles, all
were below 1e-4."""
REGRESSED = 4000
"""Largest number of samples in the long regressions."""
_LEAST_PAST, _MOST_PAST = 30, 150  # past inputs in them; time grows with the square
OWN_PAST = 12
"""Past outputs: with them lags and coloured noise of the usual kinds leave a white residual. This
and the numbers below were set on worlds of `benchmarks.worlds` with and without a loop."""
_AHEAD = 3
"""Samples after the present for which an input is asked about."""
_FEWEST_MOVES = 6
"""Moves of an input that tell whether it depends on the output. Measured in simulated records
without feedback: below `RARE` were 39 of 150 with pulses and doublets into integrators, and 4 of
300 with them into lags; with five moves 2 of 450, and with more none of 675."""
_LATE = 8  # samples by which a late input is looked for
_MOSTLY = 0.5  # part of what earlier inputs leave that later ones explain then
_NEARLY = 0.98  # part of it: those beyond respond to noise, in a loop
_OUTPUTS = 8
"""Outputs, the present one among them, that may tell an input."""
_CONTROLLER = 4
"""Past samples of input and output in the equation of a controller: PID with a filter has two."""
_EXACTLY = 0.25
"""Median of what the output leaves of an input, over that of what its past does, and over its
standard deviation. Of 36 loops of `benchmarks.closed_loop` without limits or rounding all were
below 0.12; a feedthrough in slow noise is at 0.7 of the second, and the open loops of
`benchmarks.worlds` are above 0.4 of one of them. Ablation: loop without its set point."""
_ROUNDED, _AS_ROUNDED = 0.5, 1.25
"""The same where rounding explains what the output leaves, within this factor. With both signals
rounded to their median change between samples, none of the 18 of those loops with three moves was
above 0.47 of either, or left more than 1.24 times the rounding. Ablation: controller behind
rounding."""
_SINGLE = 0.9
"""Part of the moves of such an input that are a single step; those of a set point are more."""
_PIECES = 6
"""Means of the past input whose products are asked about."""
_PARTS, _REACH = 20, 4
"""Means of the past input that may explain a residual, over so many parts of a quarter of a record.
Of 27 simulated records of plants with a second path or a recycle, of which 16 miss the dead time,
11 were below 1e-4; of 86 of other plants, in white and slow noise, none was below 0.02."""
_WILD = 3.0
"""Standard deviations at which innovations are cut: set-points move an input more than noise."""
_SPARSE = 0.05
"""Ratio of median and standard deviation below which an input rests between its moves."""
_PREDICTED = 1e-5
"""Part of a signal that is left where its past tells it: a sine or a ramp has no innovations."""
_TURNS, _FLOOR = 12, 0.1  # of weights; smallest residual in one, of the median
_RANK = 1e-10  # of the largest singular value: rounding


def past_inputs(size: int, delay: float) -> int:
    """Number of past inputs: more than a dead time, even if its estimate is wrong."""
    return int(min(max(size // 12, _LEAST_PAST, 1.5 * delay + 10), _MOST_PAST, size // 6))


def feedback_chance(output: FloatArray, drive: FloatArray, past: int) -> float:
    """P-value of the dependence of the input on the output, for an open loop.

    In open loop the input does not depend on the disturbance: the innovations of the output are
    independent of the present and future innovations of the input (Sims, Money, income, and
    causality, Am. Econ. Rev. 62 (1972) 540-552; by innovations: Haugh, J. Am. Stat. Ass. 71 (1976)
    378-385). Nor does the past output improve the prediction of the input (Granger, Econometrica 37
    (1969) 424-438), as it does for a relay. A plant that responds within the same sample cannot be
    distinguished from feedback.

    Parameters
    ----------
    output, drive : ndarray, shape (N,)
    past : int
        Number of past inputs in the regression, which should exceed the dead time.

    Returns
    -------
    float
        Twice the smaller of the upper tails of two F distributions, at most 1; 1 if the record is
        too short or its input is predictable, or hardly moves.
    """
    if np.count_nonzero(np.diff(drive)) < _FEWEST_MOVES:
        return 1.0
    known = _past(output, drive, past, _AHEAD)
    if known is None:
        return 1.0
    here, before = known
    ahead = [drive[here + i] for i in range(_AHEAD + 1)]
    new, rank = _left(before, np.stack([output[here], *ahead], axis=1))
    if np.any(new.std(axis=0)[:2] <= _PREDICTED * np.array([output.std(), drive.std()])):
        return 1.0
    cut = np.stack([_tamed(column) for column in new.T], axis=1)
    sims = _chance(cut[:, 1:], cut[:, 0], np.zeros((len(cut), 0)), rank)[0]
    return min(2 * min(sims, _answer_chance(output, drive, past)), 1.0)


def shows_feedback(records: Sequence[tuple[FloatArray, FloatArray]]) -> bool:
    """Whether inputs are those of controllers; `records` are outputs and inputs, complete.

    The innovations are dependent, and outputs tell the input but for rare moves, those of a set
    point: what a response within the same sample leaves, or an input that is recorded late, is
    noise. If a controller rounds so coarsely that it mostly rests, past outputs tell the input.
    Ablation: past outputs tell a controller.
    """
    pairs = [(y[-REGRESSED:], u[-REGRESSED:]) for y, u in records]
    rare = RARE / len(pairs)

    def answers(y: FloatArray, u: FloatArray) -> bool:
        past = past_inputs(y.size, 0.0)
        if feedback_chance(y, u, past) >= rare:
            return False
        if _told(y, u):
            return True
        return _mostly_rests(u) and _answer_chance(y, u, past, first=1) < rare and Rule.PAST.on

    return all(answers(y, u) for y, u in pairs)


def _told(output: FloatArray, drive: FloatArray) -> bool:
    """Whether the output tells most samples of an input which its own past does not tell."""
    here = np.arange(_CONTROLLER, drive.size)
    own = [np.ones(here.size), *(drive[here - i] for i in range(1, _CONTROLLER + 1))]
    outputs = [output[here - i] for i in range(_CONTROLLER + 1)]
    alone, _ = _least_absolute(own, drive[here])
    left, weights = _least_absolute([*own, *outputs], drive[here])
    sizes = [quantisation_step(drive), quantisation_step(output)]
    steps = np.repeat(sizes, [len(own), len(outputs)])
    # The input of the sample itself is rounded in place of the constant.
    weights[0] = 1.0
    rounding = float(np.linalg.norm(steps * weights)) / np.sqrt(12)
    size = float(np.median(np.abs(left)))
    least = min(float(np.median(np.abs(alone))), float(np.std(left)))
    rounded = size < _ROUNDED * least and mad_sigma(left) <= _AS_ROUNDED * rounding
    return size < _EXACTLY * least or (rounded and Rule.LOOP_ROUNDED.on)


def _mostly_rests(drive: FloatArray) -> bool:
    """Whether an input rests at most samples, and moves by single steps of a converter."""
    moves = np.abs(np.diff(drive))
    moves, step = moves[moves > 0], quantisation_step(drive)
    return 2 * moves.size < drive.size and float(np.quantile(moves, _SINGLE)) < 1.5 * step


def _answer_chance(output: FloatArray, drive: FloatArray, past: int, first: int = 0) -> float:
    """P-value of the prediction of the input by outputs (Granger causality), as above.

    With `first` 1 the present output, which may respond to it within the sample, is left out.
    """
    past, drive = min(2 * past, output.size // 5), _about_mean(drive)
    here = np.arange(past, output.size)
    own = np.stack([np.ones(here.size), *(drive[here - i] for i in range(1, past + 1))], axis=1)
    outputs = np.stack([output[here - i] for i in range(first, _OUTPUTS)], axis=1)
    left, rank = _left(own, np.column_stack([drive[here], outputs]))
    if left[:, 0].std() <= _PREDICTED * drive.std():
        return 1.0
    return _chance(left[:, 1:], left[:, 0], np.zeros((here.size, 0)), rank)[0]


def late_samples(output: FloatArray, drive: FloatArray, past: int) -> tuple[int, float]:
    """Count the samples by which an input is recorded late, if the output responds ahead of it.

    An input that is held from its sample on acts on the next one at the earliest. In a loop the
    same is found: the output acts on the input.

    Parameters
    ----------
    output, drive : ndarray, shape (N,)
    past : int
        Number of past inputs in the regression.

    Returns
    -------
    samples, part : int, float
        And the part of what earlier inputs leave of the output that those of the same sample and of
        later ones explain; 0 and 0 if they explain less than half of it.
    """
    here, drive = np.arange(past, output.size - _LATE), _about_mean(drive)
    if here.size < LEAST_FREEDOM + 2 * past:
        return 0, 0.0
    earlier = [drive[here - i] for i in range(1, past + 1)]
    before = np.stack([np.ones(here.size), here / here.size, *earlier], axis=1)
    ahead = [drive[here + i] for i in range(_LATE)]
    left, _ = _left(before, np.stack([output[here], *ahead], axis=1))
    squares = [_squares(left[:, 1 : count + 1], left[:, 0])[0] for count in range(_LATE + 1)]
    parts = 1 - np.array(squares) / max(squares[0], SMALLEST)
    samples = int(np.argmax(parts >= _NEARLY * parts[-1]))
    return (samples, float(parts[samples])) if parts[samples] >= _MOSTLY else (0, 0.0)


def nonlinear_chance(output: FloatArray, drive: FloatArray, past: int) -> tuple[float, float]:
    """P-value of nonlinear terms for a linear plant, and their share of the innovations.

    Means of the input over six parts of the past, their products and cubes are added to the
    regression (a Volterra series with few parameters: Tsay, Nonlinearity tests for time series,
    Biometrika 73 (1986) 461-466; Ljung, System Identification, 2nd ed., section 16.6, on residuals
    against other functions of the data).

    Parameters
    ----------
    output, drive : ndarray, shape (N,)
    past : int
        Number of samples within which most of the response occurs.

    Returns
    -------
    chance, part : float
        Upper tail of the F distribution, and the fraction of the innovations' variance explained; 1
        and 0 if the record is too short or its input is predictable.
    """
    known = _past(output, drive, past, 0)
    if known is None:
        return 1.0, 0.0
    here, before = known
    width = max(past // _PIECES, 1)
    sums = np.concatenate([np.zeros(1), np.cumsum(drive - np.mean(drive))])
    ends = [sums[np.maximum(here + 1 - i * width, 0)] for i in range(_PIECES + 1)]
    pieces = [(late - early) / width for late, early in pairwise(ends)]
    products = [a * b for i, a in enumerate(pieces) for b in pieces[i:]]
    products += [a**3 for a in pieces]
    both = [output[here], drive[here]]
    left, rank = _left(before, np.column_stack([*both, *pieces, *products]))
    if np.any(left.std(axis=0)[:2] <= _PREDICTED * np.array([output.std(), drive.std()])):
        return 1.0, 0.0
    first = 2 + _PIECES
    return _chance(left[:, first:], left[:, 0], left[:, 2:first], rank)


def misfit_chance(residual: FloatArray, drive: FloatArray) -> float:
    """P-value of the dependence of the residual of a model on the past input.

    Means of the input over parts of a quarter of the record, made white with the residual: further
    back than a test of single lags reaches (Ljung, System Identification, 2nd ed., section 16.6).

    Parameters
    ----------
    residual, drive : ndarray, shape (N,)
    """
    count = residual.size
    width = max(count // _REACH // _PARTS, 1)
    sums = np.append(np.zeros(width * _PARTS + 1), np.cumsum(drive - drive[0]))
    ends = [sums[width * i :][:count] for i in range(_PARTS, -1, -1)]
    parts = [late - early for late, early in pairwise(ends)]
    both = np.stack([residual, np.ones(count), np.arange(count) / count, *parts], axis=1)
    filter_ = np.append(1.0, -autoregression(residual, OWN_PAST))
    white = np.asarray(lfilter(filter_, [1.0], both, axis=0)[filter_.size :])
    return _chance(white[:, 3:], white[:, 0], white[:, 1:3], 0)[0]


def _past(
    output: FloatArray, drive: FloatArray, past: int, ahead: int
) -> tuple[IntArray, FloatArray] | None:
    """Samples whose past and future are known, and the past as regressors (rows, q)."""
    before = max(OWN_PAST, past)
    rows = output.size - before - ahead
    if rows < LEAST_FREEDOM + 2 * (OWN_PAST + past):
        return None
    here = np.arange(before, before + rows)
    output, drive = _about_mean(output), _about_mean(drive)
    own = [output[here - i] for i in range(1, OWN_PAST + 1)]
    earlier = [drive[here - i] for i in range(1, past + 1)]
    level = [np.ones(rows), here / rows]
    return here, np.stack([*level, *own, *earlier], axis=1)


def _about_mean(values: FloatArray) -> FloatArray:
    """Leave the level to the constant of a regression: beside a large one moves are rounding."""
    return values - np.mean(values)


def _tamed(values: FloatArray) -> FloatArray:
    """Clip outliers; an input that is constant between its changes is not modified."""
    spread = mad_sigma(values)
    if spread <= _SPARSE * float(values.std()):
        return values
    return np.asarray(np.clip(values, -_WILD * spread, _WILD * spread))


def _chance(
    columns: FloatArray, target: FloatArray, beside: FloatArray, taken: int
) -> tuple[float, float]:
    """F test of additional columns, with `taken` parameters already in use."""
    alone, first = _squares(beside, target)
    both, rank = _squares(np.column_stack([beside, columns]), target)
    freedom = target.size - rank - taken
    if rank == first or freedom < LEAST_FREEDOM or both <= 0:
        return 1.0, 0.0
    ratio = max((alone - both) / (rank - first) / (both / freedom), 0.0)
    return float(fdtrc(rank - first, freedom, ratio)), (alone - both) / alone


def _squares(columns: FloatArray, target: FloatArray) -> tuple[float, int]:
    """Residual sum of squares of columns, and their rank."""
    if not columns.shape[1]:
        return float(target @ target), 0
    error, rank = _left(columns, target, 1e-8)
    return float(error @ error), rank


def _least_absolute(
    rows: Sequence[FloatArray], target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residual of rows and their weights with least absolute deviations, by reweighting [6]_."""
    columns, weights = np.stack(rows, axis=1), np.ones((target.size, 1))
    for _ in range(_TURNS):
        weighted = weights * columns, weights[:, 0] * target
        found = np.asarray(np.linalg.lstsq(*weighted, rcond=_RANK)[0], dtype=np.float64)
        left = target - columns @ found
        size = np.abs(left)
        least = max(_FLOOR * float(np.median(size)), _RANK * float(np.std(target)), SMALLEST)
        weights = np.maximum(size, least)[:, None] ** -0.5
    return left, found


def _left(columns: FloatArray, targets: FloatArray, least: float = _RANK) -> tuple[FloatArray, int]:
    """What least squares leave of targets, and the rank of the columns, scaled to one size."""
    scaled, _ = unit_columns(columns)
    solution, _, rank, _ = np.linalg.lstsq(scaled, targets, rcond=least)
    return targets - scaled @ solution, int(rank)
