"""Records and points of a frequency response as parts of one problem, with rows of variance 1.

The noise of the records is what their fit alone left over: its variance, times the number of
samples that count as one [1]_. Residuals far beyond it are cut, as Huber's loss does [2]_. Real and
imaginary parts of a point are rows of their own, each with half of its variance [3]_.

References
----------
.. [1] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
.. [2] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, section 7.8,
   doi:10.1002/9780470434697.
.. [3] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..constants import FAR_OUTLIER
from ..engine.eliminate import evaluate
from ..engine.local_terms import Segments
from ..engine.modal import parameters_from_poles
from ..engine.problem import KnownFactor, Problem
from ..engine.responses import SeveralInputs
from ..engine.structures import Scales
from ..engine.window_fit import Window, weighted_correlation
from ..output_error.any_input.data import SampledData
from ..output_error.any_input.window import window_of
from ..output_error.result import OutputErrorEstimate
from ..output_error.step_data import StepData, step_scales, window
from ..rational.frf_data import FRFData
from ..signals.noise import correlation_time, is_coarse, mad_sigma

_LATE = 1e200
"""Time in s at which every free response has ended: a frequency response has no initial state."""


@dataclass(frozen=True, eq=False)
class JointData:
    """Records and a frequency response of one plant.

    Attributes
    ----------
    records : Window
        With the problem of the records alone.
    scales : Scales
    points : FRFData
    freedom : float
        Degrees of freedom of the estimate of the noise of the points; infinite if it was measured.
    """

    records: Window
    scales: Scales
    points: FRFData
    freedom: float = np.inf

    @cached_property
    def problem(self) -> Problem:
        """Rows of the records, then those of the points."""
        return with_rows(self.records.problem, self.points.problem)


def with_rows(record: Problem, more: Problem) -> Problem:
    """Append the rows of another problem without initial states.

    Its regressors are the last ones of the records; the others are zero in its rows.
    """
    segments, rows = record.segments, more.data.size
    if segments is not None:
        edges = segments.edges.copy()
        edges[-1] += rows
        clock = np.concatenate([segments.clock, np.full(rows, _LATE)])
        regressors = np.pad(segments.regressors, ((0, rows), (0, 0)))
        segments = Segments(edges, clock, regressors, segments.bins)
    missing = record.regressors.shape[1] - more.regressors.shape[1]
    return replace(
        record,
        data=np.concatenate([record.data, more.data]),
        root_weight=np.concatenate([record.root_weight, more.root_weight]),
        drive=SeveralInputs((record.drive, more.drive)),
        regressors=np.concatenate(
            [record.regressors, np.pad(more.regressors, ((0, 0), (missing, 0)))]
        ),
        segments=segments,
    )


def step_part(
    data: StepData, fit: OutputErrorEstimate, latest: float | None
) -> tuple[Window, Scales]:
    """Set up the record of a step experiment, or the mean of several."""
    limit = FAR_OUTLIER * max(mad_sigma(data.output - fit.fitted), data.sigma)
    calm = fit.fitted + np.clip(data.output - fit.fitted, -limit, limit)
    part = window(replace(data, output=calm), calm.size, KnownFactor())
    rounding = data.quantum / np.sqrt(12) if is_coarse(data.sigma, data.quantum) else 0.0
    variance = fit.residual.std**2 + rounding**2
    variance *= weighted_correlation(fit.residual.correlation, part.counted)
    problem, local = part.problem, part.own
    if local is not None and problem.segments is not None:
        # Before the middle of the first bin a free response was not seen: that of a fast pole,
        # which is over by then, would have any size there.
        local = replace(local, clock=np.maximum(local.clock, problem.segments.clock[0]))
    part = replace(
        part,
        output=data.output,
        problem=replace(problem, root_weight=problem.root_weight / np.sqrt(variance)),
        own=local,
        samples=(calm.size - part.start) / fit.residual.correlation,
    )
    return part, step_scales(data, calm.size, latest)


def sampled_part(
    data: SampledData, fit: OutputErrorEstimate, latest: float | None
) -> tuple[Window, Scales]:
    """Set up records with any input; of long ones a part in which the input moves."""
    part = window_of(data)
    problem = part.problem
    parameters = np.concatenate([[fit.dead_time], parameters_from_poles(fit.poles)])
    error = evaluate(problem, fit.structure, parameters[None]).residual[0]
    limit = FAR_OUTLIER * mad_sigma(error)
    lost = fit.poles.size + fit.numerator.size + problem.local_count(fit.poles.size)
    correlation = correlation_time(error)
    variance = float(error @ error) / max(error.size - lost, 1) * correlation
    calm = problem.data - error + np.clip(error, -limit, limit)
    problem = replace(problem, data=calm, root_weight=problem.root_weight / np.sqrt(variance))
    lag = float(np.sum(1 / np.abs(fit.poles)))
    scales = Scales(
        max(fit.dead_time, 0.5 * data.step),
        max(lag, 2 * data.step),
        max(data.lengths) * data.step,
        data.step,
        0.25 * data.longest if latest is None else latest,
    )
    return replace(part, problem=problem, samples=error.size / correlation), scales
