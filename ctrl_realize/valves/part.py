"""One part of a valve test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..numerics.signals.edges import Edge

PartKind = Literal["baseline", "step", "staircase", "stroke", "ramp"]


@dataclass(frozen=True)
class TestPart:
    """One part of a valve test.

    The part consists of the samples ``start`` to ``stop - 1`` of its record. ``edges`` are the
    steps of the command in it; a ramp and a baseline have none.

    Attributes
    ----------
    kind : {"baseline", "step", "staircase", "stroke", "ramp"}
    start, stop : int
        Samples of the record.
    before, after : float
        Level of the command at the beginning and at the end, in its unit.
    edges : tuple of Edge
        Steps of the command.
    time : float
        Time of the first change of the command in s; of a baseline, its start.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.1 * np.arange(900)
    >>> u = 50 + 2.0 * np.digitize(t, [30, 60])
    >>> parts = cr.valves.split_test(cr.Record(t, u, u), command_range=(0, 100))
    >>> [(part.kind, part.before, part.after) for part in parts]
    [('baseline', 50.0, 50.0), ('step', 50.0, 52.0), ('step', 52.0, 54.0)]
    """

    __test__ = False  # not a test of pytest

    kind: PartKind
    start: int
    stop: int
    before: float
    after: float
    time: float
    edges: tuple[Edge, ...] = ()
