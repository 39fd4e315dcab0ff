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
from dataclasses import dataclass

import numpy as np

from ..arrays import BoolArray, ComplexArray, FloatArray
from ..constants import Z_95
from ..engine.poles import poles_from_parameters
from ..engine.structures import (
    LEAST_CHARGE,
    PLAUSIBLE,
    Scales,
    needless_parameters,
    parameter_charge,
)
from ..engine.varpro import Structure
from ..signals.noise import correlation_time, mad_sigma
from .commands import knots
from .family import Family, Member, Records, Task
from .intervals import Ends, dead_time_ends, profiled
from .kinds import FORMS, Kind, Place
from .records import ActuatedRecord
from .search import searched, with_other_lags

LINEAR = tuple(Structure(n, r) for n, r in ((1, 1), (2, 2), (3, 3), (4, 4), (2, 1), (3, 2)))
BEHIND = (Structure(1, 1), Structure(2, 2), Structure(3, 3))
"""Structures with an actuator: it takes the place of a lag or a zero."""
ONE_MORE = Structure(4, 4)  # beside three lags: one lag more than chosen is never ruled out
_WILD = 4.0  # standard deviations beyond which samples are outliers, and cut
_SPIKE = 3  # samples in a row: more are a slip that the model has at another time
_MOST_PROFILES = 4  # of the dead time, for time


@dataclass(frozen=True, eq=False)
class Rival:
    """A linear model that was fitted to one record before: residual (N,), and parameters."""

    residual: FloatArray
    structure: Structure


@dataclass(frozen=True, eq=False)
class ActuatedFit:
    """The best model with an actuator, beside the best linear one.

    Attributes
    ----------
    member : Member
    coefficients : ndarray, shape (1 + zeros,)
        Gain, and gain times lead.
    evidence : float
        Criterion of the best linear model minus that of the member; more than 10 is very strong.
    dead_time_ends : Ends
        95 % interval in s, for all models with an actuator that are not ruled out.
    std : float
        Standard error of the dead time.
    value_ends : tuple of Ends
        95 % intervals of the values of the actuator, for all orders that are not ruled out.
    fitted : tuple of ndarray
        Output of the model at every sample of each record.
    sigma, correlation : float
        Standard deviation of the residual, and its samples that count as one.
    variance : float
        That counts in the likelihood.
    alternatives : tuple of (Family, float)
        Criteria relative to that of the member, best first.
    """

    task: Task
    member: Member
    coefficients: FloatArray
    evidence: float
    dead_time_ends: Ends
    std: float
    value_ends: tuple[Ends, ...]
    fitted: tuple[FloatArray, ...]
    sigma: float
    correlation: float
    variance: float
    alternatives: tuple[tuple[Family, float], ...]

    @property
    def chosen(self) -> bool:
        """Whether the evidence against every linear model is very strong."""
        return self.evidence > PLAUSIBLE

    @property
    def poles(self) -> ComplexArray:
        """Poles in 1/s."""
        return np.asarray(poles_from_parameters(self.member.theta[None])[0][0])

    @property
    def numerator(self) -> FloatArray:
        """Numerator over the monic denominator, lowest power first."""
        return np.asarray(self.coefficients * np.prod(-self.poles).real)


