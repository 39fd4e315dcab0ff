"""A part of a record that is fitted: its samples, and their means over bins as a problem.

A response is needed sample by sample for the noise, and at means over bins for the search. Our own
arrangement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import FloatArray
from ..signals.bins import Bins
from .eliminate import evaluate
from .local_terms import Segments
from .modal import respond
from .problem import Problem
from .responses import HeldInput
from .structures import Candidate


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a record, sample by sample and as a problem of means over bins.

    Attributes
    ----------
    start : int
        Residuals count from this sample on.
    output : ndarray, shape (N,)
    problem : Problem
        On the bins, or on the samples if there are none; rows of other data may follow.
    drive : HeldInput
        For the response at every sample.
    columns : ndarray, shape (N, q)
        Regressors at every sample.
    bins : Bins or None
    own : Segments or None
        Local terms at every sample, if the problem has them on bins.
    samples : float or None
        Number that the problem represents, if it is not that of the output.
    spacing : float
        Mean distance of the samples, in sample times; 1 if none is missing.
    """

    start: int
    output: FloatArray
    problem: Problem
    drive: HeldInput
    columns: FloatArray
    bins: Bins | None = None
    own: Segments | None = None
    samples: float | None = None
    spacing: float = 1.0

    @cached_property
    def counted(self) -> float:
        """Sum of the weights of the means after the step, over that of their samples.

        Below 1 where means of coarsely rounded samples weigh less than their number.
        """
        if self.bins is None or self.samples is not None:
            return 1.0
        after = self.bins.first >= self.start
        weights = float(np.sum(self.problem.root_weight[after] ** 2))
        return weights / max(float(np.sum(self.bins.width[after])), 1.0)

    def with_output(self, values: FloatArray) -> Problem:
        """Return the problem for other values (N,)."""
        means = values if self.bins is None else self.bins.average(values)
        return replace(self.problem, data=means)

    def predict(self, problem: Problem, candidate: Candidate) -> FloatArray:
        """Model at every sample, with the linear terms of the problem."""
        state = evaluate(problem, candidate.structure, candidate.parameters[None])
        if self.bins is None:
            # The samples are the first data of the problem.
            fitted = problem.data - state.residual[0] / problem.root_weight
            return np.asarray(fitted[: self.output.size])
        setting = problem.known, state.numerator[0], candidate.theta
        model = respond(self.drive, *setting)
        model += self.columns @ state.regression[0]
        if self.own is not None:
            weight = problem.root_weight
            terms = problem.local_terms(candidate.poles[None])
            forced = respond(problem.drive, *setting) + problem.regressors @ state.regression[0]
            remainder = weight * (problem.data - forced)
            model = model + terms.fitted(remainder[None], self.own)[0]
        return np.asarray(model)


def window_of_rows(problem: Problem) -> Window:
    """Window of a problem of which every row is a sample."""
    return Window(0, problem.data, problem, problem.drive, problem.regressors)
