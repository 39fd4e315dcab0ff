"""Comparison of a model with a measured frequency response in the trusted band."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import control as ct
import numpy as np

from .._checks import check_type, one_of, sample_time_of
from .._flags import Flag
from ..data.frf_operands import same_time
from ..delayed import DelayedStateSpace, DelaySystem
from ..delayed.inside.conversions import check_logarithm
from ..errors import DataError, OptionError, UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray, locked, read_only
from ..numerics.blas_threads import single_threaded
from ..numerics.constants import SMALLEST
from ..numerics.rational.phase import unwrap_with_dead_time
from ..numerics.rational.spectra import hold_response
from ..numerics.state_space.sampling import continuous_ends
from .comparison import FRFComparison, decibels, hertz
from .disagreement import disagreement
from .points import (
    MeasuredPoints,
    below_nyquist,
    check_single_channel,
    measured_points,
    sampled_every,
)
from .trusted_band import trusted_points


@single_threaded
def compare_frf(
    system: ct.LTI,
    frf: ct.FrequencyResponseData,
    *,
    min_coherence: float | None = None,
    band_hz: tuple[float, float] | None = None,
    hold: Literal["auto", "zoh"] | None = "auto",
) -> FRFComparison:
    """Compare a model with a measured frequency response.

    Parameters
    ----------
    system : control.LTI
        One input, one output; discrete or continuous, with or without dead time.
    frf : MeasuredFRF
        Measured response; any `control.FrequencyResponseData`.
    min_coherence : float, optional
        Smallest coherence of a trusted point. Default 0.95 if the FRF has a coherence; otherwise
        points with a standard deviation of at most 10 % of the response are trusted, and all points
        if it has neither.
    band_hz : tuple of float, optional
        Compare in this band in Hz instead.
    hold : {"auto", "zoh", None}
        ``"zoh"`` takes the zero-order hold out of a discrete model; ``"auto"`` does so unless its
        ``.fit`` states that it is impulse-invariant. None: never. An FRF with a known
        sample time contains a hold as well: if it has the sample time of the model neither is
        taken out, otherwise both.

    Returns
    -------
    FRFComparison

    Raises
    ------
    DataError
        No point in the band, or none below the model's Nyquist frequency.
    OptionError
        A coherence outside 0...1, or given for an FRF without one; a hold for a continuous model.
    UnsuitableSystemError
        A system or FRF with several inputs or outputs.

    Notes
    -----
    A *step-invariant* model (backward difference, ``ct.sample_system(..., "zoh")``) describes the
    plant with a hold. Its frequency response lags that of the plant by half a sample, ``w dt / 2``:
    1.83 degrees at 13 Hz and 1280 Hz. An FRF measured on the plant with analog signals contains no
    hold, so the model is compared as the continuous one that has its samples under a hold (see
    `design.to_continuous`). Where there is none, since a pole has no logarithm, the hold is divided
    out and aliases stay: of a lag of 20 samples 3.4 % at a tenth of the sample rate and 23 % at a
    quarter. This is not needed for an *impulse-invariant* model (central difference), nor for an
    FRF estimated from the samples of a held input, as is assumed for `spectral_frf`: give
    ``hold="zoh"`` if the input was not held, and ``hold=None`` for an FRF from another source with
    a held input.

    The trusted band is the widest band (in octaves) in which the coherence, smoothed by a running
    median of five points, is sufficient.

    The hold is the factor ``(1 - exp(-s dt)) / (s dt)`` of [1]_.

    References
    ----------
    .. [1] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
       section 2.3.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = ct.tf([1], [0.1, 1])
    >>> f = np.geomspace(0.1, 13, 50)
    >>> frf = cr.MeasuredFRF(plant(2j * np.pi * f), f)
    >>> model = ct.ss(ct.sample_system(plant, 7.8125e-4, "zoh"))
    >>> lagging = cr.compare_frf(model, frf, hold=None)
    >>> print(round(lagging.phase_error_deg[-1], 2))
    -1.83
    >>> print(f"{cr.compare_frf(model, frf).max_relative_error:.2%}")
    0.00%
    """
    expected = "a system of python-control"
    check_type(system, ct.LTI, "system", expected, UnsuitableSystemError)
    check_single_channel(system, "system")
    dt = sample_time_of(system) or None
    points, flags = _comparable(measured_points(frf), dt)
    used_hold = _hold(system, dt, hold)
    omega = points.omega
    held = sampled_every(frf) if hold == "auto" else None
    if held is not None and used_hold is not None and dt is not None and same_time(held, dt):
        used_hold = None
    elif held is not None:
        points = _without_hold(points, held)
    model = _evaluate(system, omega, dt)
    if used_hold is not None and dt is not None:
        continuous = _continuous(system, omega, dt)
        model = model / hold_response(omega, dt) if continuous is None else continuous
    good, source = trusted_points(points, min_coherence, band_hz)
    ratio = model / points.response
    if not np.all(np.isfinite(ratio)) or np.any(np.abs(ratio) == 0):
        raise UnsuitableSystemError(
            "the model's response is zero or not finite at a measured frequency; check "
            "whether a pole or zero lies on the frequency grid"
        )
    delay = float(system.dead_time) if isinstance(system, DelayedStateSpace) else 0.0
    model_phase = unwrap_with_dead_time(omega, model, delay)
    error = _unwrapped_error(ratio, int(np.argmax(good)))
    trusted_hz = points.frequency_hz[good]
    found = FRFComparison(
        frequency_hz=read_only(points.frequency_hz),
        measured=locked(points.response),
        model=locked(model),
        gain_error_db=read_only(decibels(ratio)),
        phase_error_deg=read_only(np.degrees(error)),
        relative_error=read_only(np.abs(ratio - 1)),
        measured_phase_deg=read_only(np.degrees(model_phase - error)),
        model_phase_deg=read_only(np.degrees(model_phase)),
        trusted=locked(good),
        band_hz=(float(trusted_hz[0]), float(trusted_hz[-1])),
        band_from=source,
        coherence=None if points.coherence is None else read_only(points.coherence),
        std=None if points.std is None else read_only(points.std),
        hold=used_hold,
        name=f"{_own_name(system, 'model')} and {_own_name(frf, 'measured')}",
        flags=flags,
    )
    off = disagreement(found)
    return found if off is None else replace(found, flags=(off, *found.flags))


def _without_hold(points: MeasuredPoints, dt: float) -> MeasuredPoints:
    hold = hold_response(points.omega, dt)
    std = None if points.std is None else points.std / np.abs(hold)
    return replace(points, response=points.response / hold, std=std)


def _own_name(system: Any, otherwise: str) -> str:
    """Return a user-defined name; python-control's default names are like ``sys[3]``."""
    name = str(system.name or "")
    return otherwise if not name or name.startswith("sys[") else name


