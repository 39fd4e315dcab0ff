"""Gains, dead times and lags that are not exactly the same in every measurement.

To first order another gain, dead time or scale of the time constants of a part of the data adds a
multiple of a known shape to its model. For records that differ from one another by more than their
noise the multiples of their mean are random, with the standard error of the mean: each is a
regressor with a row of its own that says how far it is from zero (linear mixed model [1]_). For a
frequency response that contradicts the records, a multiple without such a row says in what it
differs; it is added to the data, and found again, until nothing is left (Gauss-Newton [2]_).

References
----------
.. [1] N. M. Laird and J. H. Ware, Random-effects models for longitudinal data, Biometrics 38 (1982)
   963-974, doi:10.2307/2529876.
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.2 (Numerical solution by iterative search methods).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from ..arrays import ComplexArray, FloatArray
from ..engine.compared_fits import settled
from ..engine.eliminate import evaluate
from ..engine.modal import respond
from ..engine.poles import parameters_from_poles
from ..engine.problem import KnownFactor, Problem
from ..engine.responses import HeldInput, Modes
from ..engine.structures import Candidate, Scales
from ..output_error.result import OutputErrorEstimate
from ..signals.sines import stacked_parts
from .frf_rows import MeasuredPoints, both_together, with_rows
from .record_part import RecordPart

OwnKey: TypeAlias = Literal["gain", "dead_time"]
EffectKey: TypeAlias = Literal["gain", "dead_time", "lags"]
_STEP = 0.01  # of the logarithm of the time constants, for a slope by differences
_TURNS = 4  # of Gauss and Newton: a dead time that is half a turn off is found in three
_FARTHEST = 0.5  # logarithm of a gain in one turn


@dataclass(frozen=True, eq=False)
class _Nothing:
    """Rows without any response."""

    rows: int

    def pieces(self) -> list[_Nothing]:
        return [self]

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        none = np.zeros((tau.size, self.rows, poles.shape[1]))
        return none[:, :, 0], none, none


def with_random_effects(
    part: RecordPart,
    fit: OutputErrorEstimate,
    spread: Sequence[tuple[EffectKey, float]],
) -> RecordPart:
    """Let gain, dead time or lags of the records deviate from the plant's.

    Parameters
    ----------
    part : RecordPart
    fit : OutputErrorEstimate
        Of the records alone; the effects are linear about it.
    spread : sequence of (key, standard deviation)
        Of the logarithm of the gain, the dead time in s, the logarithm of the time constants.
    """
    kept = [(key, std) for key, std in spread if std > 0]
    if not kept:
        return part
    problem, count = part.problem, len(kept)
    near, far = (
        np.stack([std * _shape(drive, fit, key, part.scales.dt) for key, std in kept], axis=1)
        for drive in (problem.drive, part.drive)
    )
    before = problem.regressors.shape[1]
    rows = replace(
        problem,
        data=np.zeros(count),
        root_weight=np.ones(count),
        drive=_Nothing(count),
        regressors=np.concatenate([np.zeros((count, before)), np.eye(count)], axis=1),
    )
    wide = replace(problem, regressors=np.concatenate([problem.regressors, near], axis=1))
    columns = np.concatenate([part.columns, far], axis=1)
    return replace(part, problem=with_rows(wide, rows), columns=columns)


def _shape(drive: HeldInput, fit: OutputErrorEstimate, key: EffectKey, dt: float) -> FloatArray:
    """Derivative of a response w.r.t. the logarithm of gain or lags, or the dead time."""
    dead_time, poles, numerator = fit.dead_time, fit.poles, fit.numerator
    powers = np.arange(numerator.size) - float(poles.size)

    def response(at: float, stretch: float = 1.0) -> FloatArray:
        parameters = np.concatenate([[at], parameters_from_poles(poles / stretch)])
        return respond(drive, KnownFactor(), numerator * stretch**powers, parameters)

    if key == "gain":
        return response(dead_time)
    if key == "dead_time":
        first, last = max(dead_time - dt, 0.0), dead_time + dt
        return (response(last) - response(first)) / (last - first)
    turned = response(dead_time, 1 + _STEP) - response(dead_time, 1 - _STEP)
    return np.asarray(turned / (2 * _STEP))


def freed(
    record: Problem,
    points: MeasuredPoints,
    joint: Candidate,
    scales: Scales,
    key: OwnKey,
) -> tuple[float, float]:
    """Fit both with one effect that is the frequency response's own.

    Returns the gain of the frequency response over that of the records, or its dead time less
    theirs in s, and the sum of squares.
    """
    s = 1j * points.omega
    ratio, later, model = 1.0, 0.0, joint
    for _ in range(_TURNS):
        turned = replace(
            points,
            response=points.response * np.exp(s * later) / ratio,
            sigma=points.sigma / abs(ratio),
        )
        alone = turned.problem()
        numerator = evaluate(both_together(record, alone), model.structure, model.parameters[None])
        rows = respond(alone.drive, alone.known, numerator.numerator[0], model.parameters)
        response = rows[: s.size] + 1j * rows[s.size :]
        shape = stacked_parts(response if key == "gain" else -s * response)
        size = float(np.linalg.norm(shape * alone.root_weight)) or 1.0
        own = both_together(
            replace(record, regressors=np.pad(record.regressors, ((0, 0), (0, 1)))),
            replace(alone, regressors=shape[:, None] / size),
        )
        cost = float(evaluate(own, model.structure, model.parameters[None]).cost[0])
        model = settled(own, replace(model, cost=cost, ends=None), scales)
        state = evaluate(own, model.structure, model.parameters[None])
        move = float(state.regression[0, -1]) / size
        if key == "gain":
            ratio *= float(np.exp(np.clip(np.log(max(1 + move, 0.1)), -_FARTHEST, _FARTHEST)))
        else:
            later += move
    return (ratio if key == "gain" else later), model.cost


def chance_of(statistic: float, parameters: int, freedom: float) -> float:
    """Probability of a larger likelihood ratio by chance.

    A chi-square, or an F ratio if the noise was estimated with `freedom` degrees of freedom.
    """
    if np.isfinite(freedom):
        return float(f_distribution.sf(statistic / parameters, parameters, freedom))
    return float(chi2.sf(statistic, parameters))
