"""What an actuator does to its command: one entry of a table for each kind.

Stiction is Kano's; a dead band is backlash. Ends of the travel, and the flows of a characteristic
at its levels, are parts of the range of the commands, which the characteristic maps on itself, so
that a gain is the mean one over this range. Grids and bounds are our own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ..actuators.friction import backlash, kano
from ..actuators.limits import slew_limited
from ..arrays import FloatArray
from .records import ActuatedRecord

Kind: TypeAlias = Literal[
    "slew_rate", "slew_rates", "dead_band", "resolution", "stiction", "saturation", "characteristic"
]
Place: TypeAlias = Literal["input", "stem"]

_RATES = np.geomspace(10.0, 0.1, 9)  # ranges of the command in the visible rise, fastest first
_WIDTHS = np.geomspace(3e-3, 0.6, 10)  # parts of the range of the command
_FINE_WIDTHS = np.geomspace(5e-3, 0.8, 36)
_ENDS = (0.03, 0.1, 0.25, 0.4)  # parts of the range beyond an end of the travel


class Size(NamedTuple):
    """What parameters are measured by: range of the commands, times in s, levels (L,)."""

    reach: float
    rise: float
    length: float
    dt: float
    levels: FloatArray


@dataclass(frozen=True)
class Properties:
    """Entry of the table.

    Attributes
    ----------
    names : tuple of str
        Of the parameters; none: flows at the levels inside the range of the commands.
    position : callable, optional
        Positions for the parameters, the levels, a command (N,) and a start; none for a limited
        rate, which takes time.
    grid : callable
        Entries (G, k) of x that are tried.
    bounds : callable
        Lowest and highest entry.
    logged : bool
        Whether x has the logarithms of the parameters.
    starts : bool
        Whether the place within play or friction at the beginning matters.
    jump : int, optional
        Which parameter is a slip jump, on which the misfit depends in steps.
    extends : tuple of str
        Simpler kinds that it contains. It takes their place only where the evidence is very strong.
    """

    names: tuple[str, ...]
    position: Callable[[Sequence[float], Sequence[float], FloatArray, float], FloatArray] | None
    grid: Callable[[Size], FloatArray]
    bounds: Callable[[Size], tuple[float, float]]
    logged: bool = True
    starts: bool = False
    jump: int | None = None
    extends: tuple[Kind, ...] = ()

    def named(self, levels: Sequence[float]) -> tuple[str, ...]:
        """Names of the parameters for commands at some levels."""
        return self.names or tuple(f"flow_at_{u:g}" for u in levels[1:-1])

    @property
    def places(self) -> tuple[Place, ...]:
        """Where it is tried: a stem that jumps is not seen behind lags that are unknown."""
        return ("input", "stem") if self.jump is None else ("input",)

    @property
    def sticks(self) -> bool:
        """Whether it holds a stem back, however slow the command is."""
        return self.starts or self.jump is not None


class Motion(NamedTuple):
    """An actuator: its kind, its parameters, and the levels of the commands."""

    kind: Kind
    values: tuple[float, ...]
    levels: tuple[float, ...]

    def followed(self, demand: FloatArray, dt: float, start: float) -> FloatArray:
        """Position (N,) for a demand (N,) that changes from sample to sample."""
        position = KINDS[self.kind].position
        if position is None:
            return slew_limited(demand, self.values[0], self.values[-1], dt)
        return position(self.values, self.levels, demand, start)

    def driven(self, record: ActuatedRecord, start: float) -> FloatArray:
        """Position (N,) for the command of a record: its mean over every sample."""
        position = KINDS[self.kind].position
        if position is None:
            return slewed_means(record.command, record.dt, self.values[0], self.values[-1])
        held, index = record.held
        return position(self.values, self.levels, held, start)[index]


def slewed_means(command: FloatArray, dt: float, up: float, down: float) -> FloatArray:
    """Follow a command (N,) that is held over every sample: mean position over each of them."""
    out, current = command.tolist(), float(command[0])
    moves = [*np.flatnonzero(np.diff(command, prepend=command[0])).tolist(), len(out)]
    for first, following in pairwise(moves):
        for k in range(first, following):
            away = out[k] - current
            most = (up if away > 0 else down) * dt
            if abs(away) <= most:
                # The triangle of the time that is left to go is missing.
                current = out[k]
                out[k] -= away * abs(away) / (2 * most)
                break
            move = most if away > 0 else -most
            out[k] = current + move / 2
            current += move
    return np.array(out)


def at_parts(levels: Sequence[float], parts: Sequence[float]) -> FloatArray:
    """Commands at parts of their range."""
    return np.asarray(levels[0] + np.array(parts) * (levels[-1] - levels[0]))


def _rates(size: Size) -> FloatArray:
    return np.log(_RATES * size.reach / size.rise)[:, None]


def _sticks_and_jumps(size: Size) -> FloatArray:
    widths = _FINE_WIDTHS[::2] * size.reach
    return np.log([(stick, jump) for i, stick in enumerate(widths) for jump in widths[: i + 1]])


def _of_rates(size: Size) -> tuple[float, float]:
    return np.log(0.2 * size.reach / size.length), np.log(2.0 * size.reach / size.dt)


def _of_widths(size: Size) -> tuple[float, float]:
    return np.log(1e-4 * size.reach), np.log(1.5 * size.reach)


KINDS: dict[Kind, Properties] = {
    "slew_rate": Properties(("slew_rate",), None, _rates, _of_rates),
    "slew_rates": Properties(
        ("slew_rate_opening", "slew_rate_closing"), None,
        lambda size: np.repeat(_rates(size), 2, axis=1), _of_rates, extends=("slew_rate",),
    ),
    "dead_band": Properties(
        ("dead_band",),
        lambda values, levels, command, start: backlash(command, values[0], start),
        lambda size: np.log(_WIDTHS * size.reach)[:, None], _of_widths, starts=True,
    ),
    "resolution": Properties(
        ("resolution",),
        lambda values, levels, command, start: kano(command, values[0], values[0], start),
        lambda size: np.log(_FINE_WIDTHS * size.reach)[:, None], _of_widths, jump=0,
    ),
    "stiction": Properties(
        ("S", "J"),
        lambda values, levels, command, start: kano(command, values[0], values[1], start),
        _sticks_and_jumps, _of_widths, starts=True, jump=1, extends=("dead_band", "resolution"),
    ),
    "saturation": Properties(
        ("travel_low", "travel_high"),
        lambda values, levels, command, start: np.clip(command, *at_parts(levels, values)),
        lambda size: np.array([(low, 1 - high) for low in _ENDS for high in _ENDS]),
        lambda size: (0.0, 1.0), logged=False,
    ),
    "characteristic": Properties(
        (),
        lambda values, levels, command, start: np.interp(
            command, levels, at_parts(levels, (0.0, *values, 1.0))
        ),
        lambda size: (size.levels[None, 1:-1] - size.levels[0]) / np.ptp(size.levels),
        lambda size: (0.0, 1.0), logged=False, extends=("saturation",),
    ),
}  # fmt: skip
