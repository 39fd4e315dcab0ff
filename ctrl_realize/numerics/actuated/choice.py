"""Choose between linear models and models with an actuator, by the criterion of the structures.

BIC [1]_ with the charges of `structures` for zeros and for poles beyond the third; an actuator is
chosen where the evidence for it is very strong ([2]_, section 3.2), as that which rules out a
structure.

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray, runs
from ..constants import OUTLIER, SMALLEST, VERY_STRONG
from ..engine.problem import Problem, Structure
from ..engine.structures import (
    Candidate,
    Scales,
    charged,
    choose,
    criteria,
    needless_parameters,
    parameter_charge,
    plausible,
)
from ..engine.structures import search as search_linear
from ..signals.noise import correlation_time, mad_sigma
from .commands import knots
from .family import actuated_family
from .intervals import Ends, profiled
from .motions import Kind, Place
from .records import ActuatedRecord, Records
from .search import cost_of, family_of, minimum, searched, with_other_lags

LINEAR = tuple(Structure(n, r) for n, r in ((1, 1), (2, 2), (3, 3), (4, 4), (2, 1), (3, 2)))
LAGS = (1, 2, 3)
"""Numbers of lags with an actuator: it takes the place of a lag or a zero."""
_HOPELESS = 100.0
"""Variances by which a kind with its first number of lags may be above the best model, for other
numbers to be tried: time."""
_SPIKE = 3  # samples in a row: more are a slip that the model has at another time
_FEW_SPIKES = 2e-3  # of the samples, which noise has as well
_MOST = 3  # other models whose dead times are profiled: time


@dataclass(frozen=True, eq=False)
class ActuatedFit:
    """The best model with an actuator, beside the best linear one.

    Attributes
    ----------
    best : Candidate
    problem : Problem
        That it fits: of a long record, of means over blocks.
    evidence : float
        Criterion of the best linear model minus that of the best; more than 10 is very strong.
    ends : tuple of Ends
        95 % interval of the dead time in s, for all models with an actuator that are not ruled out,
        and of the values of the actuator, for all numbers of lags.
    records : Records
        With all their samples.
    residual : ndarray, shape (M,)
        At all of them.
    correlation : float
        Samples of the residual that count as one.
    variance : float
        That counts in the likelihood.
    """

    best: Candidate
    problem: Problem
    evidence: float
    ends: tuple[Ends, ...]
    records: Records
    residual: FloatArray
    correlation: float
    variance: float


def fit_actuated(
    parts: Sequence[ActuatedRecord],
    scales: Scales,
    wanted: Sequence[tuple[Kind, Place]],
    structures: Sequence[Structure] | None = None,
) -> ActuatedFit | None:
    """Fit linear models and models with an actuator to the same records.

    Parameters
    ----------
    parts : sequence of ActuatedRecord
    scales : Scales
        Initial guess of the response.
    wanted : sequence of (kind, place)
        Actuators to try.
    structures : sequence of Structure, optional
        Of the linear part behind (or before) an actuator; those with zeros are not tried.

    Returns
    -------
    ActuatedFit or None
        None if there is nothing to fit.
    """
    records = Records(tuple(part.thinned() for part in parts))
    orders = LAGS if structures is None else tuple(s.order for s in structures if s.zeros == 0)
    if not wanted or not orders:
        return None
    problem = records.problem
    linear = search_linear(problem, LINEAR, scales)
    found = _with_actuators(records, scales, wanted, orders, linear)
    residual = _residual(problem, found)
    spikes = _spikes(residual, OUTLIER * mad_sigma(residual))
    if np.mean(spikes != 0) > _FEW_SPIKES:
        problem = replace(problem, data=problem.data - spikes)
        linear = search_linear(problem, LINEAR, scales)
        found = [minimum(problem, family_of(one), one.parameters[None]) for one in found]
        residual = _residual(problem, found)
    correlation = correlation_time(residual[: max(part.rows.size for part in records.parts)])
    counted = found[0].structure.free + 2 + problem.regressors.shape[1]
    noise = float(residual @ residual) / max(residual.size - counted, 1)
    variance, samples = max(noise, SMALLEST) * correlation, residual.size / correlation

    def value(candidates: dict[Structure, Candidate]) -> dict[Structure, float]:
        return charged(criteria(candidates, variance, samples), parameter_charge(samples))

    def chosen_of(members: dict[Structure, Candidate]) -> Candidate:
        # One that contains a simpler one only where the evidence is very strong.
        tried = {family_of(one).kind for one in members.values()}
        extends = {s: family_of(one).properties.extends for s, one in members.items()}
        more = {s: VERY_STRONG * (not tried.isdisjoint(extends[s])) for s in members}
        return members[choose({s: each + more[s] for s, each in value(members).items()})]

    members = {one.structure: one for one in found}
    chosen = chosen_of(members)
    if structures is None and chosen.structure.order == LAGS[-1]:
        # One lag more than chosen is never ruled out.
        more = with_other_lags(problem, chosen, [LAGS[-1] + 1])[LAGS[-1] + 1]
        members[more.structure] = more
        chosen = chosen_of(members)
    values, straight = value(members), value(linear)
    level = values[chosen.structure] + needless_parameters(chosen.structure)
    best, ends = profiled(problem, chosen, variance)
    every, family = [ends], family_of(best)
    near = [members[s] for s in plausible(members, values, variance, chosen, level)]
    near = sorted((one for one in near if one is not chosen), key=lambda one: values[one.structure])
    for one in near[:_MOST]:
        other = family_of(one)
        same = (other.kind, other.place) == (family.kind, family.place)
        every.append(profiled(problem, one, variance, dead_time_alone=not same)[1])
    unions = ([each[i] for each in every if len(each) > i] for i in range(len(ends)))
    whole = Records(tuple(parts))
    linear_level = min(straight[s] + needless_parameters(s) for s in straight)
    return ActuatedFit(
        best=best,
        problem=problem,
        evidence=linear_level - level + (chosen.cost - best.cost) / variance,
        ends=tuple(
            Ends(min(lows), max(highs))
            for lows, highs in (zip(*each, strict=True) for each in unions)
        ),
        records=whole,
        residual=_residual(
            whole.problem, [replace(best, structure=replace(family, records=whole))]
        ),
        correlation=correlation,
        variance=variance,
    )


def _with_actuators(
    records: Records,
    scales: Scales,
    wanted: Sequence[tuple[Kind, Place]],
    orders: Sequence[int],
    linear: Mapping[Structure, Candidate],
) -> list[Candidate]:
    """Best members of every kind: two lags find the actuator for all, asked for or not."""
    levels, problem = knots(records.parts), records.problem
    minima = [
        searched(problem, actuated_family(records, scales, LAGS[1], kind, place, levels), linear)
        for kind, place in wanted
    ]
    residual = _residual(problem, [each[0] for each in minima])
    limit = 1 + _HOPELESS * correlation_time(residual) / residual.size
    found = []
    for base, *others in minima:
        found += [base, *others] if LAGS[1] in orders else []
        if base.cost > limit * float(residual @ residual):
            continue
        members = with_other_lags(problem, base, orders)
        found += [one for one in members.values() if one is not base]
    return found


def _residual(problem: Problem, found: Sequence[Candidate]) -> FloatArray:
    """Residual (M,) of the closest of some models."""
    best = min(found, key=cost_of)
    return np.asarray(family_of(best).evaluate(problem, best.parameters[None]).residual[0])


def _spikes(residual: FloatArray, limit: float) -> FloatArray:
    """What is beyond a limit (M,), where it is few samples in a row."""
    found = np.zeros(residual.size)
    for first, end in zip(*runs(np.abs(residual) > limit), strict=True):
        if end - first <= _SPIKE:
            found[first:end] = residual[first:end] - np.clip(residual[first:end], -limit, limit)
    return found
