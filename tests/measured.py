"""Measured records, which are not part of the project, and their fits: each once a process."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

import ctrl_realize as cr


@cache
def record(folder: Path, name: str) -> cr.Record:
    """Two signals beside their times; stamps are rounded, so the mean step is the sample time."""
    time, u, y = np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1).T
    return cr.Record(np.linspace(time[0], time[-1], time.size), u, y, name=Path(name).name)


@cache
def fitted(folder: Path, name: str) -> cr.identification.OutputErrorFit:
    """The fit with defaults."""
    return cr.fit_output_error(record(folder, name)).fit
