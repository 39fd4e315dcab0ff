"""Frequency and time responses, from core and delay."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._checks import integer
from ..numerics.arrays import ComplexArray, FloatArray, later
from ..numerics.internal_delays.recurrence import recurrence
from ..numerics.internal_delays.stability import in_s_plane
from ..numerics.state_space import responses
from .chains import powers
from .host_responses import HostResponses
from .parts import CoreAndDelays, matrices_of


class DelayedResponses(HostResponses, CoreAndDelays):
    """Responses whose cost does not grow with the delay."""

    def _values(self, schur: responses.Schur, points: ComplexArray) -> ComplexArray:
        core = self._core
        with np.errstate(divide="ignore", invalid="ignore"):
            out = responses.frequency_response(schur, core.B, core.C, core.D, points)
            if any(self.input_delays):
                out = out * powers(points, self.input_delays)[None, :, :]
            if any(self.output_delays):
                out = out * powers(points, self.output_delays)[:, None, :]
        return out

    def markov(self, count: int) -> FloatArray:
        """Compute the unit-pulse response, delay included.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        return self._with_delay(responses.markov, integer(count, "count", 1))

    def step(self, count: int) -> FloatArray:
        """Compute the response to a unit step on each input, delay included.

        The delay is not simulated, so the cost does not depend on it.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        return self._with_delay(responses.step_response, integer(count, "count", 1))

    def _simulated(self, inputs: FloatArray, state: FloatArray | None = None) -> FloatArray:
        if state is not None:
            return recurrence(self._form(), inputs, state)
        held = np.stack([later(u, d) for u, d in zip(inputs, self.input_delays, strict=True)])
        out = responses.simulate(*matrices_of(self._core), held)
        return np.stack([later(y, q) for y, q in zip(out, self.output_delays, strict=True)])

    def features(self) -> tuple[ComplexArray, float]:
        """Poles in the s-plane where the response changes quickly, and the largest delay in s."""
        return in_s_plane(self._core.poles(), self.dt), float(np.max(self.delay)) * self.dt

    def _with_delay(self, response: Any, count: int) -> FloatArray:
        free: FloatArray = response(*matrices_of(self._core), count)
        out = np.zeros_like(free)
        for i, behind in enumerate(self.output_delays):
            for j, before in enumerate(self.input_delays):
                out[i, j] = later(free[i, j], before + behind)
        return np.asarray(out[0, 0] if self.issiso() else out, dtype=np.float64)
