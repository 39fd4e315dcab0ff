r"""Points of a frequency response as rows of a separable least-squares problem.

In `varpro` a model is a sum of modes of an input. A point of a frequency response is the response
to another input, :math:`e^{j \omega t}`: with the residues r_j of ``G(s) / s`` at its poles p_j and
its static gain g, a strictly proper G has

.. math:: e^{-j \omega \tau} G(j \omega) =
          e^{-j \omega \tau} \Bigl( g + \sum_j r_j \frac{j \omega}{j \omega - p_j} \Bigr),

so that ``E_j = exp(-j omega tau) j omega / (j omega - p_j)`` takes the place of the exponentials of
a step response. The derivative with respect to the dead time is ``-sum_j r_j p_j E_j`` for both,
since ``g + sum_j r_j = 0``. Real and imaginary parts are separate rows, each with half of the
variance of the complex value [1]_.

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
from ..rational.model import stacked_parts
from ..separable.local_terms import Segments
from ..separable.responses import HeldInput, Modes
from ..separable.varpro import KnownFactor, Problem

_LATE = 1e200
"""Time in s at which every free response has ended: a frequency response has no initial state."""


@dataclass(frozen=True, eq=False)
class Sines:
    """Steady state of sines: real parts of all points, then imaginary parts.

    Attributes
    ----------
    omega : ndarray, shape (K,)
        In rad/s.
    """

    omega: FloatArray

    def pieces(self) -> list[Sines]:
        """All points."""
        return [self]

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T of every row; see `HeldInput`."""
        s = 1j * self.omega
        turn = np.exp(-s * tau[:, None])
        gap = s[:, None] - poles[:, None, :]
        mode = turn[:, :, None] * (s[:, None] / gap)
        # Re(-j z) is the imaginary part of z.
        static = np.concatenate([turn.real, turn.imag], axis=1)
        both = np.concatenate([mode, -1j * mode], axis=1)
        return static, both, both / np.concatenate([gap, gap], axis=1)


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
            real=False,  # at a point, the modes of conjugate poles are not conjugate
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
        real=record.real and more.real,
    )
