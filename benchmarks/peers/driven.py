"""Records of moving inputs of plants that others have measured, for the fits of single records."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ctrl_realize as cr

from .answers import Answer
from .measured import Measured
from .runners import runner
from .starts import STARTS, from_many_starts
from .tasks import Task

SETS = ("hairdryer", "gas_furnace", "exchanger", "robot_arm")
_DELAYS = 15  # samples that a dead time is sought in
_START = 10  # a tenth of a record is not judged: it depends on what came before the record
FIRST, SECOND = (f"SciPy: order {order} from {STARTS} starts" for order in (1, 2))


@runner(FIRST, "scipy", "order 1")
def first_order(task: Task) -> Answer:
    return from_many_starts(task, 1)


@runner(SECOND, "scipy", "order 2, any zero")
def second_order(task: Task) -> Answer:
    return from_many_starts(task, 2)


RIVALS = {
    "order 1": FIRST,
    "order 2": SECOND,
    "50 starts": f"SciPy: least_squares from {STARTS} starts",
    "ARX": "pysib: ARX(3, 3) for each delay",
    "pysib, OE": "pysib: OE(3, 3) for 26 delays",
    "SRIVC": "SRIVC (a prototype of ours), order 3",
}
"""Ways that take moving inputs, beside `identify`."""


def driven(folder: Path) -> tuple[Measured, ...]:
    """Read the records; their means are taken off, and nobody is told a dead time."""
    return tuple(_read(folder / name / "record.csv") for name in SETS)


def _read(path: Path) -> Measured:
    time, u, y = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
    record = cr.Record(time, u, y, name=path.parent.name)
    delays = tuple(range(_DELAYS + 1))
    task = Task(record, u - u.mean(), y - y.mean(), u.size // _START, 1.0, 0, delays, _DELAYS)
    return Measured(path.parent.name, "record", (0.0, float(_DELAYS)), task)
