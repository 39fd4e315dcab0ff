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
from dataclasses import replace

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.compared_fits import converged
from ..engine.modal import parameters_from_poles
from ..engine.problem import Structure
from ..engine.structures import Candidate, search
from ..engine.window_fit import with_known_noise
from ..output_error.interval import likelihood_fit
from ..output_error.result import OutputErrorEstimate
from .agreement import Agreement, agreement
from .data import JointData

StartPoint = tuple[float, ComplexArray]
"""Dead time in s, and poles in rad/s."""


def joint_fit(
    data: JointData, starts: Mapping[Structure, Sequence[StartPoint]], within: tuple[float, float]
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
    """
    low = min(within[0], 0.99 * data.scales.latest)
    scales = replace(data.scales, earliest=low, latest=min(within[1], data.scales.latest))
    problem, samples = data.problem, (data.records.samples or 0) + data.points.problem.data.size
    from_points = search(data.points.problem, starts, scales)
    near = {s: [*_parameters(starts[s]), from_points[s].parameters] for s in starts}
    candidates = search(problem, near, scales, starts=near)
    candidates = converged(problem, candidates, scales, 1.0, samples)
    window = replace(data.records, problem=problem, samples=samples)
    estimate = likelihood_fit(with_known_noise(window, candidates, scales, 1.0), adequate=True)
    compared = agreement(data, _model(estimate.structure, estimate.dead_time, estimate.poles), near)
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
