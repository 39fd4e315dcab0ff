"""The data sets: every fact is stored once, in ``catalogue.toml``."""

from __future__ import annotations

from typing import Any

from .._facts import facts
from .info import DataFile, DatasetInfo


def _info(name: str, row: dict[str, Any]) -> DatasetInfo:
    files = tuple(DataFile(**file) for file in row["files"])
    return DatasetInfo(name=name, **{"dead_time_band": None, **row, "files": files})


DATASETS = tuple(_info(name, row) for name, row in facts("datasets/catalogue.toml").items())
"""All data sets, by name."""
