"""A folder of results that appears whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import OptionError


@contextmanager
def appearing(folder: Path) -> Iterator[Path]:
    """Give a temporary folder whose files move into `folder` when the block ends well.

    If `folder` is there already, files of the same names are replaced and others stay. If the
    block raises, nothing in `folder` has changed.

    Parameters
    ----------
    folder : pathlib.Path

    Raises
    ------
    OptionError
        `folder` is a file.
    OSError
        It cannot be made or written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from ctrl_realize.cli.staging import appearing
    >>> with tempfile.TemporaryDirectory() as there:
    ...     with appearing(Path(there) / "results") as temporary:
    ...         _ = (temporary / "a.txt").write_text("done")
    ...     print([path.name for path in (Path(there) / "results").iterdir()])
    ['a.txt']
    """
    target = Path(os.path.realpath(folder))
    if target.exists() and not target.is_dir():
        raise OptionError(f"{folder} is a file; --output needs a folder")
    made = _missing_parents(target.parent)
    target.parent.mkdir(parents=True, exist_ok=True)
    staged = target.parent / f".{target.name[:40]}-{secrets.token_hex(6)}.tmp"
    staged.mkdir()
    try:
        yield staged
        if target.exists():
            _move_into(staged, target)
        else:
            staged.rename(target)
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        for parent in made:
            _remove_if_empty(parent)
        raise


def _missing_parents(folder: Path) -> list[Path]:
    """List the folders that are not there yet, the innermost first."""
    return [parent for parent in (folder, *folder.parents) if not parent.exists()]


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _move_into(staged: Path, target: Path) -> None:
    for path in sorted(staged.rglob("*")):
        place = target / path.relative_to(staged)
        if path.is_dir():
            place.mkdir(exist_ok=True)
    for path in sorted(staged.rglob("*")):
        if path.is_file():
            os.replace(path, target / path.relative_to(staged))
    shutil.rmtree(staged)
