"""Write files atomically."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replaced_when_complete(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Provide a temporary path that replaces `path` when the block ends without an error.

    The temporary file is in the same folder, so the replacement is atomic: a reader sees the old
    file or the new one, never a part. If the block raises an error or is interrupted, `path` is
    unchanged and the temporary file is removed.

    Parameters
    ----------
    path : path-like
        File to write. A symbolic link is followed, and remains.

    Yields
    ------
    pathlib.Path
        Empty file to be written.

    Raises
    ------
    OSError
        If the folder is missing or cannot be written, or `path` is a folder, a device, a pipe or
        a socket.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from ctrl_realize.io.atomic import replaced_when_complete
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replaced_when_complete(Path(folder) / "a.txt") as temporary:
    ...         _ = temporary.write_text("done")
    ...     print([(p.name, p.read_text()) for p in Path(folder).iterdir()])
    [('a.txt', 'done')]
    """
    try:
        target = Path(os.path.realpath(path))
    except ValueError as error:
        # a NUL character in the name
        raise OSError(errno.EINVAL, str(error), os.fspath(path)) from error
    refuse_irregular(target)
    # Created directly, not by tempfile, so that the file gets the permissions of any new file.
    temporary = target.with_name(f".{target.name[:40]}-{secrets.token_hex(8)}.tmp")
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        with suppress(FileNotFoundError):
            temporary.chmod(target.stat().st_mode & 0o777)
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        raise_for(target, temporary, error)
        raise


def raise_for(target: Path, temporary: Path, error: BaseException) -> None:
    """Name the target in an error that names its temporary file, or, as a full disk, none.

    Raises
    ------
    OSError
    """
    if not isinstance(error, OSError) or not error.errno:
        return
    if error.filename is None or str(error.filename) == str(temporary):
        raise OSError(error.errno, error.strerror, str(target)) from error


def refuse_irregular(path: Path) -> None:
    """Refuse to replace anything but a regular file.

    A user with all permissions could replace a device by a file.

    Raises
    ------
    OSError
    """
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, "is a folder; expected a file to write", str(path))
    if not stat.S_ISREG(kind):
        raise FileExistsError(
            errno.EEXIST, "is a device, a pipe or a socket and will not be replaced", str(path)
        )


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` as UTF-8 with plain line ends, atomically.

    Raises
    ------
    OSError
        As for `replaced_when_complete`; `path` is then unchanged.
    """
    with replaced_when_complete(path) as temporary:
        # file names that are not UTF-8 are escaped
        temporary.write_bytes(text.encode("utf-8", "backslashreplace"))
