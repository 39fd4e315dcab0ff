"""Methods of python-control systems, computed from core and delays.

``sys.step_response(...)`` and similar are methods of every linear system of python-control. The
functions of the same names use the matrices, which takes longer for longer delays; the methods here
simulate with delay lines.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import finite
from ..errors import DataError, UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.loops.crossings import follow, frequency_grid
from .deferred import DeferredMatrices

FINE = 0.1
"""Phase in rad between the points of a response from which margins are interpolated: the cubic
spline of python-control is then accurate to 1e-6."""

DECIDES = 0.2
"""Least relative gain that matters for a margin; beyond the last frequency with such a gain the
response is left out."""


class HostResponses(DeferredMatrices):
    """Time responses, and the frequency response for margins."""

    @abstractmethod
    def _simulated(self, inputs: FloatArray) -> FloatArray:
        """Compute the outputs (p, N) from zero initial state."""

    @abstractmethod
    def features(self) -> tuple[ComplexArray, float]:
        """Poles in the s-plane where the response changes quickly, and the largest delay in s."""

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
        UnsuitableSystemError
            A continuous system.
        """
        self._refuse_continuous("forced_response")
        given = finite(inputs, "inputs")
        rows = np.atleast_2d(given)
        if rows.ndim != 2 or rows.shape[0] != self.ninputs:
            raise DataError(
                f"inputs has shape {given.shape}; expected ({self.ninputs}, N)"
                + (" or (N,)" if self.ninputs == 1 else "")
            )
        out = self._simulated(rows)
        return out[0] if self.issiso() and given.ndim == 1 else out

    def _refuse_continuous(self, instead: str) -> None:
        if not self.dt:
            raise UnsuitableSystemError(
                f"{self.name!r} is continuous and has no samples; use sys.{instead}(timepts)"
            )

    def forced_response(
        self, timepts: ArrayLike | None = None, inputs: ArrayLike = 0.0, *args: Any, **settings: Any
    ) -> ct.TimeResponseData:
        """Compute the response to any input from zero initial state, see `control.forced_response`.

        With an initial state, or if the states are requested, python-control simulates with the
        matrices.
        """
        if args or set(settings) - {"squeeze", "transpose"} or not self.dt:
            return super().forced_response(timepts, inputs, *args, **settings)
        given = np.atleast_2d(finite(inputs, "inputs"))
        times = self._times(timepts, given.shape[-1])
        rows = np.broadcast_to(given, (self.ninputs, times.size)) if given.size == 1 else given
        if rows.shape != (self.ninputs, times.size):
            raise DataError(
                f"inputs has shape {np.shape(inputs)}; expected ({self.ninputs}, {times.size})"
            )
        return ct.TimeResponseData(
            times,
            self._simulated(np.ascontiguousarray(rows)),
            inputs=rows,
            issiso=self.issiso(),
            input_labels=self.input_labels,
            output_labels=self.output_labels,
            sysname=self.name,
            plot_inputs=True,
            **settings,
        )

    def step_response(
        self, timepts: ArrayLike | float | None = None, *args: Any, **settings: Any
    ) -> ct.TimeResponseData:
        """Compute the step responses from zero initial state, see `control.step_response`."""
        if args or timepts is None or set(settings) - {"squeeze", "transpose"} or not self.dt:
            return super().step_response(timepts, *args, **settings)
        return self._traces(timepts, "step", 1.0, settings)

    def impulse_response(
        self, timepts: ArrayLike | float | None = None, *args: Any, **settings: Any
    ) -> ct.TimeResponseData:
        """Compute the responses to pulses of height 1/dt, see `control.impulse_response`."""
        if args or timepts is None or set(settings) - {"squeeze", "transpose"} or not self.dt:
            return super().impulse_response(timepts, *args, **settings)
        return self._traces(timepts, "impulse", 1 / self.dt, settings)

    def _traces(
        self, timepts: ArrayLike | float, kind: str, height: float, settings: dict[str, Any]
    ) -> ct.TimeResponseData:
        if np.size(timepts) == 1:
            timepts = np.arange(int(float(np.ravel(timepts)[0]) / self.dt) + 1) * self.dt
        times = self._times(timepts, 0)
        signal = np.zeros(times.size)
        signal[: 1 if kind == "impulse" else None] = height
        m = self.ninputs
        drive = np.zeros((m, m, times.size))
        drive[np.arange(m), np.arange(m)] = signal
        outputs = np.stack([self._simulated(drive[:, j]) for j in range(m)], axis=1)
        return self._unit_responses(times, outputs, drive, kind, **settings)

    def _unit_responses(
        self, times: FloatArray, outputs: FloatArray, drive: FloatArray, kind: str, **settings: Any
    ) -> ct.TimeResponseData:
        """Response data, one trace for each input, as python-control makes them."""
        return ct.TimeResponseData(
            times,
            outputs,
            inputs=drive if kind == "step" else None,
            issiso=self.issiso(),
            input_labels=self.input_labels if kind == "step" else None,
            output_labels=self.output_labels,
            sysname=self.name,
            trace_labels=[f"From {label}" for label in self.input_labels],
            trace_types=[kind] * self.ninputs,
            plot_inputs=False,
            **settings,
        )

    def _times(self, timepts: ArrayLike | None, count: int) -> FloatArray:
        """Check that times are all samples from 0, or make as many as there are inputs."""
        if timepts is None:
            return np.asarray(np.arange(count) * float(self.dt), dtype=np.float64)
        times = finite(timepts, "timepts")
        expected = np.arange(times.size) * float(self.dt)
        if times.ndim != 1 or not np.allclose(times, expected, rtol=0, atol=1e-6 * self.dt):
            raise DataError(
                f"timepts must be every sample from 0, each {self.dt:g} s; control.forced_response "
                "takes other times"
            )
        return times

    def __len__(self) -> int:
        return 3

    def __iter__(self) -> Iterator[FloatArray]:
        """Unpack as magnitude, phase in degrees, and omega: what `control.margin` accepts.

        `control.margin` and `control.stability_margins` accept three such arrays, or anything that
        unpacks into them, instead of a system. So they use the exact response instead of a
        polynomial.

        Raises
        ------
        UnsuitableSystemError
            More than one input or output.
        """
        if not self.issiso():
            raise UnsuitableSystemError(
                f"{self.name!r} has {self.ninputs} inputs and {self.noutputs} outputs; margins are "
                "those of one of each"
            )
        omega, values = self._followed()
        phase = np.degrees(np.unwrap(np.angle(values)))
        return iter((np.abs(values), phase, omega))

    def _followed(self) -> tuple[FloatArray, ComplexArray]:
        """Frequencies so close that the response between them can be interpolated."""
        features, wait = self.features()
        sizes = np.abs(features)
        sizes = sizes[sizes > 0]
        dt = float(self.dt)
        fastest = float(sizes.max(initial=1 / wait if wait else 1.0))
        top = np.pi / dt if dt else self._gain_is_gone(fastest)
        low = 1e-3 * min(float(sizes.min(initial=top)), 1 / wait if wait else top)

        def curve(omega: FloatArray) -> ComplexArray:
            x = np.exp(1j * omega * dt) if dt else 1j * omega
            return np.asarray(self.horner(x, warn_infinite=False)[0, 0])

        omega, values = follow(curve, frequency_grid(low, top, features, wait))
        omega, values = follow(curve, omega[: _last(values)], FINE)
        known = np.isfinite(values)
        return omega[known], values[known]

    def _gain_is_gone(self, fastest: float) -> float:
        """Find a frequency above which the gain of a system is too low for any margin."""
        omega = fastest * np.geomspace(1e-3, 1e5, 4000)
        size = np.abs(self.horner(1j * omega, warn_infinite=False)[0, 0])
        (large,) = np.nonzero(
            ~(size < 0.1 * DECIDES * min(1.0, float(np.median(size[:100])) or 1.0))
        )  # a gain that does not roll off is evaluated up to ten times the fastest pole
        last = int(large[-1]) if large.size else 0
        return float(omega[last + 1]) if last + 1 < omega.size else 10 * fastest


def _last(values: ComplexArray) -> int:
    """Count the points up to the last one that matters for the margins.

    The gain is a fifth of 1 there, or of the largest gain at a phase of -180 degrees:
    python-control takes a minute for the turns of the phase beyond.
    """
    size = np.abs(values)
    across = (values.imag[1:] < 0) != (values.imag[:-1] < 0)
    across &= values.real[1:] + values.real[:-1] < 0
    level = DECIDES * min(1.0, float(size[1:][across].max(initial=0.0)) or 1.0)
    (above,) = np.nonzero(~(size < level))
    return int(above[-1]) + 3 if above.size else values.size
