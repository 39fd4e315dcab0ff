"""Write files whole or not at all."""

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
    """Give a temporary path that takes the place of `path` when the block ends well.

    The temporary file lies in the same folder, so the replacement is one step of the
    file system: a reader sees the old file or the new one, never a part. If the block
    raises, or the process is interrupted in it, `path` is as it was and the temporary
    file is gone.

    Parameters
    ----------
    path : path-like
        File to write. A symbolic link is followed, so that the link stays.

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
    # Created by hand, not by tempfile, so that the file gets the permissions of any new file.
    temporary = target.with_name(f".{target.name[:40]}-{secrets.token_hex(8)}.tmp")
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        with suppress(FileNotFoundError):
            temporary.chmod(target.stat().st_mode & 0o777)
        os.replace(temporary, target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def refuse_irregular(path: Path) -> None:
    """Refuse to replace what is there and is no regular file.

    Who may do everything could put a file in the place of a device, which all programs use.

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
    """Write `text` as UTF-8 with plain line ends, whole or not at all.

    Raises
    ------
    OSError
        As for `replaced_when_complete`; `path` is then as it was.
    """
    with replaced_when_complete(path) as temporary:
        # names of files that are no UTF-8 are spelled out
        temporary.write_bytes(text.encode("utf-8", "backslashreplace"))
