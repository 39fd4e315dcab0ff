"""Folder with the finished rows of a campaign, so that an interrupted run can be resumed."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..delayed import DelayedStateSpace
from ..errors import DataError, FileFormatError, OptionError
from ..identification.campaign.rows import CampaignRow, versions
from ..results import Flag
from .atomic import write_text
from .checks import usable_file
from .json_content import field
from .models import MAX_MODEL_BYTES, checksum, model_from_text, model_to_text

FORMAT = "ctrl_realize campaign row"
SCHEMA = 4
_INTERVALS = ("interval", "total_delay_interval")
_NUMBERS = ("amplitude", "delay", "dead_time", "residual", "gain", "gain_std", "total_delay")

MOST_TRIES = 2
"""Number of times that a process may be killed over a record."""


class CampaignStore:
    """Folder in which the result of each record of a campaign is stored as soon as it is finished.

    Each row is a JSON file, written atomically, named by the SHA-256 of the record's samples, the
    settings and the versions of this package, NumPy and SciPy, with a checksum of its content;
    processes and machines that share the folder can write to it at the same time. Rows of other
    versions and damaged files are not used: the record is identified again. Only files of this
    package are read, and no row is deleted. A record over which the process was killed twice is not
    tried again: its row has that error.

    Parameters
    ----------
    folder : path-like
        Created if it does not exist.

    Raises
    ------
    OptionError
        The path is a file.

    Examples
    --------
    >>> import tempfile
    >>> import ctrl_realize as cr
    >>> records = [cr.bench.valve().step_record(16.0, seed) for seed in range(2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = cr.io.CampaignStore(folder)
    ...     first = cr.identify_campaign(records, method="paper", store=store)
    ...     again = cr.identify_campaign(records, method="paper", store=store)
    ...     print(len(store), bool((first.delays == again.delays).all()))
    2 True
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise OptionError(f"{self.folder} is a file; a campaign store needs a folder")
        self.folder.mkdir(parents=True, exist_ok=True)

    def __len__(self) -> int:
        return sum(1 for _ in self.folder.glob("row-*.json"))

    def __repr__(self) -> str:
        return f"<CampaignStore {str(self.folder)!r}: {len(self)} rows>"

    def _path(self, key: str) -> Path:
        return self.folder / f"row-{key}.json"

    def load(self, key: str) -> CampaignRow | None:
        """Return the row stored under `key`; None if there is none, or its file is damaged."""
        path = self._path(key)
        try:
            # the content may come from others: a pipe would never end
            file = usable_file(path, 2 * MAX_MODEL_BYTES)
            return _row_from(json.loads(file.read_text(encoding="utf-8")), key)
        except (OSError, ValueError, TypeError, RecursionError):
            # FileFormatError is a ValueError: for any error the record is identified again
            return None

    def save(self, key: str, row: CampaignRow) -> CampaignRow:
        """Store a row with a model; return it as `load` would, with a summary of its fit."""
        system = row.system
        assert system is not None
        content = {
            "format": FORMAT,
            "schema": SCHEMA,
            "key": key,
            "versions": versions(),
            "name": row.name,
            # JSON has no infinity or NaN; they are stored as text
            "numbers": {name: repr(float(getattr(row, name))) for name in _NUMBERS},
            **{name: [repr(float(end)) for end in getattr(row, name)] for name in _INTERVALS},
            "flags": [[flag.code, flag.message] for flag in row.flags],
            "warnings": list(row.warnings),
            "model": json.loads(model_to_text(system)),
        }
        content["sha256"] = checksum(content)
        write_text(self._path(key), json.dumps(content, indent=1, allow_nan=False) + "\n")
        return _row_from(content, key)

    @contextmanager
    def attempt(self, key: str) -> Iterator[None]:
        """Mark the record with this key as being identified, for the duration of the block.

        If the process is killed within the block the mark remains, so that a record that exhausts
        the memory is not tried endlessly.

        Raises
        ------
        DataError
            The process was killed twice over this record.
        """
        path = self.folder / f"tried-{key}.txt"
        count = _count(path)
        if count >= MOST_TRIES:
            raise DataError(
                f"the process was killed {count} times while it identified this record "
                f"(usually lack of memory); remove {path} to try again"
            )
        with suppress(OSError):  # a full disk prevents the mark, not the result
            write_text(path, f"{count + 1}\n")
        try:
            yield
        finally:
            with suppress(OSError):
                path.unlink()

    def forget_attempts(self) -> None:
        """Remove the marks of running records, when the caller stops the run.

        So are files that a process was killed over while it wrote them.
        """
        for left in ("tried-*.txt", ".tried-*.tmp", ".row-*.tmp"):
            for path in self.folder.glob(left):
                path.unlink(missing_ok=True)


def _count(path: Path) -> int:
    """Number in a mark; zero if it is damaged or does not exist."""
    try:
        return int(usable_file(path, 100).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return 0


def _row_from(content: Any, key: str) -> CampaignRow:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise FileFormatError("not a row of a campaign")
    if content.get("schema") != SCHEMA or content.get("key") != key:
        raise FileFormatError("a row of another format, or under another name")
    if content.get("versions") != versions():
        raise FileFormatError("a row made by another version")
    if content.get("sha256") != checksum(content):
        raise FileFormatError("the checksum does not match the content")
    numbers: dict[str, Any] = {
        name: float(text)
        for name, text in field(content, "numbers", dict).items()
        if name in _NUMBERS
    }
    intervals: dict[str, Any] = {}
    for name in _INTERVALS:
        low, high = (float(text) for text in field(content, name, list))
        intervals[name] = (low, high)
    system = model_from_text(json.dumps(field(content, "model", dict)))
    if not isinstance(system, DelayedStateSpace):
        raise FileFormatError("a row with a model that no record gives")
    flags = tuple(Flag(str(code), str(text)) for code, text in field(content, "flags", list))
    if system.fit is not None and system.fit.flags == flags:
        flags = system.fit.flags  # once in memory
    return CampaignRow(
        name=field(content, "name", str),
        **numbers,
        **intervals,
        system=system,
        flags=flags,
        warnings=tuple(str(text) for text in field(content, "warnings", list)),
    )
