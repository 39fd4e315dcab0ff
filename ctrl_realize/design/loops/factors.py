"""One system of a loop, as functions of frequency for a Nyquist count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ...delayed import DelayedStateSpace, DelaySystem
from ...errors import UnsuitableSystemError
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.internal_delays.stability import in_s_plane
from ...numerics.state_space.responses import frequency_response, schur_form
from ..delay_line import DelayLineController

NEAR_AXIS = 1e-7
"""Poles closer than this to the stability boundary, or beyond it, are reflected inwards."""

MAX_FEATURES = 100
"""Largest order for computing zeros; plain systems above it contain delay lines."""


@dataclass(frozen=True)
class Factor:
    """One system of a loop.

    ``response(w)`` and ``characteristic(w, rate)`` take the shifted variable w = z - 1 (discrete)
    or w = s (continuous), and the `rate` of `reflected`. Near z = 1, where the poles of oversampled
    systems are, z - 1 keeps its digits. `hidden_delay` is contained in the response; in samples,
    or in s in continuous time.
    """

    response: Callable[[ComplexArray], ComplexArray]
    characteristic: Callable[[ComplexArray, float], ComplexArray]
    delay: int
    hidden_delay: float
    features: ComplexArray
    poles: ComplexArray


def factor(system: Any, dt: float) -> Factor:
    """Make a `Factor` of one system, a number included."""
    if isinstance(system, DelayLineController):
        return _line_factor(system)
    if isinstance(system, DelaySystem) and system.dt is not None:
        return _inside_factor(system)
    if isinstance(system, ct.TransferFunction):
        return _polynomial_factor(system, dt)
    if isinstance(system, ct.StateSpace):
        delay = int(system.delay) if isinstance(system, DelayedStateSpace) else 0
        core = system.delay_free if isinstance(system, DelayedStateSpace) else system
        core = core.core if isinstance(core, DelaySystem) else core  # a gain
        return _state_space_factor(core, dt, delay)
    gain = complex(system)
    none = np.zeros(0, dtype=np.complex128)
    return Factor(
        lambda w: np.full(w.size, gain), lambda w, rate: np.ones_like(w), 0, 0, none, none
    )


def reflected(
    poles: ComplexArray, dt: float, rate: float = 0.0
) -> tuple[ComplexArray, ComplexArray]:
    """Find the poles at or beyond the stability boundary, and stable replacements for them.

    In continuous time `rate` (rad/s) is the scale of the distance to the axis.

    Returns
    -------
    moved, places : ndarray
        In the z-plane, or the s-plane if `dt` is 0.
    """
    if dt:
        moved = poles[np.abs(poles) > 1 - NEAR_AXIS]
        size = np.abs(moved)
        return moved, moved / size * np.minimum(1 / size, 0.9)
    moved = poles[poles.real > -NEAR_AXIS * rate]
    return moved, -np.maximum(np.abs(moved.real), 0.1 * rate) + 1j * moved.imag


def pole_ratio(poles: ComplexArray, dt: float) -> Callable[[ComplexArray, float], ComplexArray]:
    """Make prod (z - p) / (z - q) over the poles p that `reflected` moves to q."""
    origin = 1.0 if dt else 0.0

    def ratio(w: ComplexArray, rate: float) -> ComplexArray:
        moved, places = (points - origin for points in reflected(poles, dt, rate))
        value = np.ones(w.size, dtype=np.complex128)
        for p, q in zip(moved, places, strict=True):
            value *= (w - p) / (w - q)
        return value

    return ratio


def _state_space_factor(core: ct.StateSpace, dt: float, delay: int) -> Factor:
    A = np.asarray(core.A, dtype=np.float64)
    shift = 1.0 if dt else 0.0
    # The Schur form of A - I: the slow poles of an oversampled model keep their distance to 1.
    form = schur_form(A - shift * np.eye(A.shape[0]))
    poles = np.diag(form[0]) + shift
    B, C, D = (np.asarray(M, dtype=np.float64) for M in (core.B, core.C, core.D))

    def response(w: ComplexArray) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            values = frequency_response(form, B, C, D, w)
        return np.asarray(values[0, 0], dtype=np.complex128)

    features = poles
    if 0 < core.nstates <= MAX_FEATURES:
        zeros = np.asarray(core.zeros(), dtype=np.complex128)
        features = np.concatenate([poles, zeros[np.isfinite(zeros)]])
    # A plain system may contain a delay line: its order bounds the number of turns of the phase.
    hidden = int(np.sum(np.abs(poles) < 1 - 1e-3)) if dt and core.nstates > 8 else 0
    return Factor(response, pole_ratio(poles, dt), delay, hidden, in_s_plane(features, dt), poles)


def _inside_factor(system: DelaySystem) -> Factor:
    dt = float(system.dt)
    features, dead_time = system.features()
    shift = 1.0 if dt else 0.0

    def response(w: ComplexArray) -> ComplexArray:
        return np.asarray(system.horner(w + shift, warn_infinite=False)[0, 0])

    def characteristic(w: ComplexArray, rate: float) -> ComplexArray:
        return system.characteristic(w + shift)

    # the first ones are the core's, which those of the system repeat, or replace in a loop
    own = features[in_s_plane(np.linalg.eigvals(system.core.A), dt).size :]
    poles = np.exp(own * dt) if dt else own
    return Factor(response, characteristic, 0, dead_time / dt if dt else dead_time, features, poles)


def _polynomial_factor(system: ct.TransferFunction, dt: float) -> Factor:
    num = np.atleast_1d(np.asarray(system.num[0][0], dtype=np.float64))
    den = np.atleast_1d(np.asarray(system.den[0][0], dtype=np.float64))
    num = np.trim_zeros(num, "f") if np.any(num) else np.zeros(1)
    den = np.trim_zeros(den, "f")
    if num.size > den.size:
        raise UnsuitableSystemError(
            f"{system.name!r} is improper (numerator of degree {num.size - 1}, denominator of "
            f"degree {den.size - 1}); add a derivative filter"
        )
    delay = 0
    while dt and den.size > num.size and den[-1] == 0:
        # Zeros at the end of den are a delay, and would lose digits in a shifted polynomial.
        den, delay = den[:-1], delay + 1
    poles = np.asarray(np.roots(den), dtype=np.complex128)
    zeros = np.asarray(np.roots(num), dtype=np.complex128)
    shift = 1.0 if dt else 0.0
    top, bottom = (shifted_polynomial(p, shift) for p in (num, den))
    ratio = pole_ratio(poles, dt)

    def response(w: ComplexArray) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(top(w) / bottom(w), dtype=np.complex128)

    def characteristic(w: ComplexArray, rate: float) -> ComplexArray:
        # den divided by its roots: if roots of a cluster are inexact the dipole cancels.
        exact = bottom(w)
        rooted = den[0] * np.prod(w[:, None] + shift - poles, axis=1)
        return np.asarray(ratio(w, rate) * exact / rooted, dtype=np.complex128)

    features = in_s_plane(np.concatenate([poles, zeros]), dt)
    return Factor(response, characteristic, delay, 0, features, poles)


def shifted_polynomial(
    coefficients: FloatArray, shift: float
) -> Callable[[ComplexArray], ComplexArray]:
    """Make p(w + shift) as a function of w, by a Taylor shift if the degree allows it."""
    degree = coefficients.size - 1
    if shift == 0.0 or degree > 8:
        return lambda w: np.asarray(np.polyval(coefficients, w + shift), dtype=np.complex128)
    moved = np.poly1d(coefficients)(np.poly1d([1.0, shift])).coeffs
    return lambda w: np.asarray(np.polyval(moved, w), dtype=np.complex128)


def _line_factor(system: DelayLineController) -> Factor:
    dt = float(system.dt)
    ratio = pole_ratio(system.inner_poles, dt)
    last: list[ComplexArray] = []

    def paths(w: ComplexArray) -> list[ComplexArray]:
        # The sums over a long line take most of the time, and response and characteristic are asked
        # for at the same frequencies.
        if not last or not np.array_equal(last[0], w):
            last[:] = [w, *system.paths(w + 1)]
        return last[1:]

    def response(w: ComplexArray) -> ComplexArray:
        forward, back = paths(w)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(forward / back, dtype=np.complex128)

    def characteristic(w: ComplexArray, rate: float) -> ComplexArray:
        return np.asarray(ratio(w, rate) * paths(w)[1], dtype=np.complex128)

    poles, hidden = system.inner_poles, 2 * system.line_length
    return Factor(response, characteristic, 0, hidden, in_s_plane(poles, dt), poles)
