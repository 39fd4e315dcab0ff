"""Checks of a file before it is opened: it exists, is regular, and is not too large."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from pathlib import Path

from .._checks import check_type
from ..errors import FileFormatError, MissingFileError, OptionError

MAX_COLUMNS = 10_000
MAX_NAME = 200
"""Number of characters of a column's name that are kept."""
MAX_BYTES = 2 * 2**30
"""Default limit of the size of a data file."""
_FREE_BYTES = 64 * 2**20
_MAX_RATIO = 1_000
"""Largest ratio of unpacked to packed size. Runs of equal values take no space in a file, but a
measurement has more: beside a two-level input of 8 bytes a sample there is a noisy output, of which
a bit at least stays, so that three columns are packed to less than a two-hundredth."""


def usable_file(path: str | os.PathLike[str], max_bytes: float) -> Path:
    """Return `path` if it is a regular, readable, non-empty file of at most `max_bytes`.

    Raises
    ------
    MissingFileError
        There is nothing at `path`, or it may not be read.
    FileFormatError
        It is a folder, a device or a pipe (which might never end), empty, or too large.
    """
    if not isinstance(max_bytes, Real) or not max_bytes > 0:
        raise OptionError(f"max_bytes={max_bytes!r} must be a positive number")
    check_type(path, str | os.PathLike, "path", "the name of a file, text or Path", OptionError)
    try:
        path = Path(path)
        status = path.stat()
    except (OSError, ValueError) as error:
        # ValueError: a NUL character in the name
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise MissingFileError(f"{os.fspath(path)!r} cannot be read: {reason}") from error
    if stat.S_ISDIR(status.st_mode):
        raise FileFormatError(f"{path} is a folder; expected a file")
    if not stat.S_ISREG(status.st_mode):
        raise FileFormatError(f"{path} is a device or a pipe; expected a regular file")
    if not os.access(path, os.R_OK):
        raise MissingFileError(f"{path} cannot be read: permission denied")
    if status.st_size == 0:
        raise FileFormatError(f"{path} is empty")
    check_size(path, status.st_size, max_bytes)
    return path


def check_size(path: Path, n_bytes: int, max_bytes: float, what: str = "") -> None:
    """Refuse sizes above `max_bytes`, before memory is allocated."""
    if n_bytes > max_bytes:
        raise FileFormatError(
            f"{path}{what} is {n_bytes / 2**20:.4g} MiB, "
            f"max_bytes={max_bytes:.0f} allows {max_bytes / 2**20:.4g} MiB"
        )


def unpacked_limit(path: Path, max_bytes: float) -> float:
    """Largest size of the data of a packed file, and no more than `max_bytes`."""
    return min(max_bytes, max(_FREE_BYTES, _MAX_RATIO * path.stat().st_size))


def read_head(path: Path, n_bytes: int) -> bytes:
    """First `n_bytes` of a file."""
    with path.open("rb") as file:
        return file.read(n_bytes)


@contextmanager
def told_if_damaged(path: Path, kind: str) -> Iterator[None]:
    """Turn any error of a reader into one message: damaged files raise all kinds of them."""
    try:
        yield
    except (FileFormatError, OptionError):
        raise
    except Exception as error:
        reason = str(error).partition("\n")[0][:200]
        raise FileFormatError(f"{path} is a damaged {kind}: {reason}") from error


@contextmanager
def package_for(path: Path, kind: str, extra: str, package: str) -> Iterator[None]:
    """Say what to install, if an import fails, or what to do without it."""
    try:
        yield
    except ImportError as error:
        raise FileFormatError(
            f"{path} is {kind}: pip install 'ctrl-realize[{extra}]' ({package}) to read it, or "
            "save it as CSV"
        ) from error
