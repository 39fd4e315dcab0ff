"""Step records of plants that others have measured, and the bands of their dead times.

The bands are what the authors state or the first motion allows: doubtful by a sample or two
themselves, and no truth. The records are no part of the project.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import ctrl_realize as cr

from .answers import Answer
from .tasks import Task

# Seconds for the canal, samples for the rest. The gates of the `slow` records take a quarter of
# a second longer, give or take.
CANAL = {"1_2": (1.15, 1.45), "2_3": (0.4, 0.85)}
SLOWER = (0.1, 0.4)
SAMPLES = {
    "dc_motor_tacho": (31.0, 42.0),
    "air_duct": (10.0, 13.0),
    "heating_system": (0.5, 2.2),
    "rlc_zero_delay": (-1.0, 1.0),
    "two_cart_drive": (0.9, 3.4),
    "sbhs_heater": (1.0, 4.5),
    "hdd_arm": (0.8, 3.2),
    "tclab": (0.0, 5.0),
}
FIRST = ("dc_motor_tacho", "air_duct", "wis_canal", "heating_system", "rlc_zero_delay")
"""Plants that most rules of `identify` were made with."""
SETS = (*FIRST, "two_cart_drive", "sbhs_heater", "hdd_arm", "tclab")
_NO_STEPS = ("frf", "mimo", "prbs_irregular")


@dataclass(frozen=True, eq=False)
class Measured:
    """A task and what its dead time is believed to be, in samples."""

    plant: str
    name: str
    band: tuple[float, float]
    task: Task

    def outside(self, delay: float) -> float:
        """Samples by which a delay misses the band."""
        return max(self.band[0] - delay, delay - self.band[1], 0.0)

    def fit(self, answer: Answer) -> float:
        """Percent of the response that a simulation explains; the best offset is taken off."""
        after = slice(self.task.edge, None)
        left = (self.task.y - answer.simulate(self.task.u))[after]
        return float(100 * (1 - np.std(left) / np.std(self.task.y[after])))

    def predicted(self, simulated: np.ndarray) -> tuple[float, float]:
        """Percent explained by a prediction, offset taken off: as it is, and with the best gain."""
        measured, simulated = (x[self.task.edge :] for x in (self.task.y, simulated))
        measured, simulated = measured - np.mean(measured), simulated - np.mean(simulated)
        power = float(simulated @ simulated)
        best = float(simulated @ measured) / power if power > 0 else 0.0
        scale = float(np.linalg.norm(measured))
        as_it_is, free = (
            100 * (1 - float(np.linalg.norm(measured - part * simulated)) / scale)
            for part in (1.0, best)
        )
        return as_it_is, free


@functools.cache
def records(folder: Path) -> tuple[Measured, ...]:
    """Read all records of a folder that has one folder for each plant."""
    paths = [path for name in SETS for path in sorted((folder / name).glob("*.csv"))]
    return tuple(_read(path) for path in paths if path.stem not in _NO_STEPS)


def _read(path: Path) -> Measured:
    data = np.loadtxt(path, delimiter=",", skiprows=1)
    n = len(data)
    # Stamps are rounded; the mean step is the sample time.
    time = data[0, 0] + np.arange(n) * np.ptp(data[:, 0]) / (n - 1)
    record = cr.Record(time, data[:, 1], data[:, 2], name=path.stem)
    band = _band(path, record.dt)
    return Measured(path.parent.name, path.stem, band, _task(record, band))


def _band(path: Path, dt: float) -> tuple[float, float]:
    plant = path.parent.name
    if plant in SAMPLES:
        return SAMPLES[plant]
    low, high = next(limits for gate, limits in CANAL.items() if f"gate{gate}" in path.stem)
    if path.stem.endswith("slow"):
        low, high = low + SLOWER[0], high + SLOWER[1]
    return low / dt, high / dt


def _task(record: cr.Record, band: tuple[float, float]) -> Task:
    edge = cr.detect_step(record)
    # The canal is logged from the step on: what comes before its first motion is its rest.
    still = edge.index if edge.index >= 10 else 20
    rest = float(np.mean(record.output[:still]))
    height = float(np.mean(record.output[-max(record.n_samples // 50, 5) :])) - rest
    u = (record.input - edge.baseline) / edge.amplitude
    y = (record.output - rest) / height
    limit = max(int(np.ceil(2 * band[1])), 10)
    rough = tuple(int(d) for d in np.unique(np.round(np.linspace(0, limit, 26))))
    known = max(round((band[0] + band[1]) / 2), 0)
    return Task(record, u, y, edge.index, edge.amplitude / height, known, rough, limit)
