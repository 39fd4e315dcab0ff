"""Part of a very long record that is fitted: that in which the inputs move."""

from __future__ import annotations

import numpy as np

from .._flags import Flag, flagged
from ..data import Record
from ..numerics.signals.excitation import lively_start

MOST_SAMPLES = 100_000
"""Largest number of samples, of all records together, for a state-space fit. More do not improve a
delay of whole samples; memory grows with their number times that of the parameters."""


def lively_parts(records: tuple[Record, ...]) -> tuple[tuple[Record, ...], tuple[Flag, ...]]:
    """Cut records to `MOST_SAMPLES` in total, with a flag; shorter records are not changed."""
    lengths = np.array([record.n_samples for record in records])
    share, fair = MOST_SAMPLES, MOST_SAMPLES // len(records)
    while np.minimum(lengths, share).sum() > MOST_SAMPLES and share > fair:
        share = max(int(0.9 * share), fair)
    if lengths.max() <= share:
        return records, ()
    starts = [lively_start(np.atleast_2d(record.input), share) for record in records]
    parts = tuple(_part(*pair, share) for pair in zip(records, starts, strict=True))
    longest = int(np.argmax(lengths))
    first, samples = starts[longest], lengths[longest]
    return parts, (flagged("cut", used=share, first=first, samples=samples, others=""),)


def _part(record: Record, start: int, count: int) -> Record:
    if record.n_samples <= count:
        return record
    return record.between(*record.time[[start, start + count - 1]])
