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

from ..arrays import FloatArray
from ..constants import VERY_STRONG
from ..engine.problem import Structure
from ..engine.structures import (
    LEAST_CHARGE,
    Candidate,
    Scales,
    needless_parameters,
    parameter_charge,
)
from ..engine.structures import search as search_linear
from ..signals.noise import correlation_time, mad_sigma
from .commands import knots
from .family import ActuatedFamily, Member
from .intervals import Ends, profiled
from .motions import Kind, Place
from .records import ActuatedRecord, Records
from .search import cost_of, searched, with_other_lags

LINEAR = tuple(Structure(n, r) for n, r in ((1, 1), (2, 2), (3, 3), (4, 4), (2, 1), (3, 2)))
LAGS = (1, 2, 3)
"""Numbers of lags with an actuator: it takes the place of a lag or a zero."""
_HOPELESS = 100.0
"""Variances by which a kind with its first number of lags may be above the best model, for other
numbers to be tried: time."""
_WILD = 4.0  # standard deviations beyond which samples are outliers, and cut
_SPIKE = 3  # samples in a row: more are a slip that the model has at another time
_FEW_SPIKES = 2e-3  # of the samples, which noise has as well
_MOST = 3  # other models whose dead times are profiled: time


@dataclass(frozen=True, eq=False)
class ActuatedFit:
    """The best model with an actuator, beside the best linear one.

    Attributes
    ----------
    member : Member
    evidence : float
        Criterion of the best linear model minus that of the member; more than 10 is very strong.
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

    member: Member
    evidence: float
    ends: tuple[Ends, ...]
    records: Records
    residual: FloatArray
    correlation: float
    variance: float

    @property
    def chosen(self) -> bool:
        """Whether the evidence against every linear model is very strong."""
        return self.evidence > VERY_STRONG


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
    linear = search_linear(records.problem, LINEAR, scales)
    found = _with_actuators(records, scales, wanted, orders, linear)
    residual = _residual(found)
    spikes = _spikes(residual, _WILD * mad_sigma(residual))
    if np.mean(spikes != 0) > _FEW_SPIKES:
        records = records.with_outputs(records.output - spikes)
        linear = search_linear(records.problem, LINEAR, scales)
        found = [replace(one.family, records=records).improved(one.x) for one in found]
        residual = _residual(found)
    correlation = correlation_time(residual[: max(part.rows.size for part in records.parts)])
    free = max(residual.size - found[0].parameters - records.regressors.shape[1], 1)
    variance = max(float(residual @ residual) / free, 1e-300) * correlation
    charge = max(parameter_charge(residual.size / correlation), LEAST_CHARGE)

    def criterion(cost: float, structure: Structure, parameters: int) -> float:
        return float(cost / variance + charge * parameters) + needless_parameters(structure)

    def value(one: Member) -> float:
        return criterion(one.cost, one.family.structure, one.parameters)

    straight = min(criterion(c.cost, s, s.order + s.zeros + 2) for s, c in linear.items())
    tried = {one.family.kind for one in found}

    def judged(one: Member) -> float:
        # One that contains a simpler one only where the evidence is very strong.
        return value(one) + VERY_STRONG * (not tried.isdisjoint(one.family.properties.extends))

    chosen = min(found, key=judged)
    member, ends = profiled(chosen, variance)
    # Lags that fit no worse are not ruled out: noise hides lags, and does not remove them.
    near = [
        one
        for one in sorted(found, key=value)
        if one is not chosen
        and min(value(one) - value(chosen), (one.cost - chosen.cost) / variance) <= VERY_STRONG
    ]
    every = [ends]
    for one in near[:_MOST]:
        same = (one.family.kind, one.family.place) == (member.family.kind, member.family.place)
        every.append(profiled(one, variance, dead_time_alone=not same)[1])
    unions = ([each[i] for each in every if len(each) > i] for i in range(len(ends)))
    whole = Records(tuple(parts))
    return ActuatedFit(
        member=member,
        evidence=float(straight - value(member)),
        ends=tuple(
            Ends(min(lows), max(highs))
            for lows, highs in (zip(*each, strict=True) for each in unions)
        ),
        records=whole,
        residual=replace(member.family, records=whole).residuals(member.x[None])[0][0],
        correlation=correlation,
        variance=variance,
    )


def _with_actuators(
    records: Records,
    scales: Scales,
    wanted: Sequence[tuple[Kind, Place]],
    orders: Sequence[int],
    linear: Mapping[Structure, Candidate],
) -> list[Member]:
    """Best members of every kind: one number of lags finds the actuator for all."""
    levels = knots(records.parts)
    first = sorted(orders)[min(1, len(orders) - 1)]
    minima = [
        searched(ActuatedFamily(records, scales, first, kind, place, levels), linear)
        for kind, place in wanted
    ]
    residual = _residual([each[0] for each in minima])
    limit = 1 + _HOPELESS * correlation_time(residual) / residual.size
    found = []
    for base, *others in minima:
        found += [base, *others]
        if base.cost > limit * float(residual @ residual):
            continue
        members = with_other_lags(base, orders)
        best = min(members, key=cost_of)
        if orders == LAGS and best.family.order == LAGS[-1]:
            # One lag more than chosen is never ruled out.
            members += with_other_lags(best, [LAGS[-1] + 1])[1:]
        found += members[1:]
    return found


def _residual(found: Sequence[Member]) -> FloatArray:
    """Residual (M,) of the closest of some models."""
    best = min(found, key=cost_of)
    return np.asarray(best.family.residuals(best.x[None])[0][0])


def _spikes(residual: FloatArray, limit: float) -> FloatArray:
    """What is beyond a limit (M,), where it is few samples in a row."""
    beyond = np.abs(residual) > limit
    edges = np.flatnonzero(np.diff(beyond.astype(np.int64), prepend=0, append=0))
    found = np.zeros(residual.size)
    for first, end in edges.reshape(-1, 2).tolist():
        if end - first <= _SPIKE:
            found[first:end] = residual[first:end] - np.clip(residual[first:end], -limit, limit)
    return found
