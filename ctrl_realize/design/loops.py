"""Open loops as functions of frequency, with what a Nyquist count must know about them.

A loop is a product of factors. Each factor tells its exact response (core(z) z^-d, never a
polynomial of the augmented matrix), and its *characteristic*: its open-loop characteristic
polynomial over a stable reference polynomial of the same degree. The product of
1 + L and all characteristics has the closed-loop poles as its zeros, and no pole outside the
stable region. Poles on the unit circle therefore need no indented contour, and a pole cancelled
inside the loop still counts as the closed-loop pole that it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..delayed import DelayedStateSpace
from ..errors import UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.crossovers import frequency_grid
from ..numerics.state_space import frequency_response, schur_form
from .delay_line import DelayLineController

NEAR_AXIS = 1e-7
"""Poles closer than this to the border of stability, or beyond it, are reflected inwards."""

MAX_FEATURES = 100
"""Zeros are looked for in factors of at most this order; plain systems above it are chains."""


@dataclass(frozen=True)
class Factor:
    """One system of a loop.

    ``response(w)`` and ``characteristic(w)`` take the shifted variable w = z - 1 (discrete) or
    w = s (continuous). Near z = 1, where oversampled systems live, z - 1 keeps its digits.
    """

    response: Callable[[ComplexArray], ComplexArray]
    characteristic: Callable[[ComplexArray], ComplexArray]
    delay: int
    hidden_delay: int
    features: ComplexArray
    poles: ComplexArray


@dataclass(frozen=True)
class Loop:
    """Product of factors: ``L(omega)``, exact at any delay.

    Attributes
    ----------
    factors : tuple of Factor
    dt : float
        Sample time in s; 0 for a continuous loop.
    dead_time : float
        Delay in s of a continuous loop, beside its factors.
    """

    factors: tuple[Factor, ...]
    dt: float
    dead_time: float = 0.0

    def variable(self, omega: FloatArray) -> ComplexArray:
        """Compute w = exp(j omega dt) - 1, or j omega for a continuous loop."""
        s = 1j * omega
        return np.asarray(np.expm1(s * self.dt) if self.dt else s, dtype=np.complex128)

    @property
    def delay(self) -> float:
        """Delay in s that stands apart from all dynamics."""
        return self.dead_time + self.dt * sum(factor.delay for factor in self.factors)

    def delay_free(self, omega: FloatArray) -> ComplexArray:
        """Response without the delay that stands apart."""
        w = self.variable(omega)
        value = np.ones(omega.size, dtype=np.complex128)
        with np.errstate(invalid="ignore"):
            for factor in self.factors:
                value = value * factor.response(w)
        return value

    def __call__(self, omega: FloatArray) -> ComplexArray:
        """Loop response L at frequencies in rad/s."""
        turn = np.exp(-1j * omega * self.delay)
        return np.asarray(self.delay_free(omega) * turn, dtype=np.complex128)

    def characteristic(self, omega: FloatArray) -> ComplexArray:
        """Closed-loop characteristic function, without poles outside the stable region."""
        w = self.variable(omega)
        value = 1 + self(omega)
        for factor in self.factors:
            value = value * factor.characteristic(w)
        return np.asarray(value, dtype=np.complex128)

    @property
    def poles(self) -> ComplexArray:
        """All poles of the factors, delays excepted."""
        return np.concatenate([factor.poles for factor in self.factors])

    def integrators(self) -> int:
        """Count the poles at z = 1 (s = 0)."""
        origin = 1.0 if self.dt else 0.0
        scale = 1e-7 if self.dt else 1e-9 * max(1.0, float(np.abs(self.poles).max(initial=0.0)))
        return int(np.sum(np.abs(self.poles - origin) < scale))

    def grid(self) -> FloatArray:
        """Frequencies that follow the loop from far below its slowest pole to its end."""
        features = np.concatenate([factor.features for factor in self.factors])
        sizes = np.abs(features)
        sizes = sizes[sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-300)]
        if self.dt:
            top = np.pi / self.dt
            slowest = min(float(sizes.min(initial=top)), top)
            hidden = sum(factor.hidden_delay for factor in self.factors) * self.dt
            low = self._low_end(1e-3 * slowest)
            return frequency_grid(low, top, features, self.delay + hidden)
        slowest = float(sizes.min(initial=1 / self.delay if self.delay else 1.0))
        low = self._low_end(1e-3 * slowest)
        top = self._high_end(1e3 * float(sizes.max(initial=slowest)))
        return frequency_grid(low, top, features, self.delay)

    def _low_end(self, low: float) -> float:
        # An integrating loop must start above gain 1, however slow it is. Where the gain does not
        # grow towards 0 a zero cancels the integrator.
        if self.integrators():
            gain = abs(self.delay_free(np.array([low]))[0])
            while gain < 10 and low > 1e-200:
                low *= 1e-2
                before, gain = gain, abs(self.delay_free(np.array([low]))[0])
                if gain < 1.5 * before:
                    break
        return low

    def _high_end(self, top: float) -> float:
        if self.delay == 0:
            return max(top, self._below(top))
        return max(self._below(top * 1e-6), 20 / self.delay)

    def _below(self, top: float) -> float:
        # A strictly proper loop is done where its gain stays small.
        for _ in range(60):
            gains = np.abs(self.delay_free(top * np.geomspace(1, 1e3, 30)))
            if gains.max() < 0.05 or np.ptp(gains) < 1e-3 * gains.max():
                break
            top *= 2
        return top


def open_loop(plant: Any, controller: Any = None, dead_time: float = 0.0) -> Loop:
    """Make a `Loop` of one or two single-input single-output systems.

    Raises
    ------
    UnsuitableSystemError
        Systems with several channels, of mixed time bases, or that are no linear systems.
    """
    systems = [plant] if controller is None else [plant, controller]
    bases = {base for base in map(_time_base, systems) if base is not None}
    if len(bases) > 1:
        words = " and ".join(_words(base) for base in sorted(bases))
        raise UnsuitableSystemError(
            f"plant and controller have different time bases: {words}; "
            "sample the continuous one first (design.to_discrete, or .discretised(dt) of a PID)"
        )
    dt = bases.pop() if bases else 0.0
    rate = 0.0 if dt else _rate(systems, dead_time)
    return Loop(tuple(factor(system, dt, rate) for system in systems), dt, dead_time)


def _rate(systems: list[Any], dead_time: float) -> float:
    """Fastest rate of a continuous loop in rad/s: what counts as far from the axis."""
    sizes = [
        float(np.abs(system.poles()).max(initial=0.0))
        for system in systems
        if isinstance(system, (ct.StateSpace, ct.TransferFunction))
    ]
    return max([*sizes, 1 / dead_time if dead_time else 0.0]) or 1.0


def _words(dt: float) -> str:
    return f"dt = {dt:g} s" if dt else "continuous"


def _time_base(system: Any) -> float | None:
    """Return dt, 0.0 for continuous, None for a pure gain."""
    if isinstance(system, (int, float, np.number)):
        return None
    if not isinstance(system, (ct.StateSpace, ct.TransferFunction)):
        raise UnsuitableSystemError(
            f"got a {type(system).__name__}; needed is a control.StateSpace, TransferFunction, "
            "FrequencyResponseData or a number"
        )
    if not system.issiso():
        raise UnsuitableSystemError(
            f"{system.name!r} has {system.ninputs} inputs and {system.noutputs} outputs; margins "
            "are for one input and one output. Take one channel, or look at "
            "control.singular_values_response"
        )
    if system.dt is True:
        raise UnsuitableSystemError(
            f"{system.name!r} is discrete without a sample time (dt=True); give dt in s"
        )
    return None if system.dt is None else float(system.dt)


def factor(system: Any, dt: float, rate: float = 0.0) -> Factor:
    """Make a `Factor` of one system, a number included; `rate` as in `reflected`."""
    if isinstance(system, DelayLineController):
        return _line_factor(system)
    if isinstance(system, ct.TransferFunction):
        return _polynomial_factor(system, dt, rate)
    if isinstance(system, ct.StateSpace):
        delay = int(system.delay) if isinstance(system, DelayedStateSpace) else 0
        core = system.delay_free if isinstance(system, DelayedStateSpace) else system
        return _state_space_factor(core, dt, rate, delay)
    gain = complex(system)
    none = np.zeros(0, dtype=np.complex128)
    return Factor(lambda w: np.full(w.size, gain), np.ones_like, 0, 0, none, none)


def reflected(
    poles: ComplexArray, dt: float, rate: float = 0.0
) -> tuple[ComplexArray, ComplexArray]:
    """Find the poles at or beyond the border of stability, and stable places for them.

    In continuous time `rate` (rad/s) says how far from the axis a place must be to be far.

    Returns
    -------
    moved, places : ndarray
        In the plane of z, or of s when `dt` is 0.
    """
    if dt:
        moved = poles[np.abs(poles) > 1 - NEAR_AXIS]
        size = np.abs(moved)
        return moved, moved / size * np.minimum(1 / size, 0.9)
    moved = poles[poles.real > -NEAR_AXIS * rate]
    return moved, -np.maximum(np.abs(moved.real), 0.1 * rate) + 1j * moved.imag


def pole_ratio(
    poles: ComplexArray, dt: float, rate: float = 0.0
) -> Callable[[ComplexArray], ComplexArray]:
    """Make prod (z - p) / (z - q) over the poles p that `reflected` moves to q."""
    origin = 1.0 if dt else 0.0
    moved, places = (points - origin for points in reflected(poles, dt, rate))

    def ratio(w: ComplexArray) -> ComplexArray:
        value = np.ones(w.size, dtype=np.complex128)
        for p, q in zip(moved, places, strict=True):
            value *= (w - p) / (w - q)
        return value

    return ratio


def in_s_plane(points: ComplexArray, dt: float) -> ComplexArray:
    """Map poles or zeros to the s-plane; those at z = 0 have no place there."""
    if not dt:
        return points
    # Far inside the circle nothing sharp happens that the even part of a grid would miss.
    return np.asarray(np.log(points[np.abs(points) > 0.05]) / dt, dtype=np.complex128)


def _state_space_factor(core: ct.StateSpace, dt: float, rate: float, delay: int) -> Factor:
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
    # A plain system may hold a chain of its own: its order bounds how often it turns.
    hidden = int(np.sum(np.abs(poles) < 1 - 1e-3)) if dt and core.nstates > 8 else 0
    return Factor(
        response, pole_ratio(poles, dt, rate), delay, hidden, in_s_plane(features, dt), poles
    )


def _polynomial_factor(system: ct.TransferFunction, dt: float, rate: float) -> Factor:
    num = np.atleast_1d(np.asarray(system.num[0][0], dtype=np.float64))
    den = np.atleast_1d(np.asarray(system.den[0][0], dtype=np.float64))
    num = np.trim_zeros(num, "f") if np.any(num) else np.zeros(1)
    den = np.trim_zeros(den, "f")
    if num.size > den.size:
        raise UnsuitableSystemError(
            f"{system.name!r} is improper (numerator of degree {num.size - 1} over "
            f"{den.size - 1}); give its derivative a filter"
        )
    delay = 0
    while dt and den.size > num.size and den[-1] == 0:
        # Zeros at the end of den are a delay, and would lose digits in a shifted polynomial.
        den, delay = den[:-1], delay + 1
    poles = np.asarray(np.roots(den), dtype=np.complex128)
    zeros = np.asarray(np.roots(num), dtype=np.complex128)
    shift = 1.0 if dt else 0.0
    top, bottom = (shifted_polynomial(p, shift) for p in (num, den))
    ratio = pole_ratio(poles, dt, rate)

    def response(w: ComplexArray) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(top(w) / bottom(w), dtype=np.complex128)

    def characteristic(w: ComplexArray) -> ComplexArray:
        # den itself over its roots: where roots of a cluster are inexact the dipole cancels.
        exact = bottom(w)
        rooted = den[0] * np.prod(w[:, None] + shift - poles, axis=1)
        return np.asarray(ratio(w) * exact / rooted, dtype=np.complex128)

    features = in_s_plane(np.concatenate([poles, zeros]), dt)
    return Factor(response, characteristic, delay, 0, features, poles)


def shifted_polynomial(
    coefficients: FloatArray, shift: float
) -> Callable[[ComplexArray], ComplexArray]:
    """Make p(w + shift) as a function of w, by a Taylor shift where the degree allows it."""
    degree = coefficients.size - 1
    if shift == 0.0 or degree > 8:
        return lambda w: np.asarray(np.polyval(coefficients, w + shift), dtype=np.complex128)
    moved = coefficients.astype(np.float64)
    for stop in range(degree, 0, -1):
        for i in range(1, stop + 1):
            moved[i] += shift * moved[i - 1]
    return lambda w: np.asarray(np.polyval(moved, w), dtype=np.complex128)


def _line_factor(system: DelayLineController) -> Factor:
    dt = float(system.dt)
    ratio = pole_ratio(system.inner_poles, dt)

    def response(w: ComplexArray) -> ComplexArray:
        forward, back = system.paths(w + 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(forward / back, dtype=np.complex128)

    def characteristic(w: ComplexArray) -> ComplexArray:
        return np.asarray(ratio(w) * system.paths(w + 1)[1], dtype=np.complex128)

    return Factor(
        response,
        characteristic,
        0,
        2 * system.line_length,
        in_s_plane(system.inner_poles, dt),
        system.inner_poles,
    )
