"""Rows of time records and points of a frequency response below one another.

Real and imaginary parts of a point are separate rows, each with half of the variance of the complex
value [1]_; see `signals.sines`.

References
----------
.. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 9, doi:10.1002/9781118287422.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.local_terms import Segments
from ..engine.problem import KnownFactor, Problem
from ..engine.responses import HeldInput, Modes
from ..signals.sines import Sines, stacked_parts

_LATE = 1e200
"""Time in s at which every free response has ended: a frequency response has no initial state."""


@dataclass(frozen=True, eq=False)
class Beside:
    """Rows of several inputs, one below the other.

    Attributes
    ----------
    parts : tuple of HeldInput
    """

    parts: tuple[HeldInput, ...]

    def pieces(self) -> Sequence[HeldInput]:
        """All parts, in the same order."""
        return [piece for part in self.parts for piece in part.pieces()]

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T of every row; see `HeldInput`."""
        static, mode, slope = zip(*(part.modes(tau, poles) for part in self.parts), strict=True)
        return (
            np.concatenate(static, axis=1),
            np.concatenate(mode, axis=1),
            np.concatenate(slope, axis=1),
        )


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Points of a frequency response without hold.

    Attributes
    ----------
    omega : ndarray, shape (K,)
        In rad/s.
    response : ndarray of complex, shape (K,)
    sigma : ndarray, shape (K,)
        Standard deviation of the complex value, with the charge for correlated points.
    freedom : float
        Degrees of freedom of the estimate of `sigma`; infinite if it was measured.
    """

    omega: FloatArray
    response: ComplexArray
    sigma: FloatArray
    freedom: float = np.inf

    def problem(self) -> Problem:
        """Fit of these points alone, with rows of variance 1."""
        half = np.sqrt(2.0) / self.sigma
        return Problem(
            stacked_parts(self.response),
            np.concatenate([half, half]),
            Sines(self.omega),
            np.empty((2 * self.omega.size, 0)),
            KnownFactor(),
        )


def both_together(record: Problem, points: Problem) -> Problem:
    """Rows of time records, then those of frequency points, with rows of variance 1.

    Regressors that the points do not have are zero there.
    """
    missing = record.regressors.shape[1] - points.regressors.shape[1]
    return with_rows(
        record, replace(points, regressors=np.pad(points.regressors, ((0, 0), (missing, 0))))
    )


def with_rows(record: Problem, more: Problem) -> Problem:
    """Append the rows of another problem with the same regressors.

    Initial states belong to the records alone.
    """
    segments, rows = record.segments, more.data.size
    if segments is not None:
        edges = segments.edges.copy()
        edges[-1] += rows
        segments = Segments(
            edges,
            np.concatenate([segments.clock, np.full(rows, _LATE)]),
            np.pad(segments.regressors, ((0, rows), (0, 0))),
            segments.bins,
        )
    return replace(
        record,
        data=np.concatenate([record.data, more.data]),
        root_weight=np.concatenate([record.root_weight, more.root_weight]),
        drive=Beside((record.drive, more.drive)),
        regressors=np.concatenate([record.regressors, more.regressors]),
        segments=segments,
    )
