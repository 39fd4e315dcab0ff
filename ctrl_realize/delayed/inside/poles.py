"""Poles and zeros of systems with internal delays, computed on demand."""

from __future__ import annotations

import numpy as np

from ..._checks import integer
from ...errors import UnsuitableSystemError
from ...numerics.arrays import ComplexArray
from ...numerics.internal_delays import characteristic, dominant, spectrum, stability
from ...numerics.internal_delays.form import inverse
from ..host_responses import HostResponses
from ..operators import DelayOperators

FEW_STATES = 400
"""Number of states up to which zeros of several channels are computed from the matrices."""

FIRST_POLES, MOST_POLES = 20, 640
"""Number of right-most poles of a continuous loop: computed at first, and at most."""


class InsidePoles(HostResponses, DelayOperators):
    """Roots of the characteristic function; the matrices of the delays are not formed."""

    internal_delays: tuple[float, ...]

    def poles(self) -> ComplexArray:
        """All poles of a discrete system; the right-most ones of a continuous one.

        A continuous loop with dead time has infinitely many poles: those with positive real part
        are returned, and at least 20. See `dominant_poles` for the slowest few.
        """
        form = self._form()
        if self.dt:
            return characteristic.discrete_poles(form)
        count = FIRST_POLES
        poles = spectrum.rightmost_poles(form, count)
        while poles.size >= count < MOST_POLES and poles.real.min() > 0:
            count *= 2
            poles = spectrum.rightmost_poles(form, count)
        return poles

    def dominant_poles(self, count: int = 10) -> ComplexArray:
        """Compute the poles that decay most slowly, or grow fastest.

        The right-most ones in continuous time, those of largest magnitude in discrete time.

        Parameters
        ----------
        count : int, optional
            Number of poles; one more if a pair would be split.

        Returns
        -------
        ndarray, shape (count,)
            Descending in real part, or in magnitude.

        Notes
        -----
        Each is a root of the characteristic function to 1e-10. In discrete time with up to 400
        states, and mostly with several long delays too, all poles are computed first (0.2 s for
        1000 of them, a minute for 10 000); otherwise Newton's method starts from points around the
        unit circle, and the argument principle checks that none is missing. In continuous time it
        starts from the eigenvalues of a spectral discretisation of the delays [1]_.

        References
        ----------
        .. [1] D. Breda, S. Maset and R. Vermiglio, Pseudospectral differencing methods for
           characteristic roots of delay differential equations, SIAM J. Sci. Comput. 27 (2005)
           482-495, doi:10.1137/030601600.

        Examples
        --------
        >>> import control as ct
        >>> import ctrl_realize as cr
        >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=10, dt=0.001)
        >>> loop = ct.feedback(plant * 0.5)
        >>> loop.nstates, abs(loop.dominant_poles(1)).round(6)
        (10001, array([0.999931, 0.999931]))
        """
        find = dominant.dominant_discrete_poles if self.dt else spectrum.rightmost_poles
        return find(self._form(), integer(count, "count", 1))

    def is_stable(self) -> bool:
        """Whether all poles are inside the stability region.

        Determined by the argument principle, without computing poles; False if a pole is too close
        to the stability boundary for a decision, and for a continuous system of neutral type that
        is unstable for arbitrarily small changes of its delays.
        """
        if self.neutral_gain() >= 1:
            return False
        count, marginal = stability.unstable_count(self._form(), float(self.dt or 0))
        return count == 0 and not marginal

    def neutral_gain(self) -> float:
        """High-frequency gain of loops that consist only of delays and gains; 0 without such loops.

        A continuous system with such loops is of neutral type. If the gain is 1 or more, it has
        infinitely many unstable poles, or would have for slightly different delays [1]_. Always 0
        in discrete time.

        References
        ----------
        .. [1] W. Michiels and S.-I. Niculescu, Stability, Control, and Computation for Time-Delay
           Systems, 2nd ed., SIAM 2014, section 1.2, doi:10.1137/1.9781611973631.
        """
        return 0.0 if self.dt else spectrum.neutral_gain(self._form())

    def characteristic(self, x: ComplexArray) -> ComplexArray:
        """Evaluate a function whose zeros are the poles, and which has no unstable poles.

        For counting encirclements: the characteristic function divided by a polynomial of its
        degree.

        Parameters
        ----------
        x : ndarray, shape (K,)

        Returns
        -------
        ndarray, shape (K,)
        """
        return stability.characteristic(self._form(), x, discrete=bool(self.dt))

    def zeros(self) -> ComplexArray:
        """Finite zeros; for a continuous loop with dead time the right-most ones.

        Raises
        ------
        UnsuitableSystemError
            Several channels with long delays.
        """
        form = self._form()
        try:
            opposite = inverse(form)
        except np.linalg.LinAlgError:
            if not self.dt:
                return spectrum.rightmost_zeros(form, FIRST_POLES)
        else:
            if not self.dt:
                return spectrum.rightmost_poles(opposite, FIRST_POLES)
            return characteristic.discrete_poles(opposite)
        if self.issiso():
            pulses = self.markov(self.nstates + 1)
            (seen,) = np.nonzero(np.abs(pulses) > 1e-14 * np.abs(pulses).max(initial=0.0))
            if seen.size == 0:
                return np.zeros(0, dtype=np.complex128)
            zeros, found = characteristic.siso_zeros(form, self.nstates - int(seen[0]))
            if found:
                return zeros
        if self.nstates > FEW_STATES:
            raise UnsuitableSystemError(
                f"{self.name!r} has {self.nstates} states; with several inputs and outputs, or "
                f"with multiple zeros, zeros are computed for {FEW_STATES} at most. Use a longer "
                "sample time, or the zeros of single channels (sys[i, j].zeros())"
            )
        return np.asarray(super().zeros(), dtype=np.complex128)

    def features(self) -> tuple[ComplexArray, float]:
        """Poles in the s-plane where the response changes quickly, and the largest delay in s."""
        return stability.features(self._form(), float(self.dt or 0))
