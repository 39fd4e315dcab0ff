"""Poles and zeros of systems with delays inside, when somebody asks for them."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..._checks import whole
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.internal_delays import characteristic, dominant
from ...numerics.internal_delays.form import inverse
from ...numerics.loops.crossings import frequency_grid
from ..host_responses import HostResponses
from ..operators import DelayOperators

FEW_STATES = 400
"""States up to which zeros of several channels come from the augmented matrices."""


class InsidePoles(HostResponses, DelayOperators):
    """Roots of the characteristic function; the matrices of the delays are not formed."""

    _core: ct.StateSpace
    internal_delays: tuple[float, ...]

    def poles(self) -> ComplexArray:
        """All poles, as many as the system has states; see `dominant_poles` for the first few."""
        return characteristic.discrete_poles(self._form())

    def dominant_poles(self, count: int = 10) -> ComplexArray:
        """Find the poles that decay most slowly, or grow fastest: those of largest size.

        Parameters
        ----------
        count : int, optional
            How many; one more where a pair would be split.

        Returns
        -------
        ndarray, shape (count,)
            Falling in size.

        Notes
        -----
        Each is a root of the characteristic function to 1e-10. Up to 400 states all poles are found
        first; beyond, Newton's method starts from points all around the unit circle.

        Examples
        --------
        >>> import control as ct
        >>> import ctrl_realize as cr
        >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=10, dt=0.001)
        >>> loop = ct.feedback(plant * 0.5)
        >>> loop.nstates, abs(loop.dominant_poles(1)).round(6)
        (10001, array([0.999931, 0.999931]))
        """
        return dominant.dominant_discrete_poles(self._form(), whole(count, "count", 1))

    def is_stable(self) -> bool:
        """Whether all poles lie inside the region of stability.

        Decided by the argument principle on its border, without any pole; False where a pole is so
        close to the border that no side can be told.
        """
        count, marginal = self._unstable()
        return count == 0 and not marginal

    def _unstable(self) -> tuple[int, bool]:
        features, wait = self._features()
        dt = float(self.dt)
        sizes = np.abs(features)
        top = np.pi / dt
        low = 1e-3 * min(float(sizes[sizes > 0].min(initial=top)), 1 / wait if wait else top)
        grid: FloatArray = frequency_grid(low, top, features, wait)
        return dominant.unstable_count(self._form(), grid, dt=dt)

    def characteristic(self, x: ComplexArray) -> ComplexArray:
        """Evaluate a function whose zeros are the poles, and which has no unstable poles.

        For a count of encirclements: the characteristic function over a polynomial of its degree.

        Parameters
        ----------
        x : ndarray, shape (K,)

        Returns
        -------
        ndarray, shape (K,)
        """
        return dominant.characteristic(self._form(), x, discrete=bool(self.dt))

    def features(self) -> tuple[ComplexArray, float]:
        """Poles in the s-plane near which the response turns, and the delay in s that turns it."""
        return self._features()

    def zeros(self) -> ComplexArray:
        """Finite zeros.

        Raises
        ------
        NotImplementedError
            Several channels with long delays.
        """
        form = self._form()
        if self.ninputs == self.noutputs:
            try:
                return characteristic.discrete_poles(inverse(form))
            except np.linalg.LinAlgError:
                pass
        if self.issiso():
            pulses = self.markov(self.nstates + 1)
            (seen,) = np.nonzero(np.abs(pulses) > 1e-14 * np.abs(pulses).max(initial=0.0))
            if seen.size == 0:
                return np.zeros(0, dtype=np.complex128)
            zeros, found = characteristic.siso_zeros(form, self.nstates - int(seen[0]))
            if found:
                return zeros
        if self.nstates > FEW_STATES:
            raise NotImplementedError(
                f"zeros of {self.nstates} states are not found where some of them are multiple, or "
                "the system has several inputs and outputs"
            )
        return np.asarray(super().zeros(), dtype=np.complex128)

    def damp(self) -> Any:
        """Natural frequency, damping and poles; poles at z = 0 have infinite frequency."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().damp()

    def _features(self) -> tuple[ComplexArray, float]:
        """Poles in the s-plane near which the response turns, and the delay in s that turns it."""
        dt = float(self.dt)
        poles = np.concatenate([self._core.poles(), self.dominant_poles(6)])
        poles = poles[np.abs(poles) > 0.05]
        wait = float(sum(self.internal_delays)) * dt
        return np.asarray(np.log(poles) / dt, dtype=np.complex128), wait
