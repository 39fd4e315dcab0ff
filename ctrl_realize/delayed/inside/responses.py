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

    def _in_continuous_time(
        self, kind: str, timepts: Any, inputs: Any, state: ArrayLike, settings: dict[str, Any]
    ) -> ct.TimeResponseData:
        if kind == "step" and np.any(state):
            raise OptionError("a step response starts from rest; use sys.forced_response")
        if kind in ("step", "impulse"):
            return self._unit_motion(timepts, kind, **settings)
        times = self._motion_times(timepts) if kind == "initial" else timepts
        return self._forced_motion(times, inputs, state, **settings)

    def markov(self, count: int) -> FloatArray:
        """Compute the unit-pulse response.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        self._refuse_continuous("impulse_response")
        return self._channels(np.eye(1, integer(count, "count", 1))[0])

    def step(self, count: int) -> FloatArray:
        """Compute the response to a unit step on each input.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        self._refuse_continuous("step_response")
        return self._channels(np.ones(integer(count, "count", 1)))

    def _channels(self, signal: FloatArray) -> FloatArray:
        _, outputs = self._one_by_one(signal)
        return outputs[0, 0] if self.issiso() else outputs

    def _simulated(self, inputs: FloatArray, state: FloatArray | None = None) -> FloatArray:
        return recurrence(self._form(), inputs, state)
