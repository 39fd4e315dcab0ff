"""The data sets: every fact is stored once, in ``catalogue.toml``."""

from __future__ import annotations

from typing import Any

from .._facts import facts
from .info import DataFile, DatasetInfo


def _file(reading: dict[str, Any] | None = None, **row: Any) -> DataFile:
    # columns are lists, as for a reader
    lists = {k: list(v) if isinstance(v, tuple) else v for k, v in (reading or {}).items()}
    return DataFile(**row, reading=lists)


def _info(name: str, row: dict[str, Any]) -> DatasetInfo:
    files = tuple(_file(**file) for file in row.pop("files"))
    return DatasetInfo(name=name, files=files, **{"dead_time_band": None, **row})


DATASETS = tuple(_info(name, row) for name, row in facts("datasets/catalogue.toml").items())
"""All data sets, by name."""
