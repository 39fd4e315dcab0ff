"""Find a step of a load that moved the output during a step test.

The output is modelled with and without the response to one step of a load, at an unknown time and
through a lag of its own, or through the plant itself. With it there are three parameters more:
time, lag and size. Compared are the criteria [1]_ of the maximum likelihood with autoregressive
noise of first order, so that slow noise is no load; where this leaves neighbours alike, which a
misfit does, fewer of them count.

A score test [2]_ on the fits without load comes first: it needs no further fit. Only where it finds
something are time and lag determined with dynamics and dead time: by a scan over all times and lags
about the parameters of several plants, a fit of the plant for the best of them, and steps of Gauss
and Newton's method in all parameters. The model has, with the response to the load, its changes for
another time and another lag: their errors are then part of those of gain and dead time.

Ablation: load during the test.

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [2] C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters with
   applications to problems of estimation, Proc. Cambridge Phil. Soc. 44 (1948) 50-57,
   doi:10.1017/S0305004100023987.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..arrays import FloatArray
from ..constants import OUTLIER, SMALLEST, VERY_STRONG
from ..engine.descend import descend, fit_batch
from ..engine.eliminate import eliminate, evaluate
from ..engine.modal import partial_fractions
from ..engine.problem import Problem, Structure
from ..engine.static_gain import local_errors
from ..engine.structures import (
    SIMPLE_STRUCTURES,
    Candidate,
    needless_parameters,
    parameter_bounds,
    pattern_starts,
)
from ..engine.window_fit import WindowFit
from ..rules import Rule
from ..signals.load_step import LoadStep
from ..signals.noise import correlation_time, mad_sigma
from .step_data import StepData, stop_at

_PARAMETERS = 3  # time, lag and size
LEAST_LOAD, _MOST_LAG = 0.03, 2.0
"""Part of a response from which on a load is one, and its longest lag, over what is left of the
record: slower ones are drifts."""
IN_SLOW_NOISE, _MOST_LEFT = 3 * VERY_STRONG, 0.75
"""Decrease of the criterion for a load where the residual is correlated, and the part of that which
one that is told apart may leave (0.92 beside friction, 0.1 to 0.72 beside a load): AR(1) noise with
a pole at 0.9 reached 20 in 1 of 60 simulated records, and more than 30 in 3 of 60 others, whose
gain is left open; a measured heater 28 and a measured arm 26; white noise stayed below -3. Loads of
10 to 80 % mostly reached 30 to 900."""
_SOONEST, _TOLD_APART = 0.5, 1.5
"""Time between step and load, over the time to 63 % of the response, from which on one is looked
for, and from which on they are told apart: the gain of 49 of 53 simulated records, some of which
clip, was within 5 % or its interval, and one of the others called good; below 1.5, of 3 of 4. An
earlier load, as too few poles look, leaves the model as it is, and the gain open."""
_FIRST, _LAST = 0.25, 0.02  # of the rise, and of the record, in which a load is not looked for
_TIMES, _LAGS = 60, np.geomspace(0.05, 10.0, 8)
"""Times of a load that are tried, at most about that many, and its lags over the rise."""
_FEWEST_TIMES = 3  # between which a load is placed
_RICH = 4
"""Poles of a model that with zeros may have taken a load up. About others the score test lowered
the criterion for each of 62 simulated loads of 10 to 80 %, and in 3 of 48 records of white noise
alone."""
_SIMPLE = 3
"""Poles of the structures that are scanned beside the best one, with one zero at most."""
_FOLLOWED = Structure(2, 2), Structure(3, 2), Structure(3, 3)
"""Those of them that are followed: their evidence was the best of all, or within a tenth of it, for
16 of 16 simulated loads. Without two lags alone, a zero took up part of a load in 3 of 30, and
gains were off by 15 %."""
_PARTS = 5
"""Plants that a load is looked for about: of all samples, and of as many parts of the record before
the last. The best load was found in 75 of 76 records, about that of all samples alone in 67."""
_ROUGH = 1e-2
"""Part of the cost by which the last iteration of a fit lowers it, until the criterion has become
lower, and one of two steps of Gauss and Newton: all but one of 171 simulated loads and 46 measured
records had the same verdict as with 2e-4 and 1e-3, which takes 1.6 times as long."""
_FLOOR = 0.1  # of the noise, below which a residual is rounding

_roughly = partial(fit_batch, tolerance=_ROUGH)


def load_of(
    data: StepData,
    fits: WindowFit,
    refit: Callable[..., WindowFit],
    free: Callable[[], WindowFit],
    is_noise: Callable[[StepData, WindowFit, Candidate], bool],
) -> tuple[LoadStep, FloatArray] | None:
    """Find a step of a load that moved the output as well.

    The residual must be at noise level with it: a load takes the place of what a model lacks, and
    cannot be told beside a misfit. None is looked for beside a free response.

    Parameters
    ----------
    data : StepData
    fits : WindowFit
        Without load.
    refit : callable
        Fit of the data up to a sample by some structures.
    free : callable
        Fit of the default structures without load.
    is_noise : callable
        Whether the residual of a candidate is at noise level.

    Returns
    -------
    tuple of LoadStep and ndarray, shape (N,), or None
        The load, and its part of the output; None if the evidence is not very strong.
    """
    # Of few structures none may be right.
    few = len(fits.candidates) < len(SIMPLE_STRUCTURES)
    if few and (not is_noise(data, fits, fits.best) or _suspects(data, fits)):
        fits = free()
    times = _times(data, fits)
    suspects = [one for one in _suspects(data, fits) if Rule.LOAD.on]
    followed = [_followed(fits, one, data.clock, times) for one in suspects]
    promising = [one for one in followed if _judged(fits, *one, data.clock)[0] > 0]
    if not promising:
        return None
    closely = partial(descend, dt=data.dt)
    found = [_together(fits, *one, data.clock, times, closely) for one in promising]
    judged = [_judged(fits, *one, data.clock) for one in found]
    evidence, load, part = max(judged, key=lambda one: one[0])
    loaded = data.with_load(load, part)
    edges = data.dt * np.array([index for index, _ in data.edges])
    rise = float(data.clock[min(stop_at(loaded, 0.63), data.rows.size - 1)] - edges[0])
    since, apart = load.time - float(edges[edges <= load.time].max()), _TOLD_APART * rise
    # Several poles are those of the plant, through which a load may come however slow it is.
    slowest = load.lag / abs(load.poles[0]) if load.poles.size == 1 else 0.0
    # Rounding moves a level by up to one step of a coarse converter, and noise with it by another:
    # four of ten 2 % steps of `bench.heater` had such a load.
    motion, least = loaded.motion, 2 * data.quantum if data.coarse else 0.0
    small = motion is None or abs(load.size) < max(LEAST_LOAD * motion.span, least)
    if small or since < _SOONEST * rise or slowest > _MOST_LAG * (data.clock[-1] - load.time):
        return None
    also = refit(loaded, data.output.size, tuple(fits.candidates))
    white, left = also.correlation == 1.0, (also.normalized_rms / fits.normalized_rms) ** 2
    own = _evidence(fits, also.residual(also.best), also.best.structure)
    told = max(evidence, own) > (VERY_STRONG if white else IN_SLOW_NOISE)
    if not told or not is_noise(loaded, also, also.best):
        return None
    early = since < apart or not (white or left < _MOST_LEFT)
    return replace(load, early=early), part


def _evidence(fits: WindowFit, error: FloatArray, structure: Structure) -> float:
    """Decrease of the criterion for a model with a load of a given structure and residual (N,)."""
    own = fits.best.structure
    before, after = _innovations(fits.residual(fits.best)), _innovations(error)
    # Not of the residuals, of which the larger one would become constant.
    limit = OUTLIER * max(mad_sigma(before), mad_sigma(after), SMALLEST)
    before, after = (np.clip(new, -limit, limit) for new in (before, after))
    floor = error.size * (_FLOOR * fits.sigma) ** 2
    count = error.size / correlation_time(after)
    left = max(float(after @ after) + floor, SMALLEST)
    gained = count * np.log((float(before @ before) + floor) / left)
    more = structure.order + structure.zeros + _PARAMETERS - own.order - own.zeros
    charge = np.log(max(count, 3.0)) * more + needless_parameters(structure)
    return float(gained - charge + needless_parameters(own))


def _innovations(error: FloatArray) -> FloatArray:
    """What neighbours do not tell of a residual (N,), of autoregressive noise of first order."""
    along = float(error[1:] @ error[:-1]) / max(float(error @ error), SMALLEST)
    return np.append(np.sqrt(max(1 - along**2, 0.0)) * error[0], error[1:] - along * error[:-1])


def _suspects(data: StepData, fits: WindowFit) -> list[Candidate]:
    """Score test: models about which a load would lower the criterion; none if it is noise."""
    times = _times(data, fits)
    if fits.problem.segments is not None or times.size < _FEWEST_TIMES:
        return []
    best, problem = fits.best, fits.window.problem
    plain = float(evaluate(problem, best.structure, best.parameters[None]).cost[0])
    tried = [s for s in fits.candidates if s.zeros <= 1 and s.order <= _SIMPLE]
    found = []
    for s in dict.fromkeys((*tried, best.structure)):
        left, _ = _scan(fits, fits.candidates[s], data.clock, times)
        freedom = max(problem.data.size - 2 - s.order - s.zeros - _PARAMETERS, 1)
        gained = (plain - left) / max(left / freedom, (data.sigma * data.colour) ** 2, SMALLEST)
        charge = _charge(fits, s) + fits.penalty * _PARAMETERS - _charge(fits, best.structure)
        found.append((gained - charge, fits.candidates[s]))
    rich = best.structure.order >= _RICH and best.structure.zeros > 0
    if max(value for value, _ in found) < 0 and not rich:
        return []
    followed = [fits.candidates[s] for s in _FOLLOWED if s in fits.candidates]
    return followed or [candidate for _, candidate in found]


def _charge(fits: WindowFit, s: Structure) -> float:
    return fits.penalty * (s.order + s.zeros) + needless_parameters(s)


def _times(data: StepData, fits: WindowFit) -> FloatArray:
    """Times of a load that are tried."""
    start = data.edges[0][0] * data.dt + fits.scales.onset + _FIRST * fits.scales.rise
    middle = _on_bins(fits, data.clock[:, None])[:, 0]
    times = middle[(middle >= start) & (middle <= data.clock[-1] - _LAST * data.length)]
    return np.asarray(times[:: max(times.size // _TIMES, 1)])


def _on_bins(fits: WindowFit, columns: FloatArray) -> FloatArray:
    bins = fits.window.bins
    return columns if bins is None else bins.average(columns)


def _scan(
    fits: WindowFit, candidate: Candidate, clock: FloatArray, times: FloatArray
) -> tuple[float, LoadStep]:
    """Sum of squares, and the load with it, that are best about the parameters of a plant.

    Linear in all else: dead time, poles, numerator, level and size of the load. Huber's data are
    those of the model without load.
    """
    p = fits.window.problem
    numerator = eliminate(p, candidate.structure, candidate.parameters[None]).numerator[0]
    errors = local_errors(p, candidate, numerator, fits.scales.length)
    middle = _on_bins(fits, clock[:, None])[:, 0]
    # A load faster than a bin differs from a jump there alone.
    width = np.interp(times, middle[1:], np.diff(middle))
    shapes = [LoadStep(0.0, float(lag)) for lag in fits.scales.rise * _LAGS]
    shapes.append(_through_the_plant(fits, candidate, p))
    lags = np.maximum(np.array([[shape.lag] for shape in shapes]), width)
    since = np.maximum(middle[:, None] - times, 0.0)
    tried = [shape.response(since / lag) for shape, lag in zip(shapes, lags, strict=True)]
    gained = errors.lowered(p.weighted_data, p.weighted(np.hstack(tried)))
    shape, at = divmod(int(np.argmax(gained)), times.size)
    found = replace(shapes[shape], time=float(times[at]), lag=float(lags[shape, at]))
    left = errors.without(p.weighted_data[:, None])
    return float(np.sum(left**2) - gained.max()), found


def _through_the_plant(fits: WindowFit, candidate: Candidate, problem: Problem) -> LoadStep:
    """LoadStep at the input of the plant, behind its dead time, with a gain of one.

    The numerator is that of the problem.
    """
    numerator = eliminate(problem, candidate.structure, candidate.parameters[None]).numerator[0]
    poles, unit = candidate.poles, fits.scales.rise
    residues = partial_fractions(poles[None], np.ones(1), numerator.size)[0][0] @ numerator
    gain = max(float(np.abs(numerator[0] / np.prod(-poles))), SMALLEST)
    return LoadStep(0.0, unit, poles * unit, residues * poles * unit / gain)


def _beside(fits: WindowFit, load: LoadStep, clock: FloatArray, count: int = 1) -> Problem:
    """The problem with the response to a load; with 3, also with its changes."""
    columns = load.columns(clock)[:, :count]
    p = fits.window.problem
    return replace(p, regressors=np.concatenate([p.regressors, _on_bins(fits, columns)], axis=1))


def _followed(
    fits: WindowFit, candidate: Candidate, clock: FloatArray, times: FloatArray
) -> tuple[LoadStep, Candidate]:
    """Determine load and plant from one of several plants, and at last together, roughly.

    Of all samples a plant takes up some of the load, of the first ones it does not.
    """
    structure, p = candidate.structure, fits.window.problem
    first = pattern_starts(structure, fits.scales)
    middle = _on_bins(fits, clock[:, None])[:, 0]
    plants, starts = [candidate], [candidate.parameters, *first]
    for k in range(1, _PARTS):
        stop = times[k * times.size // _PARTS]
        begun = replace(p, root_weight=np.where(middle <= stop, p.root_weight, 0.0))
        plants.append(_fitted(fits, structure, starts, begun))
        starts = [candidate.parameters, plants[-1].parameters, first[0]]
    scans = [(*_scan(fits, plant, clock, times), plant) for plant in plants]
    _, load, candidate = min(scans, key=lambda scan: scan[0])
    starts = [candidate.parameters, first[0]]
    own = _beside(fits, load, clock)
    candidate = _fitted(fits, structure, starts, own)
    other = replace(_through_the_plant(fits, candidate, own), time=load.time)
    found = [_together(fits, one, candidate, clock, times) for one in (load, other)]
    return min(found, key=lambda one: one[1].cost)


def _judged(
    fits: WindowFit, load: LoadStep, candidate: Candidate, clock: FloatArray
) -> tuple[float, LoadStep, FloatArray]:
    """Decrease of the criterion by a load, the load with its size, and its part (N,)."""
    structure = candidate.structure
    own, column = _beside(fits, load, clock), load.columns(clock)[:, :1]
    part = column[:, 0] * evaluate(own, structure, candidate.parameters[None]).regression[0, -1]
    window = replace(fits.window, columns=np.concatenate([fits.window.columns, column], axis=1))
    error = window.output - window.predict(own, candidate)
    return _evidence(fits, error, structure), replace(load, size=float(part[-1])), part


def _together(
    fits: WindowFit,
    load: LoadStep,
    candidate: Candidate,
    clock: FloatArray,
    times: FloatArray,
    search: Callable[..., tuple[FloatArray, FloatArray]] = _roughly,
) -> tuple[LoadStep, Candidate]:
    """Lower the cost over plant, time and lag of a load by Gauss and Newton's method.

    The weights of its response and of the changes for another time and lag tell the step. A load
    through the plant has the poles that the plant has at last. The misfit may rise in between.
    """
    own = _beside(fits, load, clock)
    candidate = _fitted(fits, candidate.structure, [candidate.parameters], own, search)
    best, failed = (load, candidate), 0
    while failed < 2:
        own = _beside(fits, load, clock, 3)
        near = _fitted(fits, candidate.structure, [candidate.parameters], own, search)
        weights = evaluate(own, near.structure, near.parameters[None]).regression
        step = -weights[0, -2:] / (weights[0, -3] or SMALLEST)  # of time and lag, by the size
        later, longer = step / max(np.abs(step).max(), 1.0)
        time = np.clip(load.time + load.lag * later, times[0], times[-1])
        shape = load if load.poles.size == 1 else _through_the_plant(fits, near, own)
        load = replace(shape, time=float(time), lag=float(load.lag * np.exp(longer)))
        starts = [best[1].parameters, near.parameters]
        candidate = _fitted(fits, near.structure, starts, _beside(fits, load, clock), search)
        failed = 0 if candidate.cost < (1 - _ROUGH) * best[1].cost else failed + 1
        best = min(best, (load, candidate), key=lambda one: one[1].cost)
    return best


def _fitted(
    fits: WindowFit,
    structure: Structure,
    starts: Sequence[FloatArray],
    problem: Problem,
    search: Callable[..., tuple[FloatArray, FloatArray]] = _roughly,
) -> Candidate:
    """Best fit of a structure to a problem."""
    bounds = parameter_bounds(structure, fits.scales)
    x, cost = search(problem, structure, np.array(starts), bounds)
    return Candidate(structure, x[int(np.argmin(cost))], float(cost.min()))
