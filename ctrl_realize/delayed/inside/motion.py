"""Time responses of continuous systems with dead time, from the delay differential equation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import finite, integer, positive
from ...errors import DataError, ModelWarning, UnsuitableSystemError, warn_caller
from ...numerics.arrays import FloatArray
from ...numerics.constants import SMALLEST
from ...numerics.internal_delays.equation import Signal, TooManyStepsError, response_times, solve
from ..host_responses import called, laid_out, spread
from .poles import InsidePoles

LEAST = 400
"""Intervals between the times of a response, by default."""

TOLERANCE = 1e-8
"""Largest error of a response, relative to its largest value."""


class Motion(InsidePoles):
    """Responses of a continuous system, with a bound on their error."""

    def _forced_motion(
        self,
        timepts: ArrayLike | None,
        inputs: ArrayLike | Callable[[FloatArray], FloatArray] = 0.0,
        initial_state: ArrayLike = 0.0,
        *,
        shown: Mapping[str, Any],
        history: ArrayLike = 0.0,
        tolerance: float = TOLERANCE,
    ) -> ct.TimeResponseData:
        """Compute the response to any input, linear between the given times."""
        times = _checked_times(timepts, self.name)
        if callable(inputs):
            signal, breaks = called(inputs, self.ninputs), np.zeros(0)
        else:
            rows = self._input_rows(laid_out(inputs, shown), times.size)
            signal = _between(times, rows)
            kinks = np.abs(np.diff(rows, 2)) > 1e-12 * np.abs(rows).max(initial=0.0)
            breaks = times[1:-1][kinks.any(axis=0)]
        outputs = self._solved(
            signal, times, breaks, tolerance, initial_state=initial_state, history=history
        )
        return self._data(times, outputs, signal(times), plot_inputs=True, **shown)

    def _unit_motion(
        self,
        timepts: ArrayLike | float | None,
        kind: str,
        *,
        shown: Mapping[str, Any],
        tolerance: float = TOLERANCE,
        timepts_num: int | None = None,
    ) -> ct.TimeResponseData:
        """Compute the responses to a unit step, or a unit impulse, on each input."""
        times = self._motion_times(timepts)
        if timepts_num is not None and (timepts is None or np.size(timepts) == 1):
            times = np.linspace(0, times[-1], integer(timepts_num, "timepts_num", 2))
        drive, pulse = np.eye(self.ninputs)[:, :, None] * np.ones(times.size), kind == "impulse"
        every = [
            self._solved(_between(times, rows), times, np.zeros(0), tolerance, slope=pulse)
            for rows in drive
        ]
        return self._unit_responses(times, np.stack(every, axis=1), drive, kind, **shown)

    def _solved(
        self,
        signal: Signal,
        times: FloatArray,
        breaks: FloatArray,
        tolerance: float,
        *,
        initial_state: ArrayLike = 0.0,
        history: ArrayLike = 0.0,
        slope: bool = False,
    ) -> FloatArray:
        form = self._form()
        if slope and not form.states:  # that of steps, of which nothing but rounding is left
            return np.zeros((form.outputs, times.size))
        wanted = positive(tolerance, "tolerance", "largest error, relative to the largest output")
        state = spread(initial_state, form.states, "initial_state")
        before = spread(history, len(form.delays), "history")
        try:
            outputs, error = solve(form, signal, times, breaks, state, before, wanted, slope=slope)
        except TooManyStepsError as needed:
            raise UnsuitableSystemError(
                f"{times[-1]:g} s need {needed} steps, each no longer than the shortest delay "
                f"({min(form.delays, default=0.0):g} s): give shorter timepts, omit the shortest "
                "delay, or use a rational approximation (sys.pade)"
            ) from None
        size = float(np.abs(outputs).max(initial=0.0))
        if not error <= wanted * max(size, 1e-300) and size > 0:
            warn_caller(
                f"when all steps were halved for the last time, the response changed by "
                f"{error:.2g} of at most {size:.3g}; the relative tolerance is {wanted:g}. "
                "Give closer timepts",
                ModelWarning,
            )
        return outputs

    def _motion_times(self, timepts: ArrayLike | float | None) -> FloatArray:
        """Check the given times, or make those up to an end or until the response has settled."""
        if timepts is None or np.size(timepts) == 1:
            end = self._settling() if timepts is None else np.asarray(timepts).item()
            end = positive(end, "timepts", "time in s")
            fastest = float(np.abs(self.dominant_poles(4)).max(initial=SMALLEST))
            return response_times(end, 1 / fastest, LEAST)
        return _checked_times(timepts, self.name)

    def _settling(self) -> float:
        """Estimate a time in s at which a response has settled, or is seen not to settle."""
        poles = self.dominant_poles(4)
        rates = np.abs(poles.real[np.abs(poles.real) > 1e-6 * np.abs(poles)])
        slow = 6 / float(rates.min()) if rates.size else 0.0
        delay = float(sum(self.internal_delays))
        return min(max(slow + delay, 5 * delay), 100 * delay + slow) or 1.0


def _between(times: FloatArray, rows: FloatArray) -> Signal:
    """Make the signal that is linear between the given values (m, K)."""
    return lambda t: np.stack([np.interp(t, times, row) for row in rows])


def _checked_times(timepts: ArrayLike | None, name: str) -> FloatArray:
    if timepts is None:
        raise DataError(f"{name!r} is continuous; give timepts, the times in s")
    times = finite(timepts, "timepts")
    if times.ndim != 1 or times.size < 2 or times[0] != 0 or np.any(np.diff(times) <= 0):
        raise DataError("timepts must increase from 0 and have at least two values")
    return times
