"""What records say of a loop that was closed about the plant, and of an unstable plant in it."""

from __future__ import annotations

import numpy as np

from ...data import Record
from ...numerics.arrays import FloatArray
from ...numerics.signals.excitation import lively_start
from ...numerics.validation.innovations import feedback_chance
from ...numerics.validation.instability import unstable_chance
from ...results import Flag

RARE = 1e-4
"""Chance of an alarm by noise alone, of each test. Of 290 records without feedback (29 worlds of
`benchmarks.worlds`) the least chance was 1e-3; of 60 loops that are no pure limit cycle, all were
below 1e-4."""
REGRESSED = 4000
"""Samples of the long regressions."""
_LEAST_PAST, _MOST_PAST = 30, 150  # inputs in these regressions, whose time goes with the square


def feedback_flags(records: tuple[Record, ...], delay: float) -> tuple[Flag, ...]:
    """Tell whether an input follows the output; `delay`, in samples, is not exceeded."""
    chances = [
        feedback_chance(y[0], u[0], past_inputs(y[0].size, delay)) for y, u in _stretches(records)
    ]
    if min(chances) >= RARE / len(chances):
        return ()
    return (
        Flag(
            "feedback",
            f"the innovations of input and output are correlated (p = {min(chances):.1g}): a "
            "controller or an operator closes the loop, or the output responds within the "
            "same sample; dead time, gain and lags may be those of the inverse of the "
            "controller: repeat the test in open loop",
        ),
    )


def unstable_flags(records: tuple[Record, ...], delay: float) -> tuple[Flag, ...]:
    """Tell whether a plant of any channels is unstable; `delay`, in samples, is not exceeded."""
    chances = [
        unstable_chance(own, u, past_inputs(own.size // len(u), delay))
        for y, u in _stretches(records)
        for own in y
    ]
    if min(chances) >= RARE / len(chances):
        return ()
    return (
        Flag(
            "unstable",
            "the autocorrelation of the output is that of an unstable plant, stabilised by a "
            f"controller (p = {min(chances):.1g}): fitted models are always stable, so the dead "
            "time, gain and lags of this one are wrong; do not design with it. Identify the closed "
            "loop, from set-point to output, or use a physical model",
        ),
    )


def _stretches(records: tuple[Record, ...]) -> list[tuple[FloatArray, FloatArray]]:
    """Outputs (p, n) and inputs (m, n) of every record's liveliest stretch."""
    found = []
    for record in records:
        inputs, outputs = np.atleast_2d(record.input), np.atleast_2d(record.output)
        start = lively_start(inputs, REGRESSED)
        part = slice(start, start + REGRESSED)
        found.append((outputs[:, part], inputs[:, part]))
    return found


def past_inputs(size: int, delay: float) -> int:
    """Past inputs that reach beyond a dead time, also one that is found wrong."""
    return int(min(max(size // 12, _LEAST_PAST, 1.5 * delay + 10), _MOST_PAST, size // 6))
