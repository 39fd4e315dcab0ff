"""Provenance of a result: data with their checksums, versions."""

from __future__ import annotations

import hashlib
import os
import platform
from importlib import metadata

import numpy as np

from ..data import Record
from ..errors import MissingFileError

_PACKAGES = ("ctrl-realize", "control", "numpy", "scipy", "matplotlib", "slycot")


def versions() -> list[tuple[str, str]]:
    """List the versions of all packages that affect the numbers."""
    found = [("Python", platform.python_version())]
    for package in _PACKAGES:
        try:
            found.append((package, metadata.version(package)))
        except metadata.PackageNotFoundError:
            if package == "slycot":
                found.append((package, "not installed"))
    found.append(("platform", f"{platform.system()} {platform.machine()}"))
    return found


def own_version() -> str:
    """Return the version of this toolbox."""
    try:
        return metadata.version("ctrl-realize")
    except metadata.PackageNotFoundError:
        return "(not installed)"


def record_sha256(record: Record) -> str:
    """Return the SHA-256 of a record's time, input and output as little-endian float64."""
    digest = hashlib.sha256()
    for values in (record.time, record.input, record.output):
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def file_sha256(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file."""
    try:
        with open(path, "rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except OSError as error:
        raise MissingFileError(f"{os.fspath(path)} cannot be read: {error.strerror}") from error
