"""Exact frequency responses for the margins of python-control."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator

import numpy as np

from ..errors import UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.loops.crossings import follow, frequency_grid
from .deferred import DeferredMatrices

FINE = 0.1
"""Phase in rad between the points of a response from which margins are interpolated: the cubic
spline of python-control is then accurate to 1e-6."""

DECIDES = 0.2
"""Least relative gain that matters for a margin; beyond the last frequency with such a gain the
response is left out."""


class HostMargins(DeferredMatrices):
    """Unpacks as a frequency response, which functions for margins accept."""

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
        features, dead_time = self.features()
        sizes = np.abs(features)
        sizes = sizes[sizes > 0]
        dt = float(self.dt or 0)
        fastest = float(sizes.max(initial=1 / dead_time if dead_time else 1.0))
        top = np.pi / dt if dt else self._gain_is_gone(fastest)
        low = 1e-3 * min(float(sizes.min(initial=top)), 1 / dead_time if dead_time else top)

        def curve(omega: FloatArray) -> ComplexArray:
            x = np.exp(1j * omega * dt) if dt else 1j * omega
            return np.asarray(self.horner(x, warn_infinite=False)[0, 0])

        omega, values = follow(curve, frequency_grid(low, top, features, dead_time))
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
