"""Folders of results that appear as a whole."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..errors import CtrlRealizeError, OptionError
from ..io import CampaignStore
from ..io.atomic import raise_for, refuse_irregular
from .manifest import NAME as MANIFEST
from .manifest import Run, refuse_other_results, result_files, write_manifest
from .terminal import complain, printable

ROWS = "rows.sqlite"
"""File of finished records in the folder of the results, while a campaign runs."""


@contextmanager
def appearing(folder: Path, run: Run | None = None) -> Iterator[Path]:
    """Provide a temporary folder whose files are moved into `folder` at the end of the block.

    If `folder` exists, the results of an earlier run are replaced and other files are kept; nothing
    outside it is touched, because it may be on another disk. If the block raises an error, nothing
    in `folder` has changed.

    Parameters
    ----------
    folder : pathlib.Path
    run : Run, optional
        The run of these results, for the manifest.

    Raises
    ------
    OptionError
        `folder` is a file, or contains the results of another run.
    OSError
        It cannot be created or written.

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
    refuse_a_file(folder)
    if run is not None:
        refuse_other_results(folder, run)
    made = _missing_parents(target.parent)
    target.parent.mkdir(parents=True, exist_ok=True)
    place = target if target.exists() else target.parent
    staged = place / f".{target.name[:40]}-{secrets.token_hex(6)}.tmp"
    try:
        staged.mkdir()
        yield staged
        if run is not None:
            write_manifest(staged, run)
        if target.exists():
            _move_into(staged, target, result_files(target) if run is not None else [])
        else:
            staged.rename(target)
    except BaseException as error:
        shutil.rmtree(staged, ignore_errors=True)
        for parent in made:
            _remove_if_empty(parent)
        raise_for(target, staged, error)
        raise


@contextmanager
def kept_rows(output: Path) -> Iterator[CampaignStore]:
    """Provide a store in `output` for the records of a campaign; removed when the results exist.

    If the process is killed or interrupted, or the disk is full, the finished records are kept, and
    the same command resumes from them. After other errors, such as records that do not belong
    together, nothing is kept.
    """
    refuse_a_file(output)
    made = _missing_parents(output)
    store = CampaignStore(output / ROWS)
    try:
        yield store
    except CtrlRealizeError:
        _remove_rows(store, made)
        raise
    except (KeyboardInterrupt, OSError):
        if len(store):
            complain(
                f"{len(store)} finished records are kept in {printable(str(store.path))}; "
                "run the same command again to continue"
            )
        else:
            _remove_rows(store, made)
        raise
    _remove_rows(store, made)


def refuse_a_file(output: Path) -> None:
    """Refuse a file in place of a folder, before any work is done."""
    if output.exists() and not output.is_dir():
        raise OptionError(f"{output} is a file; --output needs a folder")


def _remove_rows(store: CampaignStore, made: Sequence[Path]) -> None:
    """Remove a store with what is beside it, and the folders created for it if they are empty."""
    for path in store.path.parent.glob(f"{store.path.name}*"):
        path.unlink(missing_ok=True)
    for folder in made:
        _remove_if_empty(folder)


def _missing_parents(folder: Path) -> list[Path]:
    """List the folders that do not exist yet, the innermost first."""
    return [parent for parent in (folder, *folder.parents) if not parent.exists()]


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _move_into(staged: Path, target: Path, old: Sequence[Path]) -> None:
    """Move new results into a folder, replacing the old ones."""
    for path in staged.rglob("*"):
        if path.is_file():
            refuse_irregular(target / path.relative_to(staged))
    # If this is interrupted there is no manifest, and the results count as those of another run.
    for path in (target / MANIFEST, *old):
        if path.is_file() or path.is_symlink():
            path.unlink()
    for folder in {path.parent for path in old} - {target}:
        _remove_if_empty(folder)
    for path in sorted(staged.rglob("*"), key=lambda one: (one.name == MANIFEST, one)):
        if path.is_file():
            place = target / path.relative_to(staged)
            place.parent.mkdir(exist_ok=True)
            os.replace(path, place)
    shutil.rmtree(staged)
