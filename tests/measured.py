"""Measured records, which are not part of the project, and their fits: each once a process."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

import ctrl_realize as cr


@cache
def record(folder: Path, name: str) -> cr.Record:
    """As many inputs as outputs beside the times; stamps are rounded, so the mean step counts."""
    time, *signals = np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1).T
    u, y = np.split(np.array(signals), 2)
    return cr.Record(
        np.linspace(time[0], time[-1], time.size), u.squeeze(), y.squeeze(), name=Path(name).name
    )


@cache
def model(folder: Path, name: str) -> cr.DelayedStateSpace:
    """The output-error fit with defaults, which `identify` makes of a step."""
    return cr.fit_output_error(record(folder, name))


def fitted(folder: Path, name: str) -> cr.identification.OutputErrorFit:
    """What the model carries of its fit."""
    return model(folder, name).fit


def halves(folder: Path, name: str) -> tuple[cr.Record, cr.Record]:
    """What a model is made of, and what it is judged by."""
    whole = record(folder, name)
    middle = whole.time[whole.n_samples // 2]
    return whole.between(whole.time[0], middle), whole.between(middle, np.inf)
