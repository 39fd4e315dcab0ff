"""Frequency and time responses of systems with internal delays."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integer
from ...errors import OptionError
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.internal_delays.recurrence import recurrence
from ...numerics.internal_delays.response import Response
from ..host_responses import HostResponses
from ..operators import DelayOperators
from ..parts import settled_values
from .motion import Motion


class InsideResponses(Motion, HostResponses, DelayOperators):
    """Responses whose cost does not depend on the delays."""

    _core: ct.StateSpace
    _response: Response | None

    def horner(self, x: ArrayLike, warn_infinite: bool = True) -> ComplexArray:
        """Evaluate the transfer matrix, shape (outputs, inputs, K).

        See `control.StateSpace.horner`; the cost does not grow with the delays.
        """
        points = np.atleast_1d(np.asarray(x, dtype=np.complex128))
        if points.ndim > 1:
            raise ValueError("input list must be 1D")
        if self._response is None:
            self._response = Response(self._form(), discrete=bool(self.dt))
        return settled_values(self._response(points), points, warn_infinite=warn_infinite)

    def forced_response(
        self,
        timepts: ArrayLike | None = None,
        inputs: Any = 0.0,
        initial_state: ArrayLike = 0.0,
        **settings: Any,
    ) -> ct.TimeResponseData:
        """Compute the response to any input, see `control.forced_response`.

        Parameters
        ----------
        timepts : array_like
            Times in s, increasing from 0 (continuous time), or every sample.
        inputs : array_like or callable
            Values at these times, linear between them in continuous time; or a function of an
            array of K times that returns values of shape (inputs, K).
        initial_state : array_like, optional
            In discrete time of all states, in the order of ``state_labels``; in continuous time of
            the core.
        **settings
            ``squeeze`` and ``transpose``; in discrete time those of `control.forced_response`. In
            continuous time also ``history``, the constant input of each delay before time 0
            (default 0); and ``tolerance``, the largest error relative to the largest output (1e-8).

        Returns
        -------
        control.TimeResponseData

        Notes
        -----
        In continuous time the delay differential equation is solved by the method of steps, with
        all breaking points; all steps are halved until the result no longer changes [1]_.

        References
        ----------
        .. [1] A. Bellen and M. Zennaro, Numerical Methods for Delay Differential Equations, Oxford
           University Press 2003, chapters 2 and 3, doi:10.1093/acprof:oso/9780198506546.001.0001.
        """
        if self.dt:
            return super().forced_response(timepts, inputs, initial_state, **settings)
        return self._forced_motion(timepts, inputs, initial_state, **settings)

    def initial_response(
        self,
        timepts: ArrayLike | float | None = None,
        initial_state: ArrayLike = 0.0,
        **settings: Any,
    ) -> ct.TimeResponseData:
        """Compute the response to an initial state, see `control.initial_response`.

        In continuous time of the core, with ``history`` and ``tolerance`` as in `forced_response`.
        """
        if self.dt:
            return super().initial_response(timepts, initial_state, **settings)
        times = self._motion_times(timepts)
        return self._forced_motion(times, 0.0, initial_state, **settings)

    def step_response(
        self,
        timepts: ArrayLike | float | None = None,
        initial_state: ArrayLike = 0.0,
        **settings: Any,
    ) -> ct.TimeResponseData:
        """Compute the step responses, see `control.step_response`.

        Without `timepts` until the slowest pole has decayed; in discrete time for 5000 samples at
        most. In continuous time from zero initial state, and ``tolerance`` is accepted as in
        `forced_response`.
        """
        if self.dt:
            return super().step_response(timepts, initial_state, **settings)
        if np.any(initial_state):
            raise OptionError("a step response starts from rest; use sys.forced_response")
        return self._unit_motion(timepts, "step", **settings)

    def impulse_response(
        self, timepts: ArrayLike | float | None = None, **settings: Any
    ) -> ct.TimeResponseData:
        """Compute the impulse responses from zero initial state, see `control.impulse_response`.

        In continuous time the slope of the step response; impulses in the output are omitted.
        """
        if self.dt:
            return super().impulse_response(timepts, **settings)
        return self._unit_motion(timepts, "impulse", **settings)

    def markov(self, count: int) -> FloatArray:
        """Compute the unit-pulse response.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        pulse = np.zeros(integer(count, "count", 1))
        pulse[0] = 1.0
        return self._one_by_one(pulse, "impulse_response")

    def step(self, count: int) -> FloatArray:
        """Compute the response to a unit step on each input.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        return self._one_by_one(np.ones(integer(count, "count", 1)), "step_response")

    def _one_by_one(self, signal: FloatArray, instead: str) -> FloatArray:
        self._refuse_continuous(instead)
        form, m = self._form(), self.ninputs
        out = np.empty((self.noutputs, m, signal.size))
        for j in range(m):
            inputs = np.zeros((m, signal.size))
            inputs[j] = signal
            out[:, j] = recurrence(form, inputs)
        return out[0, 0] if self.issiso() else out

    def _simulated(self, inputs: FloatArray, state: FloatArray | None = None) -> FloatArray:
        return recurrence(self._form(), inputs, state)
