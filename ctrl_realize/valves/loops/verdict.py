"""What the methods say together, and what is to be noted about the record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, TypeAlias

import numpy as np

from ..._flags import Flag, flagged
from ...numerics.arrays import FloatArray
from ...numerics.oscillation.cycles import FEWEST_CYCLES, SHORTEST_PERIOD, Cycles, resolution
from .data import LONGEST_GAP, LoopData
from .methods import VOTERS, LoopMethod

LoopVerdict: TypeAlias = Literal[
    "stiction", "no stiction: tuning or external oscillation", "no oscillation", "cannot tell"
]

_SHORTEST_SAMPLED = 4.0
"""Samples of a period below which noise has one, too."""
_DECAY, _ALIKE = 0.6, 0.6
"""Limits of decay ratio and like half cycles from which on an oscillation is taken for sure. Above
the published 0.5 and 0.4: of random walks, which have cycles of all lengths, 7 % pass instead of
30 %."""
_FEWEST_TO_DENY = 100
"""Samples from which on a record without regular cycles is said not to oscillate."""
_SATURATED = 0.05
_COARSE = 10.0
"""Levels from the smallest to the largest value, below which the shape of a cycle is lost."""


def oscillates(cycles: Cycles | None) -> bool | None:
    """Whether there is an oscillation; None if this cannot be told."""
    if cycles is None or cycles.period < _SHORTEST_SAMPLED:
        return False
    regular = cycles.regularity > 1
    if regular and cycles.decay_ratio > _DECAY and cycles.alike > _ALIKE:
        return True
    published = (regular, cycles.decay_ratio > 0.5, cycles.alike > 0.4)
    return None if sum(published) > 1 else False


def flags_of(data: LoopData, cycles: Cycles | None) -> Iterator[Flag]:
    """List what the record lacks."""
    if data.left_out:
        count = data.op.size
        yield flagged("missing_samples", count=count, all=count + data.left_out)
    if data.filled:
        count = data.op.size
        yield flagged("filled_samples", filled=data.filled, count=count, longest=LONGEST_GAP)
    for name, signal in (("controller output", data.op), ("process value", data.pv)):
        if np.ptp(signal) == 0:
            yield flagged("constant_signal", name=name)
        elif np.ptp(signal) < _COARSE * resolution(signal):
            levels = np.ptp(signal) / resolution(signal) + 1
            yield flagged("coarse_quantisation.loop", name=name, levels=levels)
    limited = _at_limits(data.op)
    if limited > _SATURATED:
        yield flagged("saturated_output", limited=limited)
    if data.sp is not None and np.std(data.sp) > 0.2 * np.std(data.pv - data.sp):
        yield flagged("set_point_moves")
    if cycles is not None and oscillates(cycles) is not False:
        if cycles.period < 2 * SHORTEST_PERIOD:
            yield flagged("few_samples_per_cycle", period=cycles.period)
        if cycles.count < 2 * FEWEST_CYCLES:
            yield flagged("few_cycles", count=cycles.count, fewest=2 * FEWEST_CYCLES)


SPOILS = {"constant_signal", "saturated_output", "set_point_moves", "coarse_quantisation"}
"""Flags with which the cause of an oscillation cannot be told."""


def judge(
    state: bool | None, samples: int, methods: Sequence[LoopMethod], flags: Sequence[Flag]
) -> tuple[LoopVerdict, str]:
    """Return the verdict and its reason.

    A verdict on the cause needs two methods that agree, and twice as many as contradict them.
    """
    constant = [flag for flag in flags if flag.code == "constant_signal"]
    if constant:
        return "cannot tell", constant[0].message
    if state is False and samples < _FEWEST_TO_DENY:
        return "cannot tell", f"{samples} samples are too few to say that there is no oscillation"
    if state is False:
        return "no oscillation", "no regular oscillation in the process value"
    if state is None:
        return "cannot tell", "whether the process value oscillates is not clear"
    spoilt = [flag.message for flag in flags if flag.code in SPOILS]
    if spoilt:
        return "cannot tell", spoilt[0]
    votes = [one for one in methods if one.key in VOTERS]
    sticks = [one.name for one in votes if one.verdict == "stiction"]
    not_so = [one.name for one in votes if one.verdict == "no stiction"]
    named = (("stiction", sticks), ("no stiction", not_so))
    told = "; ".join(f"{word} by {', '.join(names)}" for word, names in named if names)
    if len(sticks) > 1 and len(sticks) >= 2 * len(not_so):
        return "stiction", told
    if len(not_so) > 1 and len(not_so) >= 2 * len(sticks):
        return "no stiction: tuning or external oscillation", told
    return "cannot tell", told or "no method tells"


def _at_limits(signal: FloatArray) -> float:
    """Part of the samples that rest at the smallest or the largest value."""
    rest = np.zeros(signal.size, dtype=bool)
    rest[1:] = signal[1:] == signal[:-1]
    ends = (signal == signal.min()) | (signal == signal.max())
    return float(np.mean(rest & ends))
