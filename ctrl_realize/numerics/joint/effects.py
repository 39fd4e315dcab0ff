"""Gains, dead times and lags that are not exactly the same in every measurement.

To first order another gain, dead time or scale of the time constants of a part of the data adds a
multiple of a known shape to its model. For records that differ from one another by more than their
noise the multiples of their mean are random, with the standard error of the mean: each is a
regressor with a row that says how far it is from zero (linear mixed model [1]_). For a frequency
response that contradicts the records, a multiple without such a row says in what it differs; it is
added to the data, and estimated again, until nothing is left (Gauss-Newton [2]_).

References
----------
.. [1] N. M. Laird and J. H. Ware, Random-effects models for longitudinal data, Biometrics 38 (1982)
   963-974, doi:10.2307/2529876.
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.2 (Numerical solution by iterative search methods).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np

from ..arrays import FloatArray
from ..engine.eliminate import evaluate
from ..engine.modal import respond
from ..engine.problem import KnownFactor
from ..engine.responses import SampledInput
from ..engine.structures import Candidate, settled
from ..engine.window_fit import Window
from ..output_error.result import OutputErrorEstimate
from ..signals.sines import stacked_parts
from ..validation.own_response import response_slopes
from .data import JointData, with_rows

PointsEffect: TypeAlias = Literal["gain", "dead_time"]
Effect: TypeAlias = Literal["gain", "dead_time", "lags"]
_TURNS = 4  # of Gauss and Newton: a dead time that is half a turn off is found in three
_FARTHEST = 0.5  # logarithm of a gain in one turn


def with_random_effects(
    records: Window, fit: OutputErrorEstimate, spread: Sequence[tuple[Effect, float]], dt: float
) -> Window:
    """Let gain, dead time or lags of the records deviate from the plant's.

    Parameters
    ----------
    records : Window
    fit : OutputErrorEstimate
        Of the records alone; the effects are linear about it.
    spread : sequence of (key, standard deviation)
        Of the logarithm of the gain, the dead time in s, the logarithm of the time constants.
    dt : float
        Sample time in s.
    """
    kept = [(key, std) for key, std in spread if std > 0]
    if not kept:
        return records
    problem, count = records.problem, len(kept)
    model = fit.dead_time, fit.poles, fit.numerator
    shapes: list[FloatArray] = []
    for drive in (problem.drive, records.drive):
        slopes = response_slopes(drive, KnownFactor(), *model, dt)
        every = dict(zip(("gain", "dead_time", "lags"), slopes, strict=True))
        shapes.append(np.stack([std * every[key] for key, std in kept], axis=1))
    rows = replace(
        problem,
        data=np.zeros(count),
        root_weight=np.ones(count),
        drive=SampledInput(np.zeros(count), dt),
        regressors=np.eye(count),
    )
    wide = replace(problem, regressors=np.concatenate([problem.regressors, shapes[0]], axis=1))
    columns = np.concatenate([records.columns, shapes[1]], axis=1)
    return replace(records, problem=with_rows(wide, rows), columns=columns)


def freed(data: JointData, joint: Candidate, key: PointsEffect) -> tuple[float, float]:
    """Fit both with another gain, or another dead time, of the frequency response.

    Returns the gain of the frequency response over that of the records, or its dead time less
    theirs in s, and the sum of squares.
    """
    records, points = data.records.problem, data.points
    ratio, later, model = 1.0, 0.0, joint
    wide = replace(records, regressors=np.pad(records.regressors, ((0, 0), (0, 1))))
    for _ in range(_TURNS):
        response = points.response * np.exp(points.s * later) / ratio
        turned = replace(points, response=response, weight=points.weight * abs(ratio))
        alone = turned.problem
        common = evaluate(with_rows(records, alone), model.structure, model.parameters[None])
        rows = respond(alone.drive, alone.known, common.numerator[0], model.parameters)
        response = rows[: points.s.size] + 1j * rows[points.s.size :]
        shape = stacked_parts(response if key == "gain" else -points.s * response)
        size = float(np.linalg.norm(shape * alone.root_weight)) or 1.0
        problem = with_rows(wide, replace(alone, regressors=shape[:, None] / size))
        cost = float(evaluate(problem, model.structure, model.parameters[None]).cost[0])
        model = settled(problem, replace(model, cost=cost, ends=None), data.scales)
        state = evaluate(problem, model.structure, model.parameters[None])
        move = float(state.regression[0, -1]) / size
        if key == "gain":
            ratio *= float(np.exp(np.clip(np.log(max(1 + move, 0.1)), -_FARTHEST, _FARTHEST)))
        else:
            later += move
    return (ratio if key == "gain" else later), model.cost
