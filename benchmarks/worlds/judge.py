"""Judge one answer: is the truth inside, and if not, does a flag say so?"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

import ctrl_realize as cr

from ..honesty.trial import quietly
from .simulation import World

OFF = 0.2
"""Relative error of gain or total delay that counts as a miss."""
MODEL = frozenset(
    {
        "structured_misfit",
        "input_in_residual",
        "feedback",
        "late_input",
        "not_exciting",
        "not_linear",
        "time_varying",
        "earlier_input",
        "not_at_rest",
        "noncausal",
        "cancelled_pair",
        "output_at_limit",
        "coarse_quantisation",
        "records_differ",
        "gains_differ",
        "amplitude_trend",
        "unstable",
    }
)
"""Flags that doubt the model as a whole. That nothing was told about a residual but that it is
coloured does not count, nor that no delay is resolved: that gives an upper end of its own."""
DELAY = MODEL | {
    "structures_disagree",
    "many_lags",
    "dispersed_flow",
    "delay_at_bound",
    "held_output",
}
"""Flags that doubt the dead time."""
GAIN = MODEL | {"not_settled", "integrating", "gain_not_resolved", "load_disturbance"}
"""Flags that doubt gain and total delay."""


@dataclass(frozen=True)
class Judged:
    """One record: errors, misses, and which of them no flag concerns.

    `errors` are relative, of the dead time in samples beyond the nearer end of the interval.
    """

    world: str
    seed: int
    missed: tuple[str, ...]
    silent: tuple[str, ...]
    flags: tuple[str, ...]
    numbers: dict[str, float]
    refused: str = ""


def judged(world: World, seed: int) -> Judged:
    """Make a record, identify it with the defaults, and compare."""
    rng = np.random.default_rng([seed, zlib.crc32(world.__name__.encode())])
    case = world(rng)
    with quietly():
        try:
            system = cr.identify(case.records)
        except cr.CtrlRealizeError as error:
            return Judged(world.__name__, seed, (), (), (), {}, f"{type(error).__name__}: {error}")
    fit = system.fit
    flags = tuple(sorted({flag.code for flag in fit.flags}))
    with np.errstate(all="ignore"):
        gain = float(np.ravel(system.delay_free.dcgain())[0]) if fit.gain is None else fit.gain
    low, high = fit.interval
    missed = []
    slack = 1e-9 * high
    if not low - slack <= case.dead_time <= high + slack:
        missed.append("dead time")
    total = fit.total_delay if fit.total_delay is not None else np.nan
    for name, found, truth in (
        ("gain", gain, case.gain),
        ("total delay", total, case.total_delay),
    ):
        if np.isfinite(truth) and not abs(found - truth) <= OFF * abs(truth):
            missed.append(name)
    concern = {"dead time": DELAY, "gain": GAIN, "total delay": GAIN}
    silent = tuple(name for name in missed if not concern[name] & set(flags))
    numbers = {
        "dead time": case.dead_time,
        "found": fit.dead_time,
        "low": low,
        "high": high,
        "gain": gain / case.gain,
        "total delay": total / case.total_delay,
    }
    return Judged(world.__name__, seed, tuple(missed), silent, flags, numbers)
