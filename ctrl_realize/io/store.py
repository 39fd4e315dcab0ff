"""File with the finished rows of a campaign, so that an interrupted run can be resumed."""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from math import isnan, nan
from pathlib import Path
from typing import Any

from ..delayed import DelayedStateSpace
from ..errors import FileFormatError, OptionError
from ..identification.campaign.rows import CampaignRow, unsaved
from ..results import Flag
from .models import MAX_MODEL_BYTES, model_from_text, model_to_text

SCHEMA = 5
"""Number of this format in the file; up to 4 it was a folder."""
_APPLICATION = 0x63726361
"""Mark of the file for SQLite, "crca"."""
_NUMBERS = (
    "amplitude", "delay", "dead_time", "residual", "gain", "gain_std", "total_delay", "dt",
)  # fmt: skip
_COLUMNS = (
    "key", "name", *_NUMBERS, "low", "high", "total_low", "total_high", "order", "flags",
    "warnings", "settings", "model",
)  # fmt: skip
_QUOTED = ", ".join(f'"{name}"' for name in _COLUMNS)
_CREATE = (
    f"BEGIN IMMEDIATE; CREATE TABLE IF NOT EXISTS rows ({_QUOTED}, crc32, PRIMARY KEY (key)); "
    f"PRAGMA application_id = {_APPLICATION}; PRAGMA user_version = {SCHEMA}; COMMIT"
)
_LOAD = f"SELECT {_QUOTED}, crc32 FROM rows WHERE key = ?"
_SAVE = f"INSERT OR REPLACE INTO rows VALUES ({', '.join('?' * (len(_COLUMNS) + 1))})"
_WAIT = 60
"""Time in s during which another process may write."""


