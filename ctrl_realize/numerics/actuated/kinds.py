"""The kinds of actuators that are fitted: one entry of a table each.

Saturation and characteristics are parametrised over the range of the commands, which they map on
itself, so that a gain is the mean one over this range. Equal percentages are those of [1]_: over h
from 0 to 1 in this range the flow is ``(r^h - 1) / (r - 1)``, with r the ratio of its slopes at
the two ends.

References
----------
.. [1] IEC 60534-2-4, Industrial-process control valves, Part 2-4: Flow capacity, inherent flow
   characteristics and rangeability.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ..actuators.friction import backlash, choudhury, kano
from ..actuators.limits import resolved
from ..arrays import FloatArray

Kind: TypeAlias = Literal[
    "none",
    "slew_rate",
    "slew_rates",
    "dead_band",
    "resolution",
    "whole_steps",
    "kano",
    "choudhury",
    "top",
    "bottom",
    "both_ends",
    "equal_percentage",
    "points",
]
Place: TypeAlias = Literal["input", "stem"]

_RATES = np.geomspace(10.0, 0.1, 9)  # ranges of the command in the visible rise, fastest first
_RATIOS = (3.0, 1.0, 1 / 3)  # of the rate in closing to that in opening
_WIDTHS = np.geomspace(3e-3, 0.6, 10)  # parts of the range of the command
_FINE_WIDTHS = np.geomspace(5e-3, 0.8, 36)
_ENDS = (0.4, 0.6, 0.75, 0.9, 0.97)  # of the travel, as parts of the range of the commands
_BENDS = (0.3, 1.0, 2.0, 3.5)  # logarithms of a ratio of slopes
_STRAIGHT, _BENT = 1e-3, 7.0
_OF_STICTION: tuple[Kind, ...] = ("dead_band", "resolution")  # without a slip jump, and J = S


class Size(NamedTuple):
    """What the size of parameters is measured by: reach of the commands, times in s, levels."""

    reach: float
    rise: float
    length: float
    dt: float
    levels: tuple[float, ...]


class Acting(NamedTuple):
    """An actuator: its kind, its place, and its parameters.

    `values` are slew rates per second, upwards and downwards if there are two; the dead band; the
    resolution; S and J; ends of the travel, or flows at the inner levels, as parts of the range of
    the commands; the ratio r of equal percentages. `levels` are those of the commands.
    """

    kind: Kind
    place: Place
    values: tuple[float, ...] = ()
    levels: tuple[float, ...] = ()

    @property
    def form(self) -> Form:
        """The entry of the table."""
        return FORMS[self.kind]


@dataclass(frozen=True)
class Form:
    """Entry of the table.

    Attributes
    ----------
    count : int
        Number of parameters; of a characteristic by points as many as there are inner levels.
    position : callable, optional
        Positions for a command (N,) and a start; none for a limited rate, which takes time.
    grid : callable
        Entries (G, count) of x that are tried.
    bounds : callable
        Lowest and highest entry.
    logged : bool
        Whether x has the logarithms of the parameters.
    starts : bool
        Whether the place within play or friction at the beginning matters.
    jump : int, optional
        Which parameter is a slip jump, on which the misfit depends in steps.
    own_lags : bool
        Whether it changes how fast the response is, so that lags are searched for each structure.
    contains : tuple of str
        Simpler kinds. It takes the place of one only where the evidence is very strong.
    """

    count: int
    position: Callable[[Acting, FloatArray, float], FloatArray] | None
    grid: Callable[[Size], FloatArray]
    bounds: Callable[[Size], tuple[float, float]]
    logged: bool = True
    starts: bool = False
    jump: int | None = None
    own_lags: bool = False
    contains: tuple[Kind, ...] = ()

    @property
    def static(self) -> bool:
        """Whether it depends on where the command is, and on nothing else."""
        return self.position is not None and not self.starts and self.jump is None

    @property
    def stepwise(self) -> bool:
        """Whether it decides alone which steps of a command move a stem: no slope tells it."""
        return self.jump == 0

    @property
    def limits_rate(self) -> bool:
        """Whether it takes time."""
        return self.own_lags and self.count > 0


def _linear(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return command


def _played(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return backlash(command, acting.values[0], start)


def _kano(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return kano(command, acting.values[0], acting.values[-1], start)


def _whole_steps(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return resolved(command, acting.values[0])


def _choudhury(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return choudhury(command, acting.values[0], acting.values[1], start)


def _below(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return np.minimum(command, _at(acting, acting.values[0]))


def _above(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    return np.maximum(command, _at(acting, acting.values[0]))


def _between(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    low, high = acting.values
    return np.minimum(np.maximum(command, _at(acting, low)), _at(acting, high))


def _equal_percentage(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    lowest, highest = acting.levels[0], acting.levels[-1]
    bend = float(np.log(acting.values[0]))
    travel = np.clip((command - lowest) / (highest - lowest), -0.5, 1.5)
    flow = np.expm1(bend * travel) / np.expm1(bend)
    return np.asarray(lowest + (highest - lowest) * flow)


def _interpolated(acting: Acting, command: FloatArray, start: float) -> FloatArray:
    flows = [_at(acting, part) for part in (0.0, *acting.values, 1.0)]
    return np.asarray(np.interp(command, acting.levels, flows))


def _at(acting: Acting, part: float) -> float:
    """Command at a part of the range."""
    lowest, highest = acting.levels[0], acting.levels[-1]
    return lowest + part * (highest - lowest)


def _column(values: FloatArray) -> FloatArray:
    return np.log(values)[:, None]


def _rates(size: Size) -> FloatArray:
    return _RATES * size.reach / size.rise


def _pairs_of_rates(size: Size) -> FloatArray:
    return np.log([(rate, rate * ratio) for rate in _rates(size) for ratio in _RATIOS])


def _sticks_and_jumps(size: Size) -> FloatArray:
    widths = _WIDTHS * size.reach
    return np.log([(stick, jump) for i, stick in enumerate(widths) for jump in widths[: i + 1]])


def _flows(size: Size) -> FloatArray:
    levels = np.array(size.levels)
    travel = (levels[1:-1] - levels[0]) / (levels[-1] - levels[0])
    bent = [np.expm1(bend * travel) / np.expm1(bend) for bend in (*_BENDS, *-np.array(_BENDS))]
    return np.array([travel, *bent])


def _of_rates(size: Size) -> tuple[float, float]:
    return np.log(0.2 * size.reach / size.length), np.log(2.0 * size.reach / size.dt)


def _of_widths(size: Size) -> tuple[float, float]:
    return np.log(1e-4 * size.reach), np.log(1.5 * size.reach)


def _of_parts(size: Size) -> tuple[float, float]:
    return 0.0, 1.0


FORMS: dict[Kind, Form] = {
    "none": Form(0, _linear, lambda _: np.empty((1, 0)), _of_parts, own_lags=True),
    "slew_rate": Form(1, None, lambda size: _column(_rates(size)), _of_rates, own_lags=True),
    "slew_rates": Form(
        2, None, _pairs_of_rates, _of_rates, own_lags=True, contains=("slew_rate",)
    ),
    "dead_band": Form(
        1, _played, lambda size: _column(_WIDTHS * size.reach), _of_widths, starts=True
    ),
    "resolution": Form(
        1, _kano, lambda size: _column(_FINE_WIDTHS * size.reach), _of_widths, jump=0
    ),
    "whole_steps": Form(
        1, _whole_steps, lambda size: _column(_FINE_WIDTHS * size.reach), _of_widths, jump=0
    ),
    "kano": Form(
        2, _kano, _sticks_and_jumps, _of_widths, starts=True, jump=1, contains=_OF_STICTION
    ),
    "choudhury": Form(
        2, _choudhury, _sticks_and_jumps, _of_widths, starts=True, jump=1,
        contains=_OF_STICTION,
    ),
    "top": Form(1, _below, lambda _: np.array(_ENDS)[:, None], _of_parts, logged=False),
    "bottom": Form(1, _above, lambda _: 1 - np.array(_ENDS)[:, None], _of_parts, logged=False),
    "both_ends": Form(
        2,
        _between,
        lambda _: np.array([(1 - low, high) for low in _ENDS[1:] for high in _ENDS[1:]]),
        _of_parts,
        logged=False,
        contains=("top", "bottom"),
    ),
    "equal_percentage": Form(
        1,
        _equal_percentage,
        lambda _: np.array(_BENDS)[:, None],
        lambda _: (_STRAIGHT, _BENT),
    ),
    "points": Form(
        0, _interpolated, _flows, _of_parts, logged=False,
        contains=("equal_percentage", "top", "bottom", "both_ends"),
    ),
}  # fmt: skip
