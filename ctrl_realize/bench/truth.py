"""True parameters of a simulated set-up, for comparison with estimates."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from .._checks import numbers
from .._wording import in_time
from ..data import MeasuredFRF
from ..delayed import DelayedStateSpace, delayed_ss
from ..numerics.arrays import ComplexArray, FloatArray
from ..results import Result
from .linear import Core, dc_gain


@dataclass(frozen=True, eq=False)
class ValveTruth(Result):
    """The linear part of a simulated valve, from drive current to measured displacement.

    ``response(omega) == C (j omega I - A)^-1 B exp(-j omega dead_time)`` with the matrices of the
    continuous `core`; `sampled` is its exact model with a zero-order hold. Friction, slew limits
    and random effects are not included.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D of converter, actuator, LVDT (and analog anti-aliasing filter), in mm per mA.
    dead_time : float
        Transport delay in s.
    dt : float
        Sample time in s.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> truth = cr.bench.valve().truth
    >>> gain = abs(truth.response(2 * np.pi * 2.0))
    >>> print(f"{truth.dead_time / truth.dt:.1f} samples, {gain:.3f} mm/mA at 2 Hz")
    37.0 samples, 0.092 mm/mA at 2 Hz
    """

    matrices: Core
    dead_time: float
    dt: float

    @property
    def core(self) -> ct.StateSpace:
        """The continuous system without its dead time."""
        return ct.ss(*self.matrices, name="truth_simulated", inputs="u", outputs="y")

    @property
    def delay(self) -> float:
        """Transport delay in samples; not necessarily whole."""
        return self.dead_time / self.dt

    @property
    def gain(self) -> float:
        """Static gain in mm per mA."""
        return dc_gain(self.matrices)

    @property
    def total_delay(self) -> float:
        """Total delay at DC in s: dead time plus the sum of all lags."""
        A, B, C, _ = self.matrices
        first = np.linalg.solve(A, B)
        return self.dead_time + float((C @ np.linalg.solve(A, first))[0, 0]) / self.gain

    @property
    def sampled(self) -> DelayedStateSpace:
        """Exact model of held input and sampled output, at the valve's sample time."""
        return delayed_ss(self.core, dead_time=self.dead_time, dt=self.dt, name="truth_simulated")

    def response(self, omega: FloatArray) -> ComplexArray:
        """Evaluate the frequency response at `omega` in rad/s, dead time included."""
        A, B, C, _ = self.matrices
        points = 1j * numbers(omega, "omega")
        systems = points.reshape(-1, 1, 1) * np.eye(A.shape[0]) - A
        values = (C @ np.linalg.solve(systems, B.astype(complex)))[:, 0, 0]
        return np.asarray(values.reshape(points.shape) * np.exp(-points * self.dead_time))

    def frf(self, frequency_hz: FloatArray) -> MeasuredFRF:
        """Evaluate the frequency response as an FRF object, ready for plots and comparisons."""
        grid = numbers(frequency_hz, "frequency_hz")
        return MeasuredFRF(self.response(2 * np.pi * grid), grid, name="truth (simulated)")

    def _title(self) -> str:
        return "Simulated valve: truth"

    def _rows(self) -> list[tuple[str, str]]:
        poles = np.sort_complex(np.linalg.eigvals(self.matrices[0]))[::-1] / (2 * np.pi)
        shown = [
            f"{abs(p):.5g} Hz" + (f" (damping {-p.real / abs(p):.2g})" if p.imag > 0 else "")
            for p in poles
            if p.imag >= 0
        ]
        return [
            ("gain", f"{self.gain:.4g} mm/mA"),
            ("poles", ", ".join(shown)),
            ("dead time", f"{in_time(self.dead_time, 5)} = {self.delay:.5g} samples"),
            ("total delay at DC", in_time(self.total_delay, 5)),
        ]

    def __repr__(self) -> str:
        return f"<ValveTruth order {self.matrices[0].shape[0]}, dead time {self.delay:g} samples>"