class CampaignStore:
    """File in which the result of each record of a campaign is stored as soon as it is finished.

    An SQLite database with one table, ``rows``: ``pandas.read_sql("SELECT * FROM rows",
    sqlite3.connect(path))`` reads it. A row is written in a transaction, by the process that calls
    `identify_campaign`, so that there are whole rows only, whenever that process is killed. Its key
    is the SHA-256 of the record's samples and labels, the settings and the versions of this
    package, NumPy and SciPy; of a file that ``functools.partial(cr.read_record, path)`` reads, its
    path, size and time of change stand for the samples. A row whose CRC-32 does not match is not
    used: the record is identified again. No row is deleted. Several runs, also of other settings,
    may use one file at the same time. A record over which the process was killed is identified in a
    process of its own when the run is resumed.

    Parameters
    ----------
    path : path-like
        Created, with its folder, if it does not exist.

    Attributes
    ----------
    path : pathlib.Path

    Raises
    ------
    OptionError
        The path is a folder, as of earlier versions, or a device.
    FileFormatError
        The file is no campaign store, or one of another version.
    OSError
        It cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> records = [cr.bench.valve().step_record(16.0, seed) for seed in range(2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = cr.io.CampaignStore(Path(folder) / "finished.sqlite")
    ...     first = cr.identify_campaign(records, method="paper", store=store)
    ...     again = cr.identify_campaign(records, method="paper", store=store)
    ...     print(len(store), bool((first.delays == again.delays).all()))
    2 True
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._database: sqlite3.Connection | None = None
        if self.path.exists() and not self.path.is_file():
            raise OptionError(
                f"{self.path} is a folder or a device; a campaign store is one file, such as "
                f"{self.path.name}.sqlite. Rows that an earlier version kept in a folder are not "
                "used: with the name of a new file the records are identified again"
            )
        self.path.parent.mkdir(parents=True, exist_ok=True)
        new = not self.path.exists() or not self.path.stat().st_size
        with self._connected("rwc") as database:
            if new:  # another process may create it at the same time
                database.executescript(_CREATE)
            found = database.execute("SELECT * FROM pragma_application_id, pragma_user_version")
            kind, schema = found.fetchone()
        if (kind, schema) != (_APPLICATION, SCHEMA):
            got = f"schema {schema}" if kind == _APPLICATION else "another SQLite database"
            raise FileFormatError(
                f"{self.path}: expected a campaign store of schema {SCHEMA}, got {got}; give the "
                "name of a new file"
            )

    def __len__(self) -> int:
        with self._connected() as database:
            return int(database.execute("SELECT count(*) FROM rows").fetchone()[0])

    def __repr__(self) -> str:
        return f"<CampaignStore {str(self.path)!r}>"

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "_database": None}

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Keep the file open for the duration of the block, which is faster."""
        with self._connected() as self._database:
            try:
                yield
            finally:
                self._database = None

    def load(self, key: str) -> CampaignRow | None:
        """Return the row stored under `key`; None if there is none, or it is damaged."""
        try:
            with self._connected() as database:
                *values, stored = database.execute(_LOAD, (key,)).fetchone() or (None,)
            # a damaged index leads to the row of another key
            good = values[:1] == [key] and stored == _checksum(values)
            return _row_from(values) if good else None
        except (OSError, ValueError, TypeError):
            # FileFormatError is a ValueError: for any error the record is identified again
            return None

    def packed(self, row: CampaignRow) -> CampaignRow:
        """Reduce the model of a row to what is stored, with a summary of its fit."""
        assert row.system is not None
        text = model_to_text(row.system).encode()
        return replace(row, _model=partial(_unpacked, zlib.compress(text)))

    def save(self, rows: Sequence[tuple[str, CampaignRow]], settings: str) -> list[CampaignRow]:
        """Store packed rows under their keys, all or none; return them, with a warning if none."""
        written = [_values(key, row, settings) for key, row in rows]
        try:
            with self._connected() as database, database:
                database.executemany(_SAVE, [[*one, _checksum(one)] for one in written])
        except (OSError, FileFormatError) as error:  # a full disk: the results stay in memory
            return [unsaved(row, error) for _, row in rows]
        return [row for _, row in rows]

    @contextmanager
    def _connected(self, mode: str = "rw") -> Iterator[sqlite3.Connection]:
        address = f"{self.path.absolute().as_uri()}?mode={mode}"
        try:
            # rows may be taken by other threads, one at a time
            database = self._database or sqlite3.connect(
                address, timeout=_WAIT, uri=True, isolation_level="IMMEDIATE",
                check_same_thread=False,
            )  # fmt: skip
            with nullcontext() if self._database else closing(database):
                yield database
        except sqlite3.OperationalError as error:
            raise OSError(f"{self.path}: {error}") from error
        except (sqlite3.DatabaseError, UnicodeError) as error:
            raise FileFormatError(
                f"{self.path}: no campaign store, or damaged ({error}); give the name of a new file"
            ) from error


def _unpacked(content: bytes) -> DelayedStateSpace:
    """Model of a row, made when it is asked for."""
    text = zlib.decompressobj().decompress(content, MAX_MODEL_BYTES)
    system = model_from_text(text.decode())
    if not isinstance(system, DelayedStateSpace):
        raise FileFormatError("a row with a model that no record gives")
    return system


def _values(key: str, row: CampaignRow, settings: str) -> list[Any]:
    """Row of the table; SQLite has no NaN."""
    numbers = [*(getattr(row, name) for name in _NUMBERS), *row.interval, *row.total_delay_interval]
    flags = json.dumps([[flag.code, flag.message] for flag in row.flags])
    assert isinstance(row._model, partial)
    return [
        key, row.name, *(None if isnan(one) else float(one) for one in numbers), row.order, flags,
        json.dumps(row.warnings), settings, row._model.args[0],
    ]  # fmt: skip


def _row_from(values: Sequence[Any]) -> CampaignRow:
    _, name, *stored, order, flags, warnings, _, model = values
    numbers = [nan if one is None else float(one) for one in stored]
    *scalars, low, high, total_low, total_high = numbers
    known: dict[str, Any] = dict(zip(_NUMBERS, scalars, strict=True))
    return CampaignRow(
        name,
        **known,
        interval=(low, high),
        total_delay_interval=(total_low, total_high),
        order=order,
        flags=tuple(Flag(code, message) for code, message in json.loads(flags)),
        warnings=tuple(json.loads(warnings)),
        _model=partial(_unpacked, model),
    )


def _checksum(values: Sequence[Any]) -> int:
    return zlib.crc32(repr(list(values)).encode())