def fit_actuated(
    parts: Sequence[ActuatedRecord],
    scales: Scales,
    wanted: Sequence[tuple[Kind, Place]],
    *,
    rivals: Sequence[Rival] = (),
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
    rivals : sequence of Rival
        Linear models of a single record that were fitted before; without any, some are fitted here.
    structures : sequence of Structure, optional
        Of the linear part behind (or before) an actuator.

    Returns
    -------
    ActuatedFit or None
        None if there is nothing to fit.
    """
    records = Records(tuple(parts))
    behind = BEHIND if structures is None else tuple(s for s in structures if s.zeros <= 1)
    if not wanted or not behind:
        return None
    linear = [] if rivals else [searched(records, Family(s), scales) for s in LINEAR]
    found = _with_actuators(records, scales, wanted, behind, linear)
    best = _leading(records, [*linear, *found])
    residual = _sample_residuals(records, best, scales)
    limit = _WILD * mad_sigma(np.concatenate(residual))
    wild = [_spikes(left, limit) for left in residual]
    if np.mean(np.concatenate(wild)) > 2e-3:
        records = _without_outliers(records, residual, wild, limit)
        linear = [Task(records, one.family, scales).improved(one.x) for one in linear]
        found = [Task(records, one.family, scales).improved(one.x) for one in found]
        best = _leading(records, [*linear, *found])
        residual = _sample_residuals(records, best, scales)
    sigma, correlation = _noise(residual, best)
    variance = sigma**2 * correlation
    charge = max(parameter_charge(records.samples / correlation), LEAST_CHARGE)

    def criterion(cost: float, structure: Structure, parameters: int) -> float:
        return cost / variance + charge * parameters + needless_parameters(structure)

    values = {one: criterion(one.cost, one.family.structure, one.parameters) for one in found}
    straight = [criterion(one.cost, one.family.structure, one.parameters) for one in linear]
    for rival in rivals:
        part, (weight, _) = records.parts[0], records.bases[0]
        squares = float(np.sum((weight * part.averaged(rival.residual[part.rows])) ** 2))
        free = rival.structure.order + rival.structure.zeros + 2
        straight.append(criterion(squares, rival.structure, free))
    chosen = _chosen(found, values)
    task = Task(records, chosen.family, scales)
    member, ends = profiled(task, chosen, variance)
    near = sorted(
        (one for one in found if _plausible(one, chosen, values, variance)),
        key=values.__getitem__,
    )
    every = [ends]
    for one in near[: _MOST_PROFILES - 1]:
        own_task = Task(records, one.family, scales)
        alike = (one.family.kind, one.family.place) == (member.family.kind, member.family.place)
        if alike:
            every.append(profiled(own_task, one, variance)[1])
        else:
            every.append((dead_time_ends(own_task, one, variance),))
    spans = [found_ends[0] for found_ends in every]
    values_of = [found_ends[1:] for found_ends in every if len(found_ends) == len(ends)]
    own = criterion(member.cost, member.family.structure, member.parameters)
    return ActuatedFit(
        task=task,
        member=member,
        coefficients=task.residual(member.x)[1],
        evidence=float(min(straight) - own),
        dead_time_ends=Ends(min(low for low, _ in spans), max(high for _, high in spans)),
        std=(ends[0].high - ends[0].low) / (2 * Z_95),
        value_ends=tuple(
            Ends(min(low for low, _ in own_ends), max(high for _, high in own_ends))
            for own_ends in zip(*values_of, strict=True)
        ),
        fitted=_every_sample(parts, member, scales),
        sigma=sigma,
        correlation=correlation,
        variance=variance,
        alternatives=tuple(
            (one.family, values[one] - min(values.values()))
            for one in sorted(found, key=values.__getitem__)
        ),
    )


def _with_actuators(
    records: Records,
    scales: Scales,
    wanted: Sequence[tuple[Kind, Place]],
    behind: Sequence[Structure],
    linear: Sequence[Member],
) -> list[Member]:
    """Best member of every family with an actuator."""
    found: list[Member] = []
    every = knots(records.parts)
    for kind, place in wanted:
        levels = _needed(kind, every)
        if FORMS[kind].own_lags:
            own = [searched(records, Family(s, kind, place, levels), scales) for s in behind]
        else:
            # It does not change how fast the rest is: one structure finds it for all.
            first = behind[min(1, len(behind) - 1)]
            base = searched(records, Family(first, kind, place, levels), scales, linear)
            own = with_other_lags(records, base, behind, scales)
        best = min(own, key=lambda one: one.cost)
        if behind == BEHIND and best.family.structure == BEHIND[-1]:
            own += with_other_lags(records, best, [ONE_MORE], scales)[1:]
        found += own
    return found


def _needed(kind: Kind, every: tuple[float, ...]) -> tuple[float, ...]:
    """Levels of the commands that an actuator depends on."""
    if not FORMS[kind].static:
        return ()
    return every if kind == "points" else (every[0], every[-1])


def _chosen(found: Sequence[Member], values: Mapping[Member, float]) -> Member:
    """Best model; one that contains a simpler one only where the evidence is very strong."""
    tried = {one.family.kind for one in found}

    def judged(one: Member) -> float:
        general = not tried.isdisjoint(one.family.form.contains)
        return values[one] + (PLAUSIBLE if general else 0.0)

    return min(found, key=judged)


def _plausible(
    one: Member, chosen: Member, values: Mapping[Member, float], variance: float
) -> bool:
    """Whether a model is not ruled out, and not the chosen one.

    Lags without zeros that fit no worse are none of those that are: noise hides lags, and does not
    remove them (see `plausible` of the structures).
    """
    close = values[one] - values[chosen] <= PLAUSIBLE
    fits = one.family.structure.zeros == 0 and one.cost <= chosen.cost + PLAUSIBLE * variance
    return one is not chosen and (close or fits)


def _leading(records: Records, members: Sequence[Member]) -> Member:
    """Member with the lowest criterion for noise of unknown variance."""
    charge = parameter_charge(records.samples)
    size = records.data.size
    return min(
        members,
        key=lambda one: size * float(np.log(max(one.cost, 1e-300))) + charge * one.parameters,
    )


def _every_sample(
    parts: Sequence[ActuatedRecord], member: Member, scales: Scales
) -> tuple[FloatArray, ...]:
    """Model at every sample of each record, with its own terms."""
    fine = Task(Records(tuple(part.every_sample() for part in parts)), member.family, scales)
    coarse = Task(Records(tuple(parts)), member.family, scales)
    coefficients = coarse.residual(member.x)[1]
    found = []
    for part, columns in zip(parts, fine.columns(member.x), strict=True):
        forced = columns @ coefficients
        rest = (part.measured - forced)[part.rows]
        weights = np.linalg.lstsq(part.own[part.rows], rest, rcond=None)[0]
        found.append(forced + part.own @ weights)
    return tuple(found)


def _sample_residuals(records: Records, member: Member, scales: Scales) -> list[FloatArray]:
    """Residual at the samples that there are, of every record."""
    models = _every_sample(records.parts, member, scales)
    return [
        (part.measured - model)[part.rows]
        for part, model in zip(records.parts, models, strict=True)
    ]


def _spikes(residual: FloatArray, limit: float) -> BoolArray:
    """Samples (N,) beyond a limit, of which there are few in a row."""
    beyond = np.abs(residual) > limit
    edges = np.flatnonzero(np.diff(beyond.astype(np.int64), prepend=0, append=0))
    found = np.zeros(residual.size, dtype=np.bool_)
    for first, end in edges.reshape(-1, 2).tolist():
        found[first:end] = end - first <= _SPIKE
    return found


def _without_outliers(
    records: Records, residual: Sequence[FloatArray], wild: Sequence[BoolArray], limit: float
) -> Records:
    """Records whose outliers are cut at a limit."""
    parts = []
    for part, left, cut in zip(records.parts, residual, wild, strict=True):
        measured = part.measured.copy()
        measured[part.rows] -= np.where(cut, left - np.clip(left, -limit, limit), 0.0)
        parts.append(
            ActuatedRecord(
                part.command, part.dt, part.rows, part.first, part.width, measured, part.own,
                part.offset,
            )
        )  # fmt: skip
    return Records(tuple(parts))


def _noise(residual: Sequence[FloatArray], member: Member) -> tuple[float, float]:
    """Standard deviation of the residual, and samples of it that count as one."""
    every = np.concatenate(residual)
    free = max(every.size - member.parameters - len(residual), 1)
    sigma = float(np.sqrt(every @ every / free))
    longest = max(residual, key=len)
    return max(sigma, 1e-300), correlation_time(longest)
