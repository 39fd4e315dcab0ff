"""Maximum likelihood for time records and a frequency response of one plant.

The noises of the two are independent, so that the logarithms of their likelihoods add up [1]_: the
rows of both, each over its standard deviation, are one least-squares problem. Structures, profiles
and intervals are those of the records alone (see `output_error`).

References
----------
.. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.batch_search import fit_batch
from ..engine.compared_fits import converged
from ..engine.modal import respond
from ..engine.poles import parameters_from_poles
from ..engine.problem import KnownFactor, Problem, Structure
from ..engine.structures import Candidate, Scales, neighbour_starts, parameter_bounds, search
from ..engine.window import Window
from ..engine.window_fit import WindowFit
from ..output_error.interval import likelihood_fit
from ..output_error.result import Followed, OutputErrorEstimate
from ..signals.correlation import fit_percent
from .agreement import Agreement, agreement
from .frf_rows import MeasuredPoints, both_together
from .record_part import RecordPart

StartPoint = tuple[float, ComplexArray]
"""Dead time in s, and poles in rad/s."""


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """Estimate from both, with `fitted` at every sample of the records, and how well they agree."""

    estimate: OutputErrorEstimate
    agreement: Agreement


def joint_fit(
    record: RecordPart,
    points: MeasuredPoints,
    starts: Mapping[Structure, Sequence[StartPoint]],
    within: tuple[float, float],
) -> JointEstimate:
    """Fit all structures to both, and compare with what each would have alone.

    Parameters
    ----------
    record : RecordPart
    points : MeasuredPoints
    starts : mapping of Structure to sequences
        The structures to try, each with models of one of the two.
    within : tuple of float
        Range of the dead time in s that contains the intervals of both: where they contradict each
        other, a compromise in all other parameters may lie far from either.
    """
    low = min(within[0], 0.99 * record.scales.latest)
    scales = replace(record.scales, earliest=low, latest=min(within[1], record.scales.latest))
    alone = points.problem()
    problem = both_together(record.problem, alone)
    samples = record.independent + 2 * points.omega.size
    from_points = search(alone, starts, scales)
    first = _starting_fits(problem, starts, from_points, scales)
    candidates = converged(problem, first, scales, 1.0, samples)
    window = Window(0, problem.data, problem, problem.drive, problem.regressors, None)
    window = replace(window, samples=int(np.ceil(samples)))
    whole = WindowFit(window, problem, candidates, {}, scales, 1.0, 1.0, 1.0, colour=1.0)
    whole = replace(whole, criterion=whole.criteria(candidates))
    found = likelihood_fit(whole, adequate=True)
    own = np.concatenate([[found.dead_time], parameters_from_poles(found.poles)])
    setting = record, points, problem
    near = {s: [*_parameters(starts[s]), from_points[s].parameters] for s in starts}
    fitted, agreed = agreement(*setting, Candidate(found.structure, own, 0.0), near)
    for line in found.structures:
        if not agreed.contradicts:
            break
        if line.interval is not None and line.structure != found.structure:
            # A structure that is not ruled out may be what both have in common.
            at = np.concatenate([[line.dead_time], parameters_from_poles(line.poles)])
            other = agreement(*setting, Candidate(line.structure, at, 0.0), near)[1]
            agreed = agreed if other.contradicts else other
    return JointEstimate(
        replace(found, fitted=fitted, followed=_followed(record, found, fitted)), agreed
    )


def _followed(record: RecordPart, found: OutputErrorEstimate, fitted: FloatArray) -> Followed:
    """How much of the records the joint model follows, which are only a part of the rows."""
    own = np.concatenate([[found.dead_time], parameters_from_poles(found.poles)])
    alone = respond(record.drive, KnownFactor(), found.numerator, own)
    alone = alone + np.mean(record.output - alone)
    both = fit_percent(np.stack([record.output, record.output]), np.stack([fitted, alone]))
    return Followed(float(both[0]), float(both[1]), found.structure, float(both[0]))


def _parameters(starts: Sequence[StartPoint]) -> list[FloatArray]:
    return [np.append(at, parameters_from_poles(poles)) for at, poles in starts]


def _starting_fits(
    problem: Problem,
    starts: Mapping[Structure, Sequence[StartPoint]],
    from_points: Mapping[Structure, Candidate],
    scales: Scales,
) -> dict[Structure, Candidate]:
    found: dict[Structure, Candidate] = {}
    for structure in sorted(starts, key=lambda s: (s.order, s.zeros)):
        tried = [*_parameters(starts[structure]), from_points[structure].parameters]
        tried += neighbour_starts(structure, scales, found)
        parameters, cost = fit_batch(
            problem, structure, np.array(tried), parameter_bounds(structure, scales)
        )
        order = np.argsort(cost)
        best = order[0]
        found[structure] = Candidate(
            structure, parameters[best], float(cost[best]), parameters[order[1:]], True
        )
    return found
