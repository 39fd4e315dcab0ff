"""Loads: steps at the input of the plant, of which the records know nothing.

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

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.signal import lfilter

from ...arrays import FloatArray, IntArray
from ...constants import SMALLEST, VERY_STRONG
from ...engine.eliminate import evaluate
from ...engine.local_terms import local_columns
from ...engine.modal import respond
from ...engine.problem import Structure
from ...engine.responses import SampledInput
from ...engine.static_gain import local_errors
from ...engine.structures import Candidate
from ...signals.noise_model import coloured_criterion
from ..load import LEAST_LOAD
from .data import Load, SampledData
from .window import WHITE, SampledWindow, left_of

_LASTING = 0.05, 0.95
"""Quantiles of an input between which it moves for longer than a pulse. Of 194 loops beside a load
that drifts eight had a load of three to six times the lasting motion in place of the response to
the set point, and dead times of three to five times the true ones; four had with the range of the
input, none has with these."""
_SIMPLE = Structure(1, 1), Structure(2, 2), Structure(2, 1)
_TIMES = 200  # of a load that are tried in a record, and then every sample about the best


Refit: TypeAlias = Callable[..., SampledWindow]
Whiten: TypeAlias = Callable[[SampledWindow], SampledWindow]


class Lags(NamedTuple):
    """Model that responds to loads, and its numerator."""

    model: Candidate
    numerator: FloatArray

    @classmethod
    def of(cls, part: SampledWindow, model: Candidate) -> Lags:
        """A model of a part, with its numerator there."""
        state = evaluate(part.fit.problem, model.structure, model.parameters[None])
        return cls(model, state.numerator[0])

    def responses(self, data: SampledData) -> list[FloatArray]:
        """Response to a unit step, without dead time, at the outputs of every record."""
        parameters = np.append(0.0, self.model.parameters[1:])
        return [
            respond(
                SampledInput(np.ones(y.size), data.step), data.known, self.numerator, parameters
            )
            for y in data.outputs
        ]


def beside_loads(
    part: SampledWindow, refit: Refit, whiten: Whiten
) -> tuple[SampledWindow, SampledWindow]:
    """Fit records beside a load or two, and the same with the noise made white.

    Of a load that comes and goes neither end alone explains much; what more than two explain is
    another plant, as a hysteresis, which one in each direction imitates. Loads are placed in
    coloured noise, by a model that they hardly change, where the evidence for one is very strong.
    They take the place of what a model lacks, and a step explains some of slow noise: what is left
    beside them must be white. Simple structures tell: without them zeros have taken the place of
    loads.
    Ablation: loads in records of any input.
    """
    if part.fit.correlation <= WHITE:
        return part, part
    white = whiten(part)
    lags = Lags.of(white, white.fit.best)
    load, score = _likeliest(white.data.without_loads, white, lags, [])
    if score <= VERY_STRONG:
        return part, white
    few = [s for s in part.fit.candidates if s in _SIMPLE or s == white.fit.best.structure]
    trial = partial(refit, huber=False)  # which takes half of the time
    first = _again(_beside(part, white, [load], trial, few), trial, few)
    told = _told(part, [first], refit, few)
    if told is None:
        # The noise model of `white` has taken some of two loads for noise, and the poles of `first`
        # some of the second for a response: it is tried where either finds it likeliest.
        seconds = [
            (like, *_placed(like, like, loads))
            for like, loads in ((white, [load]), (first, first.loads))
        ]
        pairs = [
            _beside(part, like, [*placed, another], trial, few)
            for like, placed, another in seconds
            if another is not None
        ]
        told = _told(part, [_again(pair, trial, few) for pair in pairs], refit, few)
    return (part, white) if told is None else (told, told)


def _told(
    part: SampledWindow, ways: Sequence[SampledWindow], refit: Refit, few: Sequence[Structure]
) -> SampledWindow | None:
    """The likeliest of some fits beside loads, with all structures, if it tells them."""
    best, trial = max(ways, key=partial(_excess, part), default=part), partial(refit, huber=False)
    if _excess(part, best) <= 0:
        return None
    best = _again(_needed(best, trial, few), trial, few)
    if _tells(part, best):
        best = _again(best, refit, list(part.fit.candidates))
    return best if _tells(part, best) else None


def _needed(part: SampledWindow, refit: Refit, few: Sequence[Structure]) -> SampledWindow:
    """Leave out all loads but the largest if it explains as much alone."""
    if len(part.loads) < 2:
        return part
    largest = max(part.loads, key=lambda load: abs(load.size))
    alone = _beside(part, part, [largest], refit, few)
    return part if _excess(alone, part) > VERY_STRONG else alone


def _again(part: SampledWindow, refit: Refit, structures: Sequence[Structure]) -> SampledWindow:
    return _beside(part, part, _placed(part, part, part.loads)[0], refit, structures)


def _placed(
    part: SampledWindow, like: SampledWindow, loads: Sequence[Load]
) -> tuple[list[Load], Load | None]:
    return sought(part.data.without_loads, part, Lags.of(like, like.fit.best), loads)


def _beside(
    part: SampledWindow,
    like: SampledWindow,
    loads: Sequence[Load],
    refit: Refit,
    structures: Sequence[Structure],
) -> SampledWindow:
    lags = Lags.of(like, like.fit.best)
    starts = like.fit if set(structures) <= set(like.fit.candidates) else None
    more = refit(with_loads(part.data.without_loads, lags, loads), structures, like=starts)
    loads = sized(more, Lags.of(more, more.fit.best), loads)
    return replace(more, loads=tuple(loads))


def _tells(part: SampledWindow, more: SampledWindow) -> bool:
    sizes = over_motion(more.data, more.loads)
    right = more.fit.correlation <= WHITE and all(LEAST_LOAD < size < 1 for size in sizes)
    return right and _excess(part, more) > VERY_STRONG


def _excess(part: SampledWindow, more: SampledWindow) -> float:
    """Decrease of the criterion by further loads, beyond the charge for them."""
    before, after = (left_of(each, each.fit.best) for each in (part, more))
    return gained(before, after) - charge(after, len(more.loads) - len(part.loads))


def over_motion(data: SampledData, loads: Sequence[Load]) -> list[float]:
    """Sizes of loads over the motion of the input of their record, but for short pulses.

    A controller answers a load by its opposite, for as long as the load stays: one that is larger
    than the motion takes the place of a response to that.
    """
    motions = [float(np.ptp(np.quantile(u, _LASTING))) for u in data.inputs]
    return [abs(load.size) / max(motions[load.record], SMALLEST) for load in loads]


def charge(errors: Sequence[FloatArray], loads: int = 1) -> float:
    """Charge for the times and sizes of loads, of what is left of records."""
    return 2 * loads * float(np.log(sum(error.size for error in errors)))


def gained(before: Sequence[FloatArray], after: Sequence[FloatArray]) -> float:
    """Decrease of the criterion of what is left of the records."""
    count = min(error.size for error in (*before, *after))
    return unlikely(before, count) - unlikely(after, count)


def unlikely(errors: Sequence[FloatArray], count: int) -> float:
    """Criterion of the last samples that are left of every record, with noise of their own."""
    return coloured_criterion([error[-count:] for error in errors])[0]


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
