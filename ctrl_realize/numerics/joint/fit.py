"""Maximum likelihood for time records and a frequency response of one plant.

The noises of the two are independent, so that the logarithms of their likelihoods add up [1]_: the
rows of both, each over its standard deviation, are one least-squares problem. Structures, profiles
and intervals are those of the records alone (see `output_error`).

Fitted together they have one set of parameters, alone each has its own: the rise of the sum of
squares tells whether they have one model in common. It is a chi-square with as many degrees of
freedom as there are parameters, if it is one plant (likelihood ratio). Where the noise was
estimated from few points it is an F ratio, as in the test of [2]_ for equality of the coefficients
of two regressions.

References
----------
.. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
.. [2] G. C. Chow, Tests of equality between sets of coefficients in two linear regressions,
   Econometrica 28 (1960) 591-605, doi:10.2307/1910133.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from ..arrays import BoolArray, ComplexArray, FloatArray
from ..engine.eliminate import evaluate
from ..engine.modal import parameters_from_poles
from ..engine.problem import Problem, Structure
from ..engine.structures import Candidate, converged, search, settled
from ..engine.window_fit import with_known_noise
from ..output_error.interval import likelihood_fit
from ..output_error.result import OutputErrorEstimate
from ..output_error.selection import many_lags
from .data import JointData
from .effects import freed

StartPoint = tuple[float, ComplexArray]
"""Dead time in s, and poles in rad/s."""
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
        return self.structure.free + 2

    @property
    def contradicts(self) -> bool:
        """Whether the two have no common model."""
        return self.p_value < BY_CHANCE


def agreement(
    data: JointData, model: Candidate, starts: Mapping[Structure, Sequence[FloatArray]]
) -> Agreement:
    """Fit the structure of a joint model to each of the two alone, and compare.

    Parameters
    ----------
    data : JointData
    model : Candidate
        The best of a structure on both together.
    starts : mapping
        Other starts of every structure, for each of the two.
    """
    records, points = data.records, data.points
    rows = records.problem.data.size
    residual = evaluate(data.problem, model.structure, model.parameters[None]).residual[0]
    separate = [_alone(data, part.problem, model, starts) for part in (records, points)]
    parts = residual[:rows], residual[rows:]
    rises = [
        max(float(part @ part) - fit.cost, 0.0) for part, fit in zip(parts, separate, strict=True)
    ]
    statistic, least = sum(rises), sum(fit.cost for fit in separate)
    parameters = model.structure.free + 2
    chance = _chance_of(statistic, parameters, data.freedom)
    gain = later = (np.nan, np.nan)
    if chance < BY_CHANCE:
        gain, later = (
            (value, _chance_of(max(cost - least, 0.0), parameters - 1, data.freedom))
            for value, cost in (freed(data, model, "gain"), freed(data, model, "dead_time"))
        )
    reach = float(chi2.ppf(OUTSIDE, 2))
    return Agreement(
        structure=model.structure,
        statistic=statistic,
        p_value=chance,
        record_rise=rises[0],
        frf_rise=rises[1],
        # The rows of a point have half of its variance.
        radius=np.sqrt(reach) / points.weight,
        outside=np.sum(np.square(np.split(residual[rows:], 2)), axis=0) > reach,
        shift=records.predict(data.problem, model) - records.predict(records.problem, separate[0]),
        gain_ratio=gain,
        later=later,
    )


def _alone(
    data: JointData,
    problem: Problem,
    joint: Candidate,
    starts: Mapping[Structure, Sequence[FloatArray]],
) -> Candidate:
    """Best fit of the joint structure to one of the two, or to both."""
    cost = float(evaluate(problem, joint.structure, joint.parameters[None]).cost[0])
    ends = np.array(starts.get(joint.structure, ())).reshape(-1, joint.parameters.size)
    return settled(problem, replace(joint, cost=cost, ends=ends), data.scales)


def _chance_of(statistic: float, parameters: int, freedom: float) -> float:
    """Probability of a larger likelihood ratio by chance.

    A chi-square, or an F ratio if the noise was estimated with `freedom` degrees of freedom.
    """
    if np.isfinite(freedom):
        return float(f_distribution.sf(statistic / parameters, parameters, freedom))
    return float(chi2.sf(statistic, parameters))


def joint_fit(
    data: JointData,
    starts: Mapping[Structure, Sequence[StartPoint]],
    within: tuple[float, float],
    *,
    stated: bool,
) -> tuple[OutputErrorEstimate, Agreement]:
    """Fit all structures to both, and compare with what each would have alone.

    Parameters
    ----------
    data : JointData
    starts : mapping of Structure to sequences
        The structures to try, each with models of one of the two.
    within : tuple of float
        Range of the dead time in s that contains the intervals of both: where they contradict each
        other, a compromise in all other parameters may lie far from either.
    stated : bool
        The structures were; otherwise chains of lags, diffusion and dispersion are compared as
        well.
    """
    low = min(within[0], 0.99 * data.scales.latest)
    scales = replace(data.scales, earliest=low, latest=min(within[1], data.scales.latest))
    problem, samples = data.problem, (data.records.samples or 0) + data.points.problem.data.size
    from_points = search(data.points.problem, starts, scales)
    near = {s: [*_parameters(starts[s]), from_points[s].parameters] for s in starts}
    candidates = search(problem, near, scales, starts=near)
    candidates = converged(problem, candidates, scales, 1.0, samples)
    window = replace(data.records, problem=problem, samples=samples)
    fits = with_known_noise(window, candidates, scales, 1.0)
    chains, flows = ([], []) if stated else many_lags(fits)
    estimate = likelihood_fit(fits, adequate=True, chains=chains, flows=flows)
    model = _model(estimate.structure, estimate.dead_time, estimate.poles)
    if estimate.distributed.follows_flow:  # lags at a dead time that is not the best for them
        model = _alone(data, problem, model, near)
    compared = agreement(data, model, near)
    for line in estimate.structures:
        if not compared.contradicts:
            break
        if line.interval is not None and line.structure != estimate.structure:
            # A structure that is not ruled out may be what both have in common.
            other = agreement(data, _model(line.structure, line.dead_time, line.poles), near)
            compared = compared if other.contradicts else other
    return estimate, compared


def _model(structure: Structure, dead_time: float, poles: ComplexArray) -> Candidate:
    return Candidate(structure, np.append(dead_time, parameters_from_poles(poles)), 0.0)


def _parameters(starts: Sequence[StartPoint]) -> list[FloatArray]:
    return [np.append(at, parameters_from_poles(poles)) for at, poles in starts]
