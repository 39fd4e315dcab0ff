"""The installed characteristic of a valve: from travel to flow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .._checks import finite, one_of, positive
from ..errors import OptionError
from ..numerics.arrays import FloatArray
from .limits import StaticMap, ordered

_KINDS = ("linear", "equal-percentage", "quick-opening", "points")


@dataclass(frozen=True)
class Characteristic(StaticMap):
    """Flow over travel, as installed: linear, equal percentage, quick opening, or measured.

    With the relative travel h from 0 to 1 the flow is ``full_flow * f(h)``, where f(h) = h is
    linear, R^(h - 1) equal percentage with the rangeability R, and h^a, a < 1, quick opening.
    Beyond the ends of the travel the flow stays.

    Parameters
    ----------
    kind : {"linear", "equal-percentage", "quick-opening", "points"}
        Of the curve.
    low, high : float
        Travel of the closed and of the open valve.
    full_flow : float, default 100
        Flow of the open valve.
    rangeability : float, default 50
        R, more than 1.
    exponent : float, default 0.5
        a.
    points : sequence of (float, float)
        Relative travels, increasing, and relative flows, between which f is interpolated.

    Raises
    ------
    OptionError
        Parameters outside of these limits.

    References
    ----------
    .. [1] IEC 60534-2-4, Industrial-process control valves, Part 2-4: Flow capacity, inherent flow
       characteristics and rangeability.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plug = cr.actuators.Characteristic("equal-percentage", rangeability=50)
    >>> print(plug)
    equal-percentage characteristic, rangeability 50
    >>> plug.simulate([0, 50, 100]).round(2).tolist()
    [2.0, 14.14, 100.0]
    """

    kind: Literal["linear", "equal-percentage", "quick-opening", "points"] = "linear"
    low: float = 0.0
    high: float = 100.0
    full_flow: float = 100.0
    rangeability: float = 50.0
    exponent: float = 0.5
    points: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        one_of(self.kind, "kind", _KINDS)
        ordered(self.low, self.high)
        positive(self.full_flow, "full_flow", "flow of the open valve")
        if positive(self.rangeability, "rangeability", "ratio of flows") <= 1:
            raise OptionError(f"rangeability={self.rangeability!r}; expected a value above 1")
        if positive(self.exponent, "exponent", "exponent of the travel") >= 1:
            raise OptionError(f"exponent={self.exponent!r}; expected a value below 1")
        given = finite(self.points, "points")
        if (self.kind == "points" or given.size) and (
            given.ndim != 2
            or given.shape[0] < 2
            or given.shape[1] != 2
            or not (np.diff(given[:, 0], prepend=-1e-9, append=1 + 1e-9) > 0).all()
        ):
            raise OptionError(
                f"points={self.points!r}; expected at least two pairs (relative travel, relative "
                "flow) with increasing travels from 0 to 1"
            )
        object.__setattr__(self, "points", tuple((float(h), float(f)) for h, f in self.points))

    def __str__(self) -> str:
        more = {
            "equal-percentage": f", rangeability {self.rangeability:g}",
            "quick-opening": f", exponent {self.exponent:g}",
            "points": f" at {len(self.points)} travels",
        }
        name = "measured" if self.kind == "points" else self.kind
        return f"{name} characteristic{more.get(self.kind, '')}"

    def _simulated(self, command: FloatArray, dt: float) -> FloatArray:
        travel = np.clip((command - self.low) / (self.high - self.low), 0.0, 1.0)
        if self.kind == "equal-percentage":
            return self.full_flow * self.rangeability ** (travel - 1.0)
        if self.kind == "quick-opening":
            return self.full_flow * travel**self.exponent
        if self.kind == "points":
            at, flow = np.array(self.points).T
            return np.asarray(self.full_flow * np.interp(travel, at, flow))
        return np.asarray(self.full_flow * travel)
