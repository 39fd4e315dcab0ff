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
from ...numerics.internal_delays.response import response
from ...numerics.state_space.responses import Schur
from ..host_responses import PLAIN, HostResponses
from ..operators import DelayOperators
from .motion import Motion

_HOST_NAMES = {
    "T": "timepts",
    "T_num": "timepts_num",
    "input": "input_indices",
    "output": "output_indices",
}
"""Short names of arguments, as python-control has them."""


class InsideResponses(Motion, HostResponses, DelayOperators):
    """Responses whose cost does not depend on the delays."""

    def _values(self, schur: Schur, points: ComplexArray) -> ComplexArray:
        return response(self._form(), schur, points, discrete=bool(self.dt))

    def _responded(
        self, kind: str, timepts: Any, inputs: Any, state: ArrayLike, settings: dict[str, Any]
    ) -> ct.TimeResponseData:
        if self.dt:
            return super()._responded(kind, timepts, inputs, state, settings)
        if kind == "step" and np.any(state):
            raise OptionError("a step response starts from rest; use sys.forced_response")
        shown = {key: settings.pop(key) for key in PLAIN & settings.keys()}
        if kind in ("step", "impulse"):
            known = {_HOST_NAMES.get(key, key): value for key, value in settings.items()}
            if unknown := set(known) - {*_HOST_NAMES.values(), "tolerance"}:
                raise TypeError(f"unrecognized keyword(s): {', '.join(sorted(unknown))}")
            chosen = [known.pop(f"{side}_indices", None) for side in ("output", "input")]
            if chosen != [None, None]:
                part = self[tuple(slice(None) if each is None else each for each in chosen)]
            else:
                part = self
            return part._unit_motion(**{"timepts": timepts, **known}, kind=kind, shown=shown)
        times = self._motion_times(timepts) if kind == "initial" else timepts
        return self._forced_motion(times, inputs, state, shown=shown, **settings)

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