def _comparable(
    points: MeasuredPoints, dt: float | None
) -> tuple[MeasuredPoints, tuple[Flag, ...]]:
    """Leave out points at zero frequency, and those beyond the Nyquist frequency of the model."""
    frequency = points.frequency_hz
    below, flags = below_nyquist(points, dt, "model")
    usable = below.only(np.abs(below.response) > SMALLEST)
    if not usable.omega.size:
        raise DataError(
            f"nothing to compare: the FRF has {frequency.size} points from "
            f"{hertz(frequency[0])} to {hertz(frequency[-1])}, none of them non-zero and "
            "below the model's Nyquist frequency"
        )
    return usable, flags


def _unwrapped_error(ratio: ComplexArray, first: int) -> FloatArray:
    """Unwrap the phase of model over measured; at the `first` trusted point it is within +-pi."""
    error = np.unwrap(np.angle(ratio))
    return np.asarray(error - 2 * np.pi * np.round(error[first] / (2 * np.pi)), dtype=np.float64)


def _hold(system: Any, dt: float | None, hold: str | None) -> Literal["zoh"] | None:
    """Decide whether the hold is divided out."""
    if hold is None:
        return None
    hold = one_of(hold, "hold", ("auto", "zoh"))
    if dt is None:
        if hold == "zoh":
            raise OptionError("hold='zoh' needs a discrete model; this one is continuous")
        return None
    fit = system.fit if isinstance(system, DelayedStateSpace) else None
    invariant = fit is not None and fit.sampling == "impulse-invariant"
    return None if invariant and hold == "auto" else "zoh"


def _continuous(system: Any, omega: FloatArray, dt: float) -> ComplexArray | None:
    """Response (K,) of the continuous model with these samples under a hold, if there is one."""
    delayed = isinstance(system, DelayedStateSpace)
    if not delayed and (isinstance(system, DelaySystem) or not hasattr(system, "poles")):
        return None
    core = system.delay_free if delayed else ct.ss(system)
    ends = (system.input_delays, system.output_delays) if delayed else (np.zeros(1), np.zeros(1))
    try:
        check_logarithm(core.A)
        matrices, before, behind = continuous_ends((core.A, core.B, core.C, core.D), dt, *ends)
    except UnsuitableSystemError:
        return None
    response = _evaluate(ct.ss(*matrices), omega, None)
    return np.asarray(response * np.exp(-1j * omega * (before[0] + behind[0])))


def _evaluate(system: Any, omega: FloatArray, dt: float | None) -> ComplexArray:
    points = 1j * omega if dt is None else np.exp(1j * omega * dt)
    return np.asarray(system(points, squeeze=False)[0, 0], dtype=np.complex128)
