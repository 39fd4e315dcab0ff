"""The result of fitting a transfer function with dead time to a frequency response."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import control as ct
import numpy as np

from .._checks import numbers
from .._wording import in_time, interval_in_time, time_and_interval, time_within
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.constants import Z_95
from ..numerics.engine.modal import parameters_from_poles
from ..numerics.engine.problem import Structure
from ..numerics.engine.static_gain import static_gain
from ..numerics.engine.structures import Candidate
from ..numerics.rational.frf_data import FRFData
from ..results import Flag, FractionalDelayFit, IntervalKind

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class FRFStructure:
    """One structure that was tried.

    Attributes
    ----------
    order, relative_degree : int
        Number of poles, and poles minus zeros.
    dead_time, std : float
        Estimate and its standard deviation in s; infinite if this structure does not determine the
        dead time.
    cost : float
        Weighted rms residual.
    bic : float
        Bayesian information criterion; smaller is better, only differences matter.
    """

    order: int
    relative_degree: int
    dead_time: float
    std: float
    cost: float
    bic: float


@dataclass(frozen=True, eq=False)
class FRFFit(FractionalDelayFit):
    r"""A transfer function with dead time, fitted to a frequency response.

    ``response(omega) == core(1j * omega) * exp(-1j * omega * dead_time)`` minimises
    ``sum |(measured - response) / sigma|^2`` over poles, numerator and dead time, and
    ``weighted_rms**2`` is that sum divided by the degrees of freedom (points minus half of the
    number of parameters). `interval` also covers the other structures, by their evidence
    ``exp(-bic / 2)``.

    Attributes
    ----------
    order, relative_degree : int
    dead_time : float
        In s, not rounded to samples.
    std_given_structure : float
        Standard deviation of `dead_time` in s for the chosen structure.
    interval : tuple of float
        95 % interval of the dead time in s.
    frequency_hz : ndarray, shape (K,)
    measured : ndarray of complex, shape (K,)
        Points that were fitted. The hold of a sampled FRF was divided out, and the aliases were
        taken out that a held input has in the model.
    sigma : ndarray, shape (K,)
        Standard deviation used as weight of each point; if the FRF had none a relative one, the
        same everywhere, or between the two, as the residuals tell.
    noise_known : bool
        Whether `sigma` is the measured standard deviation.
    weighted_rms : float
        Residuals in units of `sigma`; 1 is at noise level if the noise is known.
    matrices : tuple of ndarray
        A, B, C, D of the continuous core.
    poles : ndarray of complex, shape (order,)
        Poles of the core in rad/s, slow ones first.
    pole_std : ndarray, shape (order,)
        Standard error of each pole for the chosen structure, in rad/s. If the noise is not known it
        is computed from the residuals of the individual points. NaN for lags that follow a law
        (many equal lags, axial dispersion).
    structures : tuple of FRFStructure
        All that were tried, best first.
    name : str
        Name of the FRF.
    dt : float
        Sample time of the model, in s.
    hold_time : float or None
        Sample time in s of the hold that was divided out of `measured`; None if there was none.
    flags : tuple of Flag
    choices : tuple of str
    stated : bool
        Whether order or relative degree were given.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> f = np.geomspace(0.1, 20, 80)
    >>> s = 2j * np.pi * f
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal((80, 2)) @ [1, 1j]
    >>> frf = cr.MeasuredFRF(2 * np.exp(-0.0289 * s) / (0.08 * s + 1) ** 2 + noise, f)
    >>> fit = cr.fit_frf(frf, 2).fit
    >>> print(f"{1e3 * fit.dead_time:.2f} ms, std {1e3 * fit.std_given_structure:.2f} ms")
    28.79 ms, std 0.29 ms
    """

    order: int
    relative_degree: int
    dead_time: float
    std_given_structure: float
    interval: tuple[float, float]
    frequency_hz: FloatArray
    measured: ComplexArray
    sigma: FloatArray
    noise_known: bool
    weighted_rms: float
    matrices: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    poles: ComplexArray
    pole_std: FloatArray
    structures: tuple[FRFStructure, ...]
    name: str
    dt: float
    hold_time: float | None = None
    flags: tuple[Flag, ...] = ()
    choices: tuple[str, ...] = ()
    stated: bool = False
    records = ()

    @property
    def interval_kind(self) -> IntervalKind:
        """``"confidence"``, or ``"conditional"`` if order or relative degree were given."""
        return "conditional" if self.stated else "confidence"

    @property
    def core(self) -> ct.StateSpace:
        """The continuous system without its dead time."""
        return ct.ss(*self.matrices, name="core", inputs="u", outputs="y")

    @property
    def gain(self) -> float:
        """Response at frequency zero."""
        A, B, C, D = self.matrices
        return float((D - C @ np.linalg.solve(A, B))[0, 0])

    @property
    def total_delay(self) -> float:
        """Total delay at DC in s: dead time plus all lags of the core."""
        A, B, C, _ = self.matrices
        slope = C @ np.linalg.solve(A, np.linalg.solve(A, B))
        return self.dead_time + float(slope[0, 0]) / self.gain

    @property
    def relative_error(self) -> FloatArray:
        """``|response / measured - 1|`` at each point."""
        model = self.response(2 * np.pi * self.frequency_hz)
        return np.asarray(np.abs(model / self.measured - 1))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Evaluate core and dead time at `omega` in rad/s."""
        points = 1j * numbers(omega, "omega")
        core = np.asarray(self.core(points, squeeze=False))[0, 0]
        return np.asarray(core * np.exp(-points * self.dead_time), dtype=np.complex128)

    @property
    def _gain_std(self) -> float:
        """Standard error of the gain b0 / a0 of b(s) exp(-s L) / a(s), for the chosen structure."""
        omega = 2 * np.pi * self.frequency_hz
        unit = np.sqrt(omega[0] * omega[-1])
        data = FRFData(1j * omega / unit, self.measured, 1 / self.sigma, np.inf)
        at = np.append(self.dead_time * unit, parameters_from_poles(self.poles / unit))
        model = Candidate(Structure(self.order, self.relative_degree), at, 0.0)
        variance = self.weighted_rms**2 / 2  # of each part of a point
        return static_gain(data.problem, model, variance, data.scales.length).gain_std

    @property
    def gain_resolved(self) -> bool:
        """Whether the points tell the slowest poles from integrators, and so the gain.

        A pole within the band that a zero nearly cancels is uncertain while the gain is known.
        """
        uncertain = ~(Z_95 * self.pole_std <= np.abs(self.poles))  # NaN as well
        if np.any(uncertain & (np.abs(self.poles) < 2 * np.pi * self.frequency_hz[0])):
            return False
        return not uncertain[:1].any() or Z_95 * self._gain_std < abs(self.gain)

    def table(self) -> pd.DataFrame:
        """List the structures that were tried, best first."""
        import pandas as pd

        return pd.DataFrame([vars(structure) for structure in self.structures])

    _method = "transfer function fitted to a frequency response"

    def _title(self) -> str:
        return f"Transfer function with dead time from the FRF {self.name!r}"

    def _rows(self) -> list[tuple[str, str]]:
        unit = "the measured noise" if self.noise_known else "the response"
        shown = [
            f"{abs(p) / (2 * np.pi):.4g} Hz"
            + (f" (damping {-p.real / abs(p):.2g})" if p.imag > 0 else "")
            + (f" +-{100 * error / abs(p):.2g} %" if error < abs(p) else "")
            + (" +-100 % or more" if error >= abs(p) else "")
            for p, error in zip(self.poles, self.pole_std, strict=True)
            if p.imag >= 0
        ]
        ends = f"{self.frequency_hz[0]:.4g} to {self.frequency_hz[-1]:.4g} Hz"
        size = f"{self.weighted_rms:.3g} x"
        if not self.noise_known:
            size = f"{100 * self.weighted_rms:.3g} % of"
        hold, unknown = [], ""
        total = in_time(self.total_delay, 5)
        if abs(self.gain) <= Z_95 * self._gain_std:  # its slope over the gain has no interval
            total = "not determined: the gain may be zero"
        if not self.gain_resolved:
            total = unknown = f"not determined from {self.frequency_hz[0]:.4g} Hz on"
        if self.hold_time is not None:
            hold.append(("hold", f"zero-order hold of {in_time(self.hold_time)}, divided out"))
        return [
            ("dead time", f"{time_within(self.dead_time, *self.interval)}, {self._std_in_words()}"),
            ("95 % interval", interval_in_time(*self.interval)),
            ("total delay at DC", total),
            ("structure", f"order {self.order}, relative degree {self.relative_degree}"),
            ("poles", ", ".join(shown) or "none"),
            ("gain", unknown or f"{self.gain:.5g}"),
            ("points", f"{self.frequency_hz.size}, {ends}"),
            ("weighted residual", f"{size} {unit}"),
            *hold,
        ]

    def _std_in_words(self) -> str:
        low, high = self.interval
        # At a bound, or with a superfluous zero, the curvature says nothing; the interval does.
        if self.std_given_structure > 2 * (high - low):
            return "its standard deviation is not determined"
        return f"std {in_time(self.std_given_structure, 2)} given this structure"

    def __repr__(self) -> str:
        told = time_and_interval(self.dead_time, *self.interval)
        return f"<FRFFit order {self.order}, dead time {told}>"
