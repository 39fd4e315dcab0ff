"""Measured records and frequency responses that come with the package, with origin and licence."""

from .info import DataFile, DatasetInfo
from .loading import Dataset, load, names, path, table

__all__ = ["DataFile", "Dataset", "DatasetInfo", "load", "names", "path", "table"]


def __dir__() -> list[str]:
    return __all__
