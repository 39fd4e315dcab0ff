"""Frequency and time responses of systems with internal delays."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import finite, whole
from ...errors import DataError
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.internal_delays.recurrence import recurrence
from ...numerics.internal_delays.response import Response
from ..host_responses import HostResponses
from ..operators import DelayOperators
from ..parts import settled_values


class InsideResponses(HostResponses, DelayOperators):
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

    def markov(self, count: int) -> FloatArray:
        """Compute the unit-pulse response.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        pulse = np.zeros(whole(count, "count", 1))
        pulse[0] = 1.0
        return self._one_by_one(pulse)

    def step(self, count: int) -> FloatArray:
        """Compute the response to a unit step on each input.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        return self._one_by_one(np.ones(whole(count, "count", 1)))

    def simulate(self, inputs: ArrayLike) -> FloatArray:
        """Compute the response to any input from zero initial state, sample by sample.

        Parameters
        ----------
        inputs : array_like, shape (N,) or (inputs, N)

        Returns
        -------
        ndarray, shape (N,) or (outputs, N)

        Raises
        ------
        DataError
            A wrong number of inputs, or values that are not finite real numbers.
        """
        given = finite(inputs, "inputs")
        rows = np.atleast_2d(given)
        if rows.ndim != 2 or rows.shape[0] != self.ninputs:
            raise DataError(
                f"inputs has shape {given.shape}; expected ({self.ninputs}, N)"
                + (" or (N,)" if self.ninputs == 1 else "")
            )
        out = recurrence(self._form(), rows)
        return out[0] if self.issiso() and given.ndim == 1 else out

    def _one_by_one(self, signal: FloatArray) -> FloatArray:
        form, m = self._form(), self.ninputs
        out = np.empty((self.noutputs, m, signal.size))
        for j in range(m):
            inputs = np.zeros((m, signal.size))
            inputs[j] = signal
            out[:, j] = recurrence(form, inputs)
        return out[0, 0] if self.issiso() else out

    def _simulated(self, inputs: FloatArray) -> Any:
        return recurrence(self._form(), inputs)
