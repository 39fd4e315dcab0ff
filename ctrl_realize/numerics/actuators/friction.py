"""Backlash, and the data-driven models of stiction: Choudhury's and Kano's.

All of them map a command to a stem position. S is the width of dead band plus stick band, the
change of the command that a reversal needs before the stem moves; J is the slip jump. A stem that
moves follows the command at a distance of (S - J) / 2. The algorithms follow the logic that the
papers describe; the order of the tests and the state before the first sample are our own.

*Choudhury* [1]_: a stem that stops because the command pauses needs |change| > J to move again, one
that stops because the command turns needs |change| > S. *Kano* [2]_: remembers in addition on which
side of the friction the stem stopped, so that after a pause a reversal needs S, and the same
direction J. For commands that pause between moves this is the model of He and others [3]_, with
static friction (S + J) / 2 and kinetic friction (S - J) / 2.

For J = 0 Kano's is backlash of width S, and Choudhury's is as well for commands that swing by more
than S.

References
----------
.. [1] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, Modelling valve stiction, Control
   Engineering Practice 13 (2005) 641-658, doi:10.1016/j.conengprac.2004.05.005.
.. [2] M. Kano, H. Maruta, H. Kugemoto and K. Shimizu, Practical model and detection algorithm for
   valve stiction, IFAC Symposium on Dynamics and Control of Process Systems, Cambridge 2004.
.. [3] Q. P. He, J. Wang, M. Pottmann and S. J. Qin, A curve fitting method for detecting valve
   stiction in oscillating control loops, Ind. Eng. Chem. Res. 46 (2007) 4549-4560,
   doi:10.1021/ie061219a.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray

_IN_CACHE = 30_000
"""Positions that are worked on at once."""


def backlash(position: FloatArray, width: float, start: float = 0.0) -> FloatArray:
    """Follow `position` (N,) through backlash, or a dead band, of total `width`.

    `start` is the place within the play before the first sample: 0 its middle, 1 where a rising
    input moves the output at once, -1 where a falling one does.
    """
    half = width / 2
    out = []
    current = float(position[0]) - start * half
    for wanted in position.tolist():
        current = min(max(current, wanted - half), wanted + half)
        out.append(current)
    return np.array(out)


Stem: TypeAlias = tuple[float, float, float, float, bool, bool, float]
"""A `StemState` without names."""


class StemState(NamedTuple):
    """State of Kano's and Choudhury's models between two samples.

    `command` is the last one, `position` that of the stem; `direction` is +1 or -1 where the stem
    last moved up or down; `rest` is the command at which it stopped; `moving`: it does move;
    `paused`: it stopped because the command paused, not because it turned; `slope` is the last
    change of the command.
    """

    command: float
    position: float
    direction: float
    rest: float
    moving: bool = False
    paused: bool = True
    slope: float = 0.0


def stem_at_rest(
    command: float, stick: float, jump: float, start: float = 0.0, *, sided: bool = True
) -> StemState:
    """State of a stem at rest that last moved up (`start` 1), down (-1), or is relaxed (0).

    `stick` is S, `jump` is J. A relaxed stem is at the command, and needs (S + J) / 2 in either
    direction. Between 1 and -1 the state is that of a stem that last moved up, and whose command
    has returned by ``(1 - start) / 2`` of S - J since.

    `sided` is for Kano's model. Choudhury's does not know on which side of the friction a stem at
    rest is: its first move, in either direction, needs J from a stop after a move up, and S
    otherwise.
    """
    position = command - start * (stick - jump) / 2
    if not sided:
        return StemState(command, position, 1.0, command, paused=start == 1.0)
    # A stem that moved up stopped where the command was (S - J) / 2 above it.
    return StemState(command, position, 1.0, position + (stick - jump) / 2)


def stem_step(state: Stem, command: float, stick: float, jump: float, sided: bool) -> Stem:
    """Advance Kano's model, which is `sided`, or Choudhury's by one sample.

    They differ in when the change from rest only has to exceed J: where it goes on in the
    direction of the last move, or where the command has paused.
    """
    last, position, direction, rest, moving, paused, slope = state
    change = command - last
    if moving and change * slope <= 0:
        moving, paused, rest = False, change == 0, last
    if not moving:
        away = command - rest
        free = direction * away > 0 if sided else paused
        if abs(away) > (jump if free else stick):
            moving, direction = True, 1.0 if away > 0 else -1.0
    if moving:
        position = command - direction * (stick - jump) / 2
    # not a StemState: for every sample, its names take longer than all the rest
    return command, position, direction, rest, moving, paused, change


def kano(
    position: FloatArray, stick: float, jump: float, start: float = 0.0, *, sided: bool = True
) -> FloatArray:
    """Stem positions (N,) for commands `position` by Kano's model, or Choudhury's if not `sided`.

    `start` as `stem_at_rest`.
    """
    state: Stem = stem_at_rest(float(position[0]), stick, jump, start, sided=sided)
    out = []
    for command in position.tolist():
        state = stem_step(state, command, stick, jump, sided)
        out.append(state[1])
    return np.array(out)


def kano_rows(
    position: FloatArray, stick: FloatArray, jump: FloatArray, stops: Mapping[int, float]
) -> FloatArray:
    """Stem positions (M, N) for commands `position` (N,) by Kano's model, for M pairs of S and J.

    `stops` tells at which samples, of which the first is one, the stem is known to have stopped
    after a move up (1) or down (-1): a stem whose last move was another one is put there.

    A stem at rest moves once the command is more than (S + J) / 2 away from it, and then follows
    until the command turns or pauses: only the ends of its runs decide, and few of them.
    """
    half, reach = (stick - jump) / 2, (stick + jump) / 2
    first, rising, turning = _runs(position, stops)
    lengths = np.diff(first, append=position.size)
    ends = position[first + lengths - 1]
    stem, up = position[0] - stops[0] * half, np.full(stick.shape, stops[0] > 0)
    stems, last = [stem], []  # at rest, and which of these is at the beginning of every run
    highest, lowest = float((stem + reach).min()), float((stem - reach).max())
    for k, end, rises, turns in zip(
        first.tolist(), ends.tolist(), rising.tolist(), turning.tolist(), strict=True
    ):
        if k in stops:
            missed = up != (stops[k] > 0)
            up[missed] = stops[k] > 0
            stem = np.where(missed, position[k] - stops[k] * half, stem)
            stems.append(stem)
            highest, lowest = float((stem + reach).min()), float((stem - reach).max())
        last.append(len(stems) - 1)
        if lowest <= end <= highest:
            continue
        moved = end - stem > reach if rises else stem - end > reach
        up[moved] = rises
        if turns:
            stem = np.where(moved, end - half if rises else end + half, stem)
            stems.append(stem)
            highest, lowest = float((stem + reach).min()), float((stem - reach).max())
    out, rests = np.empty((position.size, stick.size)), np.stack(stems)
    rest = np.repeat(last, lengths)
    few = max(_IN_CACHE // stick.size, 1)
    for k in range(0, position.size, few):
        followed, command = rests[rest[k : k + few]], position[k : k + few, None]
        away = command - followed
        np.copyto(followed, command - np.copysign(half, away), where=np.abs(away) > reach)
        out[k : k + few] = followed
    return out.T


def _runs(
    position: FloatArray, stops: Mapping[int, float]
) -> tuple[IntArray, BoolArray, BoolArray]:
    """Runs of a command in one direction, with the pauses after them, cut at `stops`.

    First samples, whether the command rises, and whether it turns, or has paused, at the end.
    """
    change = np.diff(position, prepend=position[0])
    begins = change != 0
    begins[1:] &= np.sign(change[1:]) != np.sign(change[:-1])
    turns = np.flatnonzero(begins)
    first = np.unique(np.concatenate([turns, list(stops)])).astype(np.int64)
    run = np.searchsorted(turns, first, side="right") - 1
    rising = np.append(change[turns] > 0, False)[run]
    return first, rising, np.diff(run, append=turns.size) > 0
