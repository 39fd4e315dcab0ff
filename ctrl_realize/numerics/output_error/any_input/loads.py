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
from .window import SampledWindow, left_of

WHITE = 3.0
"""Correlation time of the residual, in samples, up to which a model is taken for right: twice what
white noise scatters to."""
_MOST = 2
"""Loads of records without feedback: what more of them explain is another plant, as a hysteresis,
which one in each direction imitates."""
_LASTING = 0.05, 0.95
"""Quantiles of an input between which it moves for longer than a pulse. Of 194 loops beside a load
that drifts eight had a load of three to six times the lasting motion in place of the response to
the set point, and dead times of three to five times the true ones; four had with the range of the
input, none has with these."""
_SIMPLE = Structure(1, 1), Structure(2, 2), Structure(2, 1)
_TIMES = 200  # of a load that are tried in a record, and then every sample about the best


Refit: TypeAlias = Callable[..., SampledWindow]
Whiten: TypeAlias = Callable[[SampledWindow, Sequence[Structure]], SampledWindow]


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

    Of a load that comes and goes neither end alone explains much. Loads are placed in coloured
    noise, by a model that they hardly change, where the evidence for one is very strong. They take
    the place of what a model lacks, and a step explains some of slow noise: what is left beside
    them must be white. Simple structures tell: without them zeros have taken the place of loads.
    Ablation: loads in records of any input.
    """
    if part.fit.correlation <= WHITE:
        return part, part
    every = list(part.fit.candidates)
    white = whiten(part, every)
    lags = Lags.of(white, white.fit.best)
    _, score = _likeliest(part.data.without_loads, white, lags, [])
    if score <= VERY_STRONG:
        return part, white
    few = [s for s in every if s in _SIMPLE or s == white.fit.best.structure]
    for loads in range(1, _MOST + 1):
        more = _beside_some(part, white, refit, few, loads)
        if more is not None and _tells(part, more):
            more = _again(more, refit, every)
            if _tells(part, more):
                return more, more
    return part, white


def _beside_some(
    part: SampledWindow, white: SampledWindow, refit: Refit, few: Sequence[Structure], loads: int
) -> SampledWindow | None:
    """Fit beside the likeliest loads, if they are worth their parameters.

    They are tried at two places, as the noise model of `white` has taken some of a load for noise,
    and the poles of `part` some for a response: where either finds them likeliest.
    """
    found: list[Load] = []
    more, model = part, white
    for _ in range(loads):
        found, another = _placed(white, white, found)
        if another is None:
            return None
        found.append(another)
        placed, another = _placed(more, model, more.loads)
        if another is None:
            return None
        more = model = _beside(more, model, [*placed, another], refit, few)
    ways = [_again(each, refit, few) for each in (_beside(part, white, found, refit, few), more)]
    more = max(ways, key=partial(_excess, part))
    if _excess(part, more) <= 0:
        return None
    if loads > 1:
        largest = max(more.loads, key=lambda load: abs(load.size))
        alone = _beside(more, more, [largest], refit, few)
        more = more if _excess(alone, more) > VERY_STRONG else alone
    return _again(more, refit, few)


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
    motions = _motions(more.data)
    large = all(abs(load.size) > LEAST_LOAD * motions[load.record] for load in more.loads)
    right = large and within_motion(more.data, more.loads) and more.fit.correlation <= WHITE
    return right and _excess(part, more) > VERY_STRONG


def _excess(part: SampledWindow, more: SampledWindow) -> float:
    """Decrease of the criterion by further loads, beyond the charge for them."""
    before, after = (left_of(each, each.fit.best) for each in (part, more))
    return gained(before, after) - charge(after, len(more.loads) - len(part.loads))


def within_motion(data: SampledData, loads: Sequence[Load]) -> bool:
    """Whether loads are smaller than the motion of the input, but for short pulses.

    A controller answers a load by its opposite, for as long as the load stays: a larger one takes
    the place of a response to that.
    """
    motions = _motions(data)
    return all(abs(load.size) < motions[load.record] for load in loads)


def _motions(data: SampledData) -> list[float]:
    return [float(np.ptp(np.quantile(u, _LASTING))) for u in data.inputs]


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
