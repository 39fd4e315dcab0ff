"""True parameters of a simulated set-up, for comparison with estimates."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from .._checks import numbers
from .._wording import in_time
from ..data import MeasuredFRF
from ..delayed import DelayedStateSpace, delayed_ss
from ..errors import OptionError
from ..numerics.arrays import ComplexArray, FloatArray
from ..results import Result
from .linear import Core, dc_gain


@dataclass(frozen=True, eq=False, repr=False)
class PlantTruth(Result):
    """The linear part of a simulated plant, from its input to the measured output.

    ``response(omega) == C (j omega I - A)^-1 B exp(-j omega dead_time)`` with the matrices of the
    continuous `core`; `sampled` is its exact model with a zero-order hold. Noise, disturbances and
    rounding are not included.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D of all lags. An integrator is the last state.
    dead_time : float
        Transport delay in s.
    dt : float
        Sample time in s.
    units : tuple of str
        Units of input and output.
    plant : str
        What is simulated.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> truth = cr.bench.tank().truth
    >>> truth.dead_time, truth.integrating_rate, truth.gain
    (12.0, 0.01, inf)
    """

    matrices: Core
    dead_time: float
    dt: float
    units: tuple[str, str] = ("", "")
    plant: str = "plant"

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
        """Static gain, output per input; infinite for an integrating plant."""
        rate = self.integrating_rate
        return dc_gain(self.matrices) if rate is None else float(np.copysign(np.inf, rate))

    @property
    def integrating_rate(self) -> float | None:
        """Slope of the output per s and input, of an integrating plant; None for any other."""
        inner = self._before_integrator
        return None if inner is None else dc_gain(inner)

    @property
    def _before_integrator(self) -> Core | None:
        """The lags that act on the slope of an integrating plant."""
        A, B, C, D = self.matrices
        if np.any(A[:, -1]):
            return None
        return A[:-1, :-1], B[:-1], C[0, -1] * A[-1:, :-1], D + C[0, -1] * B[-1:]

    @property
    def total_delay(self) -> float:
        """Total delay at DC in s: dead time plus the sum of all lags, without an integrator."""
        core = self._before_integrator or self.matrices
        A, B, C, _ = core
        first = np.linalg.solve(A, B)
        return self.dead_time + float((C @ np.linalg.solve(A, first))[0, 0]) / dc_gain(core)

    @property
    def sampled(self) -> DelayedStateSpace:
        """Exact model of held input and sampled output, at the plant's sample time."""
        return delayed_ss(self.core, dead_time=self.dead_time, dt=self.dt, name="truth_simulated")

    def response(self, omega: FloatArray) -> ComplexArray:
        """Evaluate the frequency response at `omega` in rad/s, dead time included."""
        points = 1j * numbers(omega, "omega")
        if self.integrating_rate is not None and np.any(points == 0):
            raise OptionError("the plant is integrating: its response at omega=0 is infinite")
        values = self.core(points.ravel(), squeeze=False)[0, 0]
        return np.asarray(values.reshape(points.shape) * np.exp(-points * self.dead_time))

    def frf(self, frequency_hz: FloatArray) -> MeasuredFRF:
        """Evaluate the frequency response as an FRF object, ready for plots and comparisons."""
        grid = numbers(frequency_hz, "frequency_hz")
        return MeasuredFRF(self.response(2 * np.pi * grid), grid, name="truth (simulated)")

    def _title(self) -> str:
        return f"Simulated {self.plant}: truth"

    def _rows(self) -> list[tuple[str, str]]:
        poles = np.sort_complex(np.linalg.eigvals(self.matrices[0]))[::-1] / (2 * np.pi)
        shown = [
            f"{abs(p):.5g} Hz" + (f" (damping {-p.real / abs(p):.2g})" if p.imag > 0 else "")
            for p in poles
            if p.imag >= 0
        ]
        unit = f"{self.units[1]}/{self.units[0]}"
        rate = self.integrating_rate
        gain = ("gain", f"{self.gain:.4g} {unit}")
        return [
            gain if rate is None else ("integrating", f"{rate:.4g} {unit} per s"),
            ("poles", ", ".join(shown)),
            ("dead time", f"{in_time(self.dead_time, 5)} = {self.delay:.5g} samples"),
            ("total delay at DC", in_time(self.total_delay, 5)),
        ]

    def __repr__(self) -> str:
        order = self.matrices[0].shape[0]
        return f"<{type(self).__name__} order {order}, dead time {self.delay:g} samples>"


@dataclass(frozen=True, eq=False, repr=False)
class ValveTruth(PlantTruth):
    """The linear part of a simulated valve, from drive current to measured displacement.

    As `PlantTruth`: converter, actuator, LVDT (and analog anti-aliasing filter), in mm per mA.
    Friction, slew limits and random effects are not included.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D.
    dead_time : float
        Transport delay in s.
    dt : float
        Sample time in s.
    units : tuple of str
    plant : str

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> truth = cr.bench.valve().truth
    >>> gain = abs(truth.response(2 * np.pi * 2.0))
    >>> print(f"{truth.dead_time / truth.dt:.1f} samples, {gain:.3f} mm/mA at 2 Hz")
    37.0 samples, 0.092 mm/mA at 2 Hz
    """

    units: tuple[str, str] = ("mA", "mm")
    plant: str = "valve"
