"""Whether time records and a frequency response have one model in common.

Fitted together they have one set of parameters, alone each has its own: the rise of the sum of
squares is a chi-square with as many degrees of freedom as there are parameters, if it is one
plant (likelihood ratio). Where the noise was estimated from few points it is an F ratio, as in the
test of [1]_ for equality of the coefficients of two regressions.

References
----------
.. [1] G. C. Chow, Tests of equality between sets of coefficients in two linear regressions,
   Econometrica 28 (1960) 591-605, doi:10.2307/1910133.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from ..arrays import BoolArray, FloatArray
from ..engine.compared_fits import settled
from ..engine.eliminate import evaluate
from ..engine.problem import Problem, Structure
from ..engine.structures import Candidate
from .frf_rows import MeasuredPoints
from .own_effects import OwnKey, chance_of, freed
from .record_part import RecordPart

BY_CHANCE = 0.01  # one false alarm in a hundred plants, as among records of one plant
OUTSIDE = 0.95
"""Probability of the circle about a point within which a model agrees with it."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """Comparison of a joint model with those of the same structure of each of the two alone.

    `structure` is that of the joint model, or one that is not ruled out and with which both agree.
    `record_rise` and `frf_rise` are what the sums of squares rise by, in variances, when the two
    are fitted together; `statistic` is their sum, and `p_value` the probability of at least as much
    by chance. `radius` (K,) is that of the 95 % circle about every point, and `outside` (K,) marks
    those whose circle does not contain the joint model. `shift` (N,) is the joint response less
    that of the model of the records alone. `gain_ratio` is the gain of the frequency response over
    that of the records if it has its own, and the probability of what is then left of the
    contradiction; `later` the same for its dead time less that of the records, in s. Both are NaN
    if there is no contradiction.
    """

    structure: Structure
    statistic: float
    p_value: float
    record_rise: float
    frf_rise: float
    radius: FloatArray
    outside: BoolArray
    shift: FloatArray
    gain_ratio: tuple[float, float]
    later: tuple[float, float]

    @property
    def parameters(self) -> int:
        """Number of parameters that are common: dead time, poles, numerator."""
        return self.structure.order + self.structure.zeros + 2

    @property
    def contradicts(self) -> bool:
        """Whether the two have no common model."""
        return self.p_value < BY_CHANCE


def agreement(
    record: RecordPart,
    points: MeasuredPoints,
    problem: Problem,
    model: Candidate,
    starts: Mapping[Structure, Sequence[FloatArray]],
) -> tuple[FloatArray, Agreement]:
    """Fit the structure of a joint model to each of the two alone, and compare.

    Parameters
    ----------
    record : RecordPart
    points : MeasuredPoints
    problem : Problem
        Of both together.
    model : Candidate
        The best of a structure on it.
    starts : mapping
        Other starts of every structure, for each of the two.

    Returns
    -------
    fitted : ndarray, shape (N,)
        Response of the joint model at every sample of the records.
    Agreement
    """
    rows = record.problem.data.size
    state = evaluate(problem, model.structure, model.parameters[None])
    residual = state.residual[0]
    fitted = record.predict(state.numerator[0], model.parameters, state.regression[0], problem)
    near = starts[model.structure]
    own = _alone(record.problem, model, near, record)
    other = _alone(points.problem(), model, near, record)
    record_rise = max(float(np.sum(residual[:rows] ** 2)) - own.cost, 0.0)
    frf_rise = max(float(np.sum(residual[rows:] ** 2)) - other.cost, 0.0)
    statistic = record_rise + frf_rise
    parameters = model.structure.order + model.structure.zeros + 2
    chance = chance_of(statistic, parameters, points.freedom)
    gain = later = (np.nan, np.nan)
    if chance < BY_CHANCE:
        separate = own.cost + other.cost
        gain, later = (
            _differing(record, points, model, separate, key) for key in ("gain", "dead_time")
        )
    state = evaluate(record.problem, own.structure, own.parameters[None])
    single = record.predict(state.numerator[0], own.parameters, state.regression[0], record.problem)
    reach = float(chi2.ppf(OUTSIDE, 2))
    return fitted, Agreement(
        structure=model.structure,
        statistic=statistic,
        p_value=chance,
        record_rise=record_rise,
        frf_rise=frf_rise,
        radius=points.sigma * np.sqrt(reach / 2),
        outside=np.sum(np.square(np.split(residual[rows:], 2)), axis=0) > reach,
        shift=fitted - single,
        gain_ratio=gain,
        later=later,
    )


def _alone(
    problem: Problem, joint: Candidate, starts: Sequence[FloatArray], record: RecordPart
) -> Candidate:
    cost = float(evaluate(problem, joint.structure, joint.parameters[None]).cost[0])
    first = replace(joint, cost=cost, ends=np.array(starts).reshape(-1, joint.parameters.size))
    return settled(problem, first, record.scales)


def _differing(
    record: RecordPart, points: MeasuredPoints, joint: Candidate, separate: float, key: OwnKey
) -> tuple[float, float]:
    """Own value of the frequency response, and the probability of what it does not explain."""
    value, cost = freed(record.problem, points, joint, record.scales, key)
    parameters = joint.structure.order + joint.structure.zeros + 1
    return value, chance_of(max(cost - separate, 0.0), parameters, points.freedom)
