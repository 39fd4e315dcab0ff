"""Tests of records for feedback and for an unstable plant in a closed loop."""

from __future__ import annotations

import numpy as np

from ...data import Record
from ...numerics.arrays import FloatArray
from ...numerics.signals.excitation import lively_start
from ...numerics.validation.innovations import feedback_chance
from ...numerics.validation.instability import unstable_chance
from ...results import Flag

RARE = 1e-4
"""Probability of a false alarm of each test. In 290 records without feedback (29 worlds of
`benchmarks.worlds`) the smallest p-value was 1e-3; in 60 loops other than pure limit cycles, all
were below 1e-4."""
REGRESSED = 4000
"""Largest number of samples in the long regressions."""
_LEAST_PAST, _MOST_PAST = (
    30,
    150,
)  # past inputs in them; time grows with the square


def feedback_flags(records: tuple[Record, ...], delay: float) -> tuple[Flag, ...]:
    """Test whether the input depends on the output; `delay` in samples is an upper bound."""
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
    """Test whether a plant of any channels is unstable; `delay` in samples is an upper bound."""
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
    """Outputs (p, n) and inputs (m, n) of the part of each record with the largest variation."""
    found = []
    for record in records:
        inputs, outputs = np.atleast_2d(record.input), np.atleast_2d(record.output)
        start = lively_start(inputs, REGRESSED)
        part = slice(start, start + REGRESSED)
        found.append((outputs[:, part], inputs[:, part]))
    return found


def past_inputs(size: int, delay: float) -> int:
    """Number of past inputs: more than a dead time, even if its estimate is wrong."""
    return int(min(max(size // 12, _LEAST_PAST, 1.5 * delay + 10), _MOST_PAST, size // 6))
