"""The result of comparing a model with a measured frequency response."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..numerics.arrays import BoolArray, ComplexArray, FloatArray
from ..results import Flag, Result

if TYPE_CHECKING:
    import pandas as pd


_COLUMNS = (
    "frequency_hz", "measured_gain_db", "model_gain_db", "measured_phase_deg", "model_phase_deg",
    "gain_error_db", "phase_error_deg", "relative_error", "coherence", "std", "trusted",
)  # fmt: skip
"""Columns of the table of a comparison."""


@dataclass(frozen=True, eq=False)
class FRFComparison(Result):
    """Comparison of a model with a measured frequency response, point by point.

    With ``r = model / measured``: ``gain_error_db == 20 log10 |r|``, ``phase_error_deg`` is the
    unwrapped angle of ``r`` in degrees, and ``relative_error == |r - 1|``. With a positive phase
    error the model lags less than the plant. Summaries (`rms_gain_error_db` etc.) are over the
    points with ``trusted``, all of which lie inside `band_hz`.

    Attributes
    ----------
    frequency_hz : ndarray, shape (K,)
    measured, model : ndarray of complex, shape (K,)
        Responses that were compared; if a hold was divided out, it is removed from `model`.
    gain_error_db, phase_error_deg, relative_error : ndarray, shape (K,)
    measured_phase_deg, model_phase_deg : ndarray, shape (K,)
        Unwrapped after removal of the model's dead time, so that it is correct at any delay.
    trusted : ndarray of bool, shape (K,)
        Points inside the band.
    band_hz : tuple of float
        Lowest and highest frequency of the trusted band.
    band_from : {"coherence", "std", "all", "given"}
        Criterion of the band.
    coherence, std : ndarray or None
        Coherence and standard deviation of the measurement.
    hold : {"zoh", None}
        Hold that was divided out of the model.
    name : str
        Names of model and measurement.
    flags : tuple of Flag

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
    >>> f = np.geomspace(0.1, 10, 40)
    >>> s = 2j * np.pi * f
    >>> measured = cr.MeasuredFRF(1.02 * np.exp(-0.03 * s) / (0.08 * s + 1), f)
    >>> found = cr.compare_frf(plant, measured)
    >>> print(f"{found.rms_gain_error_db:.2f} dB and {found.rms_phase_error_deg:.2f} degrees")
    0.17 dB and 0.00 degrees
    """

    frequency_hz: FloatArray
    measured: ComplexArray
    model: ComplexArray
    gain_error_db: FloatArray
    phase_error_deg: FloatArray
    relative_error: FloatArray
    measured_phase_deg: FloatArray
    model_phase_deg: FloatArray
    trusted: BoolArray
    band_hz: tuple[float, float]
    band_from: Literal["coherence", "std", "all", "given"]
    coherence: FloatArray | None
    std: FloatArray | None
    hold: Literal["zoh"] | None
    name: str
    flags: tuple[Flag, ...] = field(default=())

    @property
    def rms_gain_error_db(self) -> float:
        """Root mean square of the gain error in the band, in dB."""
        return _rms(self.gain_error_db[self.trusted])

    @property
    def rms_phase_error_deg(self) -> float:
        """Root mean square of the phase error in the band, in degrees."""
        return _rms(self.phase_error_deg[self.trusted])

    @property
    def rms_relative_error(self) -> float:
        """Root mean square of the relative error in the band."""
        return _rms(self.relative_error[self.trusted])

    @property
    def max_relative_error(self) -> float:
        """Largest relative error in the band."""
        return float(np.max(self.relative_error[self.trusted]))

    @property
    def relative_noise(self) -> float | None:
        """Relative error expected from the noise of the measurement, rms in the band."""
        if self.std is None:
            return None
        return _rms((self.std / np.abs(self.measured))[self.trusted])

    def table(self) -> pd.DataFrame:
        """List all points, one per row."""
        import pandas as pd

        gains = {"measured_gain_db": decibels(self.measured), "model_gain_db": decibels(self.model)}
        columns = {name: gains.get(name, getattr(self, name, None)) for name in _COLUMNS}
        return pd.DataFrame({name: one for name, one in columns.items() if one is not None})

    def _title(self) -> str:
        return f"FRF comparison: {self.name}"

    def _rows(self) -> list[tuple[str, str]]:
        inside = self.trusted
        worst = int(np.argmax(np.where(inside, self.relative_error, -1.0)))
        largest = f"largest {100 * self.max_relative_error:.3g} % at "
        largest += hertz(self.frequency_hz[worst])
        source = {
            "coherence": "high coherence",
            "std": "small standard deviation",
            "all": "all points: no coherence or std given",
            "given": "as given",
        }[self.band_from]
        rows = [
            ("trusted band", f"{hertz(self.band_hz[0])} to {hertz(self.band_hz[1])} ({source})"),
            ("points", f"{int(inside.sum())} of {inside.size}"),
            ("gain error", _rms_max(self.gain_error_db[inside], "dB")),
            ("phase error", _rms_max(self.phase_error_deg[inside], "deg")),
            ("relative error", f"{100 * self.rms_relative_error:.3g} % rms, {largest}"),
        ]
        if self.relative_noise is not None:
            rows.append(("noise of the FRF", f"{100 * self.relative_noise:.3g} % rms"))
        divided = "zero-order hold divided out of the model (half a sample of lag)"
        return [*rows, ("hold", divided if self.hold else "not divided out")]

    def __repr__(self) -> str:
        return (
            f"<FRFComparison {self.name}: {100 * self.rms_relative_error:.3g} % rms in "
            f"{hertz(self.band_hz[0])} to {hertz(self.band_hz[1])}>"
        )


def _rms(values: FloatArray) -> float:
    # relative to the largest value, so that the squares neither overflow nor underflow
    largest = float(np.abs(values).max(initial=0.0)) or 1.0
    return largest * float(np.sqrt(np.mean((values / largest) ** 2)))


def decibels(values: ComplexArray) -> FloatArray:
    """Return the magnitude in dB."""
    return np.asarray(20 * np.log10(np.abs(values)), dtype=np.float64)


def hertz(value: float) -> str:
    """Write a frequency with its unit."""
    return f"{value:.4g} Hz"


def _rms_max(values: FloatArray, unit: str) -> str:
    largest = values[int(np.argmax(np.abs(values)))]
    return f"{_rms(values):.3g} {unit} rms, largest {largest:+.3g} {unit}"
