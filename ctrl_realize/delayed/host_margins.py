"""Exact frequency responses for the margins of python-control."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import brentq

from .._checks import real
from ..numerics.arrays import BoolArray, ComplexArray, FloatArray
from ..numerics.internal_delays.form import DelayForm
from ..numerics.internal_delays.stability import grid, grid_about
from ..numerics.loops.crossings import follow
from .deferred import DeferredMatrices
from .parts import check_single

FINE = 0.1
"""Phase in rad between the points of a response from which margins are interpolated: the cubic
spline of python-control is then accurate to 1e-6."""

DECIDES = 0.2
"""Least relative gain that matters for a margin; beyond the last frequency with such a gain the
response is left out."""


BEYOND = 1e8
"""Gain that only a pole at zero has, at the lower end of the axis: a phase of -180 degrees there is
that of a double integrator, or of rounding in its poles, and no margin."""

STRAIGHT = 10.0
"""Real over imaginary part from which on a response is taken for that at an end of the axis: that
of an integrator is not, which is far above any margin there."""


class HostMargins(DeferredMatrices):
    """Unpacks as a frequency response, which functions for margins accept; gain and bandwidth."""

    @abstractmethod
    def features(self) -> tuple[ComplexArray, float]:
        """Poles in the s-plane where the response changes quickly, and the largest delay in s."""

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
        check_single(self, "a margin")
        omega, values = _with_mirrored_ends(*self._followed(), float(self.dt or 0))
        return iter((np.abs(values), np.degrees(np.unwrap(np.angle(values))), omega))

    def _followed(self) -> tuple[FloatArray, ComplexArray]:
        """Frequencies so close that the response between them can be interpolated."""
        every = grid_about(*self.features(), float(self.dt or 0), self._gain_is_gone)
        omega, values = follow(self._at, every)
        first = int(np.argmax(np.abs(values) < BEYOND))
        last = first + _last(values[first:])
        omega, values = follow(self._at, omega[first:last], FINE)
        known = np.isfinite(values)
        return omega[known], values[known]

    def damp(self) -> Any:
        """Natural frequency, damping and poles; poles at z = 0 have infinite frequency."""
        # log(0) of the poles at 0 is intended, and python-control would warn about each.
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().damp()

    def bandwidth(self, dbdrop: float = -3) -> float:
        """Lowest frequency in rad/s at which the gain is `dbdrop` dB below that at 0.

        python-control 0.10.2 raises an error for every discrete system: it evaluates G(jw) instead
        of G(exp(jw dt)).
        """
        if not self.issiso():
            raise TypeError("system should be a SISO system")
        drop = real(dbdrop, "dbdrop", "drop of the gain in dB, below 0")
        if drop >= 0:
            raise ValueError("expecting dbdrop be a negative scalar in dB")
        level = abs(self.dcgain()) * 10 ** (drop / 20)
        if not np.isfinite(level):
            return float("nan")
        dt = float(self.dt or 0)

        def excess(omega: FloatArray) -> FloatArray:
            return np.asarray(np.abs(self._at(omega)) - level)

        omega = grid(self._gain_form(), dt)
        below = np.flatnonzero(excess(omega) < 0)
        if below.size == 0:
            return float("inf")
        first = int(below[0])
        if first == 0:
            return float(omega[0])
        ends = omega[first - 1], omega[first]
        return float(brentq(lambda w: excess(np.array([w]))[0], *ends, xtol=1e-14 * omega[-1]))

    def _gain_form(self) -> DelayForm:
        """Return a form with the gain of the system."""
        return self._form()

    def _at(self, omega: FloatArray) -> ComplexArray:
        """Response of the first channel at frequencies in rad/s."""
        x = np.exp(1j * omega * float(self.dt)) if self.dt else 1j * omega
        return np.asarray(self.horner(x, warn_infinite=False)[0, 0])

    def _gain_is_gone(self, fastest: float) -> float:
        """Find a frequency above which the gain of a system is too low for any margin."""
        omega = fastest * np.geomspace(1e-3, 1e5, 4000)
        values = self._at(omega)
        size = np.abs(values)
        level = 0.1 * DECIDES * min(1.0, float(np.median(size[:100])) or 1.0)
        (large,) = np.nonzero(~(size < level))
        # a gain that does not roll off is evaluated up to ten times the fastest pole
        last = max(int(large[-1]) if large.size else 0, int(np.argmax(_across(values))))
        return float(omega[last + 1]) if last + 1 < omega.size else 10 * fastest


def _last(values: ComplexArray) -> int:
    """Count the points up to the last one that matters for the margins.

    The gain is a fifth of 1 there, or of the largest gain at a phase of -180 degrees:
    python-control takes a minute for the turns of the phase beyond.
    """
    size = np.abs(values)
    real = np.append(size[1:][_across(values)], size[[0, -1]][_negative_ends(values)])
    level = DECIDES * min(1.0, float(real.max(initial=0.0)) or 1.0)
    (above,) = np.nonzero(~(size < level))
    return int(above[-1]) + 3 if above.size else values.size


def _across(values: ComplexArray) -> BoolArray:
    """Whether a response crosses the negative real axis after each of its points but the last."""
    turned = (values.imag[1:] < 0) != (values.imag[:-1] < 0)
    return np.asarray(turned & (values.real[1:] + values.real[:-1] < 0))


def _negative_ends(values: ComplexArray) -> BoolArray:
    """Whether both ends are real, up to the distance of a grid from them, and negative.

    The gain of a double integrator, which is neither, rises by a tenth from point to point.
    """
    ends = values[[0, -1]]
    negative = np.asarray(ends.real < -STRAIGHT * np.abs(ends.imag))
    negative[0] &= abs(values[0]) < 1.01 * abs(values[1])
    return negative


def _with_mirrored_ends(
    omega: FloatArray, values: ComplexArray, dt: float
) -> tuple[FloatArray, ComplexArray]:
    """Add a conjugate beyond the ends: a phase of -180 degrees there is between two points then.

    python-control looks for its crossings between points alone.
    """
    end = np.pi / dt if dt else np.inf
    if omega[-1] > (1 - 1e-9) * end:
        inside = omega[:-1]
        omega = np.append(inside, 2 * end - inside[-1])
        values = np.append(values[:-1], values[-2].conj())
    if _negative_ends(values)[0]:
        omega = np.append(-omega[0], omega)
        values = np.append(values[0].conj(), values)
    return omega, values
