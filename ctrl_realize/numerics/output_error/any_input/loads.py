"""Loads of running loops: steps at the input of the plant, of which the records know nothing.

A controller answers a load, so that its response is correlated with the input: a model takes it for
a part of its own, and the error of its gain is not that of noise. A step at each time is tried by
its score test [1]_, with the response of the plant as its shape; the one of the largest score is
estimated with the level of its record (likelihood ratio over the time of a change [2]_). What is
known of loads is input of the plant, so that their responses tell its lags as well; what is not, in
size and time, are linear terms.

References
----------
.. [1] C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters, Proc.
   Cambridge Philos. Soc. 44 (1948) 50-57, doi:10.1017/S0305004100023987.
.. [2] A. S. Willsky and H. L. Jones, A generalized likelihood ratio approach to the detection and
   estimation of jumps in linear systems, IEEE Trans. Autom. Control 21 (1976) 108-112,
   doi:10.1109/TAC.1976.1101146.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ...arrays import FloatArray, IntArray
from ...constants import SMALLEST
from ...engine.eliminate import evaluate
from ...engine.local_terms import local_columns
from ...engine.modal import respond
from ...engine.responses import SampledInput
from ...engine.static_gain import local_errors
from ...engine.structures import Candidate
from .data import SampledData
from .window import SampledWindow

_TIMES = 200  # of a load that are tried in a record, and then every sample about the best


class Load(NamedTuple):
    """Step of a load: the record, the output from which on it is seen, and its size as an input."""

    record: int
    row: int
    size: float = 0.0


class Lags(NamedTuple):
    """Model that responds to loads, and its numerator."""

    model: Candidate
    numerator: FloatArray

    def responses(self, data: SampledData) -> list[FloatArray]:
        """Response to a unit step, without dead time, at the outputs of every record."""
        parameters = np.append(0.0, self.model.parameters[1:])
        return [
            respond(
                SampledInput(np.ones(y.size), data.step), data.known, self.numerator, parameters
            )
            for y in data.outputs
        ]


def with_loads(data: SampledData, lags: Lags, loads: Sequence[Load]) -> SampledData:
    """Records with loads as inputs, whose sizes and times are estimated further with the level."""
    if not loads:
        return data
    responses, steps = lags.responses(data), [np.zeros(u.size) for u in data.inputs]
    columns = [np.zeros((y.size, 2 * len(loads))) for y in data.outputs]
    for i, (record, row, size) in enumerate(loads):
        at = round((row * data.step - lags.model.dead_time) / data.dt)
        steps[record][max(at, 0) :] += size
        step = responses[record][: data.outputs[record].size - row]
        own = np.stack([step, np.diff(step, prepend=0.0)], axis=1)
        columns[record][row:, 2 * i : 2 * i + 2] = own
    return replace(data, steps=tuple(steps), loads=tuple(columns))


def sized(part: SampledWindow, lags: Lags, loads: Sequence[Load]) -> list[Load]:
    """Loads with their sizes, by what the model leaves beside those that were known."""
    if not loads:
        return []
    problem, edges = part.data.problem, part.data.edges
    left = problem.data - respond(
        problem.drive, problem.known, lags.numerator, lags.model.parameters
    )
    assert problem.segments is not None
    columns = local_columns(problem.segments, lags.model.poles[None])[0]
    first = problem.segments.regressors.shape[1] - 2 * len(loads)
    found = []
    for i, load in enumerate(loads):
        rows = slice(edges[load.record], edges[load.record + 1])
        more = np.linalg.lstsq(columns[rows], left[rows], rcond=None)[0][first + 2 * i]
        found.append(load._replace(size=load.size + float(more) * part.data.scales[load.record]))
    return found


def sought(
    data: SampledData, part: SampledWindow, lags: Lags, loads: Sequence[Load]
) -> tuple[list[Load], Load | None]:
    """Place every load anew beside the others, and find the likeliest further one.

    That is none where its score is less than the charge of one parameter: its fit must earn more.
    """
    data = replace(data, starts=part.data.starts, scales=part.data.scales)
    placed = list(loads)
    for i, load in enumerate(loads):
        there, _ = _likeliest(data, part, lags, placed[:i] + placed[i + 1 :])
        placed[i] = there._replace(size=load.size)
    further, score = _likeliest(data, part, lags, placed)
    return placed, further if score > np.log(part.fit.problem.data.size) else None


def _likeliest(
    data: SampledData, part: SampledWindow, lags: Lags, others: Sequence[Load]
) -> tuple[Load, float]:
    """Load of the largest score beside others, and its score in variances of the residual."""
    model = lags.model
    filtered = with_loads(data, lags, others).whitened(part.noise, part.residual)
    problem, edges = filtered.problem, filtered.edges
    state = evaluate(problem, model.structure, model.parameters[None])
    left = state.residual[0]
    errors = local_errors(problem, model, state.numerator[0], part.fit.scales.length)
    shapes = [lfilter(part.noise, [1.0], shape) for shape in lags.responses(data)]

    def scores(record: int, times: IntArray) -> FloatArray:
        since = filtered.rows[record][:, None] - times
        columns = np.zeros((left.size, times.size))
        columns[edges[record] : edges[record + 1]] = np.where(
            since < 0, 0.0, shapes[record][np.maximum(since, 0)]
        )
        return errors.lowered(left, columns)

    best, most = Load(0, 0), 0.0
    for record, rows in enumerate(filtered.rows):
        times = np.unique(np.linspace(rows[0], rows[-1], _TIMES).astype(np.int64))
        for _ in range(2):
            score = scores(record, times)
            top = int(score.argmax())
            if score[top] > most:
                best, most = Load(record, int(times[top])), float(score[top])
            times = np.arange(times[max(top - 1, 0)], times[min(top + 1, times.size - 1)] + 1)
    return best, most / max(float(np.mean(left**2)), SMALLEST)
