"""Provenance of a result: data with their checksums, versions."""

from __future__ import annotations

import hashlib
import os
import platform

import numpy as np

from .._facts import version_of
from ..data import Record
from ..errors import MissingFileError

_PACKAGES = ("ctrl-realize", "control", "numpy", "scipy", "matplotlib", "slycot")


def versions() -> list[tuple[str, str]]:
    """List the versions of all packages that affect the numbers."""
    found = [(package, version_of(package)) for package in _PACKAGES]
    machine = f"{platform.system()} {platform.machine()}"
    return [("Python", platform.python_version()), *found, ("platform", machine)]


def record_sha256(record: Record) -> str:
    """Return the SHA-256 of time, input, output and set point as little-endian float64."""
    digest = hashlib.sha256()
    known = (record.time, record.input, record.output, record.reference)
    for values in (one for one in known if one is not None):
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def file_sha256(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file."""
    try:
        with open(path, "rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except OSError as error:
        raise MissingFileError(f"{os.fspath(path)} cannot be read: {error.strerror}") from error
