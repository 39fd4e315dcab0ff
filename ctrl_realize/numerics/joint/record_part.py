"""Time records as a problem with rows of known variance, after they were fitted alone.

The noise is what the fit of the records left over: its variance, times the number of samples that
count as one [1]_. Residuals far beyond it are cut, as Huber's loss does [2]_.

References
----------
.. [1] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
.. [2] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, section 7.8,
   doi:10.1002/9780470434697.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray
from ..engine.eliminate import evaluate
from ..engine.local_terms import Segments
from ..engine.modal import respond
from ..engine.poles import parameters_from_poles, poles_from_parameters
from ..engine.problem import KnownFactor, Problem
from ..engine.responses import HeldInput
from ..engine.structures import Scales
from ..engine.window_fit import weighted_correlation
from ..output_error.any_input.data import SampledData, cut
from ..output_error.result import OutputErrorEstimate
from ..output_error.step_data import StepData, step_scales, window
from ..signals.noise import correlation_time, is_coarse, mad_sigma

_WILD = 5.0  # standard deviations, beyond which Gaussian noise has none of a million samples: cut
_UNKNOWN = 1.5  # dead times at the start of a record that depend on the input before it


@dataclass(frozen=True, eq=False)
class RecordPart:
    """Records with rows of variance 1, and what is needed for the response at every sample.

    Attributes
    ----------
    problem : Problem
        Of the records alone.
    scales : Scales
    independent : float
        Number of samples that count.
    drive, columns, own : HeldInput, ndarray, Segments or None
        Input, regressors and local terms at every sample.
    output : ndarray, shape (N,)
    """

    problem: Problem
    scales: Scales
    independent: float
    drive: HeldInput
    columns: FloatArray
    own: Segments | None
    output: FloatArray

    def predict(
        self, numerator: FloatArray, parameters: FloatArray, regression: FloatArray, joint: Problem
    ) -> FloatArray:
        """Model at every sample, with its regressors and the local terms that fit best.

        `joint` is a problem that begins with the rows of the records.
        """
        setting = joint.known, numerator, parameters
        model = respond(self.drive, *setting) + self.columns @ regression
        if self.own is None:
            return model
        terms = joint.local_terms(poles_from_parameters(parameters[None, 1:])[0])
        rest = joint.data - respond(joint.drive, *setting) - joint.regressors @ regression
        return np.asarray(model + terms.fitted((joint.root_weight * rest)[None], self.own)[0])


def step_part(data: StepData, fit: OutputErrorEstimate, latest: float | None) -> RecordPart:
    """Set up the record of a step experiment, or the mean of several."""
    limit = _WILD * max(mad_sigma(data.output - fit.fitted), data.sigma)
    calm = fit.fitted + np.clip(data.output - fit.fitted, -limit, limit)
    part = window(replace(data, output=calm), calm.size, KnownFactor())
    rounding = data.quantum / np.sqrt(12) if is_coarse(data.sigma, data.quantum) else 0.0
    variance = fit.residual.std**2 + rounding**2
    variance *= weighted_correlation(fit.residual.correlation, part.counted)
    problem, own = part.problem, part.own
    if own is not None and problem.segments is not None:
        # Before the middle of the first bin a free response was not seen: that of a fast pole,
        # which is over by then, would have any size there.
        own = replace(own, clock=np.maximum(own.clock, problem.segments.clock[0]))
    return RecordPart(
        replace(problem, root_weight=problem.root_weight / np.sqrt(variance)),
        step_scales(data, calm.size, latest),
        (calm.size - part.start) / fit.residual.correlation,
        part.drive,
        part.columns,
        own,
        data.output,
    )


def sampled_data(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    dt: float,
    dead_time: float,
    every: int = 1,
) -> SampledData:
    """Select the samples of records with any input that do not depend on unknown past input.

    Of `every` samples the mean, if the plant is slow.
    """
    data = cut(outputs, inputs, dt, every)
    late = int(np.ceil(_UNKNOWN * dead_time / data.step))
    return replace(data, starts=tuple(min(late, y.size // 2) for y in data.outputs))


def sampled_part(data: SampledData, fit: OutputErrorEstimate, latest: float | None) -> RecordPart:
    """Set up records with any input; of long ones a part in which the input moves."""
    problem = data.problem(KnownFactor())
    parameters = np.concatenate([[fit.dead_time], parameters_from_poles(fit.poles)])
    error = evaluate(problem, fit.structure, parameters[None]).residual[0]
    limit = _WILD * mad_sigma(error)
    lost = fit.poles.size + fit.numerator.size + problem.local_count(fit.poles.size)
    correlation = correlation_time(error)
    variance = float(error @ error) / max(error.size - lost, 1) * correlation
    calm = problem.data - error + np.clip(error, -limit, limit)
    lag = float(np.sum(1 / np.abs(fit.poles)))
    dt = data.step
    quarter = 0.25 * max(y.size for y in data.outputs) * dt
    return RecordPart(
        replace(problem, data=calm, root_weight=problem.root_weight / np.sqrt(variance)),
        Scales(
            max(fit.dead_time, 0.5 * dt),
            max(lag, 2 * dt),
            max(data.lengths) * dt,
            dt,
            quarter if latest is None else latest,
        ),
        error.size / correlation,
        problem.drive,
        np.empty((error.size, 0)),
        problem.segments,
        problem.data,
    )
