"""Measured records and their fits: each once a process.

Some come with the package; the others are not part of the project, and a test that needs them is
skipped where they are absent.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import ctrl_realize as cr

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
SHIPPED = {"gas_furnace/record": "gas_furnace"}
"""Name of a record -> data set of the package."""


def shared_folder() -> Path:
    """Folder of the records that are not part of the project."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"measured records are not there ({SHARED_DATA.name}/ beside the project)")
    return SHARED_DATA


@cache
def record(name: str) -> cr.Record:
    """As many inputs as outputs beside the times; stamps are rounded, so the mean step counts."""
    if name in SHIPPED:
        return cr.datasets.load(SHIPPED[name]).record
    time, *signals = np.loadtxt(shared_folder() / f"{name}.csv", delimiter=",", skiprows=1).T
    u, y = np.split(np.array(signals), 2)
    return cr.Record(
        np.linspace(time[0], time[-1], time.size), u.squeeze(), y.squeeze(), name=Path(name).name
    )


@cache
def model(name: str) -> cr.DelayedStateSpace:
    """The output-error fit with defaults, which `identify` makes of a step."""
    return cr.fit_output_error(record(name))


def fitted(name: str) -> cr.identification.OutputErrorFit:
    """What the model carries of its fit."""
    return model(name).fit


def halves(name: str) -> tuple[cr.Record, cr.Record]:
    """What a model is made of, and what it is judged by."""
    whole = record(name)
    middle = whole.time[whole.n_samples // 2]
    return whole.between(whole.time[0], middle), whole.between(middle, np.inf)
