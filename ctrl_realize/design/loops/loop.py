"""Open loops as functions of frequency, for a Nyquist count.

A loop is a product of factors. Each factor has an exact response (core(z) z^-d, never a polynomial
of the augmented matrix), and a *characteristic*: its open-loop characteristic polynomial divided by
a stable reference polynomial of the same degree. The product of 1 + L and all characteristics has
the closed-loop poles as its zeros, and no pole outside the stable region. Poles on the unit circle
therefore need no indented contour, and a pole cancelled inside the loop still counts as a
closed-loop pole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from ..._checks import check_type, sample_time_of
from ...data.shown_units import unit_among
from ...delayed.operands import Linear, Numbers
from ...delayed.parts import check_entries
from ...errors import UnsuitableSystemError
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.loops.crossings import frequency_grid
from .factors import Factor, factor

MOST_TURNED = 5e7
"""Phase in rad up to which a dead time is followed: 16 points a turn then take some 10 GB."""


@dataclass(frozen=True)
class Loop:
    """Product of factors: ``L(omega)``, exact at any delay.

    Attributes
    ----------
    factors : tuple of Factor
    dt : float
        Sample time in s; 0 for a continuous loop.
    dead_time : float
        Delay in s of a continuous loop, separate from its factors.
    time_unit : str
        In which results write times.
    """

    factors: tuple[Factor, ...]
    dt: float
    dead_time: float = 0.0
    time_unit: str = "s"

    def variable(self, omega: FloatArray) -> ComplexArray:
        """Compute w = exp(j omega dt) - 1, or j omega for a continuous loop."""
        s = 1j * omega
        return np.asarray(np.expm1(s * self.dt) if self.dt else s, dtype=np.complex128)

    @property
    def delay(self) -> float:
        """Pure delay in s."""
        return self.dead_time + self.dt * sum(part.delay for part in self.factors)

    @property
    def turn_time(self) -> float:
        """Delay in s, with those inside of the factors."""
        return self.delay + sum(part.hidden_delay for part in self.factors) * (self.dt or 1.0)

    def delay_free(self, omega: FloatArray) -> ComplexArray:
        """Response without the pure delay."""
        w, one = self.variable(omega), np.ones(omega.size, dtype=np.complex128)
        with np.errstate(invalid="ignore"):
            return prod((part.response(w) for part in self.factors), start=one)

    def __call__(self, omega: FloatArray) -> ComplexArray:
        """Loop response L at frequencies in rad/s."""
        turn = np.exp(-1j * omega * self.delay)
        return np.asarray(self.delay_free(omega) * turn, dtype=np.complex128)

    def characteristic(self, omega: FloatArray) -> ComplexArray:
        """Closed-loop characteristic function, without poles outside the stable region."""
        return np.asarray((1 + self(omega)) * self.open_characteristic(omega), dtype=np.complex128)

    def open_characteristic(self, omega: FloatArray) -> ComplexArray:
        """Open-loop characteristic function: the product of those of the factors."""
        w, one = self.variable(omega), np.ones(omega.size, dtype=np.complex128)
        return prod((part.characteristic(w, self.rate) for part in self.factors), start=one)

    def beyond(self, top: float) -> FloatArray:
        """Frequencies from `top` to where no factor of a continuous loop turns any more."""
        end = 1e4 * self.rate
        if end <= top:
            return np.zeros(0)
        return np.geomspace(top, end, int(40 * np.log10(end / top)) + 2)

    @cached_property
    def rate(self) -> float:
        """Fastest rate of a continuous loop in rad/s: the scale of the distance to the axis."""
        dead_time = self.turn_time
        sizes = [float(np.abs(part.features).max(initial=0.0)) for part in self.factors]
        return max([*sizes, 1 / dead_time if dead_time else 0.0]) or 1.0

    @property
    def poles(self) -> ComplexArray:
        """All poles of the factors, delays excepted."""
        return np.concatenate([part.poles for part in self.factors])

    def integrators(self) -> int:
        """Count the poles at z = 1 (s = 0)."""
        origin = 1.0 if self.dt else 0.0
        scale = 1e-7 if self.dt else 1e-9 * self.rate
        return int(np.sum(np.abs(self.poles - origin) < scale))

    def sign(self) -> float:
        """Sign of the static gain, or of the slope of an integrating loop."""
        count = self.integrators()
        slow = self(np.array([self._start() if count else 0.0]))[0]
        return -1.0 if (1j**count * slow).real < 0 else 1.0

    def grid(self) -> FloatArray:
        """Frequencies from far below the slowest pole up to the end, for following the loop."""
        features = np.concatenate([part.features for part in self.factors])
        if self.dt:
            return frequency_grid(self._start(), np.pi / self.dt, features, self.turn_time)
        sizes, dead_time = self._sizes(), self.turn_time
        top = 20 / dead_time if dead_time else 1e3 * (sizes.max(initial=0.0) or 1.0)
        top = self._end(top, sizes)
        if dead_time * top > MOST_TURNED:
            turns = dead_time * top / (2 * np.pi)
            raise UnsuitableSystemError(
                f"the dead time of {dead_time:g} s turns the loop {turns:.2g} times up to "
                f"{top:.3g} rad/s, where its gain ends: too often to be followed. Check the units "
                "of its times"
            )
        return frequency_grid(self._start(), top, features, dead_time)

    def _sizes(self) -> FloatArray:
        sizes = np.abs(np.concatenate([part.features for part in self.factors]))
        return np.asarray(sizes[sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-300)])

    def _start(self) -> float:
        slowest = 1 / self.turn_time if self.turn_time else np.pi / self.dt if self.dt else 1.0
        low = 1e-3 * float(self._sizes().min(initial=slowest))
        # An integrating loop must start above gain 1, however slow it is. If the gain does not
        # increase towards 0, a zero cancels the integrator.
        if self.integrators():
            gain = abs(self.delay_free(np.array([low]))[0])
            while gain < 10 and low > 1e-200:
                low *= 1e-2
                before, gain = gain, abs(self.delay_free(np.array([low]))[0])
                if gain < 1.5 * before:
                    break
        return low

    def _end(self, top: float, sizes: FloatArray) -> float:
        # A strictly proper loop ends where its gain stays small, also at the features beyond.
        for _ in range(60):
            at = np.concatenate([top * np.geomspace(1, 1e3, 30), sizes[sizes > top]])
            gains = np.abs(self.delay_free(at))
            if gains.max() < 0.05 or np.ptp(gains) < 1e-3 * gains.max():
                break
            top *= 2
        return top


def open_loop(plant: Any, controller: Any = None, dead_time: float = 0.0) -> Loop:
    """Make a `Loop` of one or two single-input single-output systems.

    Raises
    ------
    UnsuitableSystemError
        Systems with several channels, of mixed time bases, or not linear.
    """
    systems = [plant] if controller is None else [plant, controller]
    bases = {base for base in map(_time_base, systems) if base is not None}
    if bases and max(bases) - min(bases) > 1e-6 * max(bases):  # as in sums and products of systems
        words = " and ".join(f"dt = {dt:g} s" if dt else "continuous" for dt in sorted(bases))
        raise UnsuitableSystemError(
            f"plant and controller have different time bases: {words}; "
            "sample the continuous one first (design.to_discrete, or .discretised(dt) of a PID)"
        )
    dt = bases.pop() if bases else 0.0
    factors = tuple(factor(system, dt) for system in systems)
    return Loop(factors, dt, dead_time, unit_among(*systems))


def _time_base(system: Any) -> float | None:
    """Return dt; 0.0 for continuous, None for a static gain."""
    expected = "a control.StateSpace, TransferFunction, FrequencyResponseData or a number"
    check_type(system, (*Linear, *Numbers), "a system", expected, UnsuitableSystemError)
    check_entries(system)
    if isinstance(system, Numbers):
        return None
    if not system.issiso():
        raise UnsuitableSystemError(
            f"{system.name!r} has {system.ninputs} inputs and {system.noutputs} outputs; "
            "expected one of each. Take one channel, or use control.singular_values_response"
        )
    return sample_time_of(system)
