"""Record of the run behind the results in a folder, so that results are never mixed."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import FileFormatError, MissingFileError, OptionError
from ..io.atomic import write_text
from ..io.checks import usable_file
from ..report.provenance import file_sha256, versions

NAME = "manifest.json"
FORMAT = "ctrl_realize results"
SCHEMA = 1
_MOST_BYTES = 16 * 2**20
_RESULTS = (
    "model.json", "report.html", "records.csv", "frf_comparison.csv", "models/*.json",
    "figures/*.png", "metrics.csv", "sizes.csv", "steps.csv",
)  # fmt: skip
"""Names of results if there is no manifest."""


@dataclass(frozen=True)
class Run:
    """A run of a command.

    `command` has its arguments without the folder, `typed` with it, and `inputs` the files.
    """

    command: str
    inputs: tuple[Path, ...] = ()
    typed: str = ""
    overwrite: bool = False
    report: bool = True


def refuse_other_results(folder: Path | None, run: Run) -> None:
    """Refuse a folder, if any, with the results of another run, before any work is done.

    The same command may replace its own results.

    Raises
    ------
    OptionError
    """
    if folder is None or run.overwrite or not folder.is_dir():
        return
    manifest = _manifest(folder)
    if manifest is not None and manifest.get("command") == run.command:
        return
    there = result_files(folder)
    if manifest is None and not there:
        return
    made = f"made by: {manifest['command']}" if manifest else f"such as {there[0].name}"
    raise OptionError(
        f"{folder} holds other results, {made[:500]}; choose another folder, or use "
        "--overwrite to replace them"
    )


def result_files(folder: Path) -> list[Path]:
    """List the files of a run in a folder, by its manifest or by their names."""
    manifest = _manifest(folder)
    if manifest is None:
        found = [path for pattern in _RESULTS for path in sorted(folder.glob(pattern))]
    else:
        found = [folder / name for name in manifest["files"] if _is_inside(name)]
    return [path for path in found if path.is_file() or path.is_symlink()]


def write_manifest(folder: Path, run: Run) -> None:
    """Write the manifest of a folder: which run made its files."""
    below = [path for path in folder.rglob("*") if path.is_file()]
    files = sorted(path.relative_to(folder).as_posix() for path in below)
    content = {
        "format": FORMAT,
        "schema": SCHEMA,
        "command": run.command,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": dict(versions()),
        "inputs": [{"file": str(path), "sha256": _checksum(path)} for path in run.inputs],
        "files": files,
    }
    write_text(folder / NAME, json.dumps(content, indent=1) + "\n")


def _checksum(path: Path) -> str | None:
    with suppress(MissingFileError):  # it existed when it was read
        return file_sha256(path)
    return None


def _manifest(folder: Path) -> dict[str, Any] | None:
    """Return the content of a folder's manifest; None if there is none, or it is not ours."""
    try:
        file = usable_file(folder / NAME, _MOST_BYTES)
        content = json.loads(file.read_text(encoding="utf-8"))
    except (MissingFileError, FileFormatError, OSError, ValueError, RecursionError):
        return None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return None
    files = content.get("files")
    good = isinstance(files, list) and all(isinstance(name, str) for name in files)
    return content if good and isinstance(content.get("command"), str) else None


def _is_inside(name: str) -> bool:
    """Whether a name stays within its folder, whoever has written the manifest."""
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts and "\\" not in name
