"""Predict each measured step record with joint models of the other records of its plant."""

from __future__ import annotations

from typing import Any

import numpy as np

import ctrl_realize as cr

from .crossed import plant_of
from .measured import Measured

WAYS = ("median of single fits", "joint, one gain", "joint, own gains")


def predicted(system: Any, other: Measured, ratio: float = 1.0) -> tuple[float, float]:
    """Fit in percent of a record that was not seen: as it is, and with the best gain."""
    gain = ratio * other.task.gain
    return other.predicted(gain * np.asarray(system.simulate(other.task.u)))


def at_one_rate(some: list[Measured]) -> list[cr.Record]:
    """Records of a plant at one sample time, the median, from which clocks differ slightly."""
    dt = float(np.median([one.task.record.dt for one in some]))
    return [
        record
        if abs(record.dt - dt) < 1e-6 * dt
        else cr.Record.resampled(record.time, record.input, record.output, dt=dt, name=record.name)
        for record in (one.task.record for one in some)
    ]


def joint_table(records: tuple[Measured, ...]) -> list[str]:
    """Make the table: medians over the records of a plant, each left out once."""
    plants = dict.fromkeys(plant_of(one) for one in records)
    groups = {plant: [one for one in records if plant_of(one) == plant] for plant in plants}
    head = ["plant", "records", *WAYS, "records on which own gains are better", "named as outlying"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for plant, some in groups.items():
        if len(some) < 3:
            continue
        singles = [cr.identify(one.task.record) for one in some]
        given = at_one_rate(some)
        fits = np.array([_left_out(i, some, singles, given) for i in range(len(some))])
        cells = [" / ".join(f"{middle:.1f}" for middle in way) for way in np.median(fits, axis=0)]
        better = " / ".join(str(count) for count in np.sum(fits[:, 2] > fits[:, 0], axis=0))
        named = cr.identify(given, gains="own").fit.gains.outlying
        line = f"| {plant} | {len(some)} | " + " | ".join([*cells, better, ", ".join(named)]) + " |"
        print(line, flush=True)
        lines.append(line)
    return lines


def _left_out(
    i: int, some: list[Measured], singles: list[Any], given: list[cr.Record]
) -> list[tuple[float, float]]:
    """Predictions of one record from all others, in the order of `WAYS`."""
    rest = [record for k, record in enumerate(given) if k != i]
    alone = [predicted(model, some[i]) for k, model in enumerate(singles) if k != i]
    common = cr.identify(rest)
    own = cr.identify(rest, gains="own")
    middle = np.median(alone, axis=0)
    return [
        (float(middle[0]), float(middle[1])),
        predicted(common, some[i]),
        predicted(own, some[i], own.fit.gains.ratio(given[i])),
    ]
