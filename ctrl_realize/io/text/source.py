"""Text of a table: that of a file, or the sheet of a workbook written as text."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

import numpy as np

_PAIR = re.compile(
    r"""(?<![\w.])([A-Za-z_]\w*)["']?\s*[:=]\s*"""
    r"""["']?(\d{4}-\d\d-\d\d[T ][\d:.]+(?:Z|[+-]\d\d:?\d\d)?|[+-]?[\d.]+(?:[eE][+-]?\d+)?)"""
)
_STAMPED = re.compile(r"^[\s\[{\"']*(\d[\d:.,/ T-]*\d)?[\s\]>,;-]*$")
_HEAD, _MOSTLY = 4096, 0.8


@dataclass(frozen=True)
class TextSource:
    """A text and the file that it is from, which messages name.

    ``content`` is None where the file itself is the text; ``row_name`` is what its lines are.
    """

    path: Path
    content: bytes | None = None
    row_name: str = "line"

    def _bytes(self) -> BinaryIO:
        return self.path.open("rb") if self.content is None else io.BytesIO(self.content)

    def head(self, n_bytes: int) -> bytes:
        """First bytes."""
        with self._bytes() as raw:
            return raw.read(n_bytes)

    def tail(self, n_bytes: int) -> bytes:
        """Last bytes, from an even place on, which keeps two-byte characters whole."""
        with self._bytes() as raw:
            raw.seek(max(0, raw.seek(0, io.SEEK_END) - n_bytes) // 2 * 2)
            return raw.read()

    def open(self, encoding: str, newline: str | None = None) -> TextIO:
        """Open the text for reading; bytes that are no characters are replaced."""
        return io.TextIOWrapper(self._bytes(), encoding=encoding, errors="replace", newline=newline)


def keyed_as_table(source: TextSource) -> TextSource:
    """Table of a log whose lines are names and values, such as ``10:15:30.5 -> T:23.5 U:40``.

    Lines of other kinds, such as messages at the start, are left out; other texts are returned as
    they are.
    """
    lines = source.head(_HEAD).decode("utf-8", "replace").splitlines()[:-1]
    if np.mean([len(_PAIR.findall(one)) > 1 for one in lines] or [False]) < _MOSTLY:
        return source
    rows = []
    with source.open("utf-8") as file:
        for line in file:
            if (first := _PAIR.search(line)) and (stamp := _STAMPED.match(line[: first.start()])):
                rows.append({"time": stamp[1] or "", **dict(_PAIR.findall(line))})
    if not rows:
        return source
    every = dict.fromkeys(name for row in rows for name in row)
    names = [name for name in every if any(row.get(name) for row in rows)]
    text = "\n".join("\t".join(row.get(name, "") for name in names) for row in rows)
    return TextSource(source.path, ("\t".join(names) + "\n" + text + "\n").encode(), "row")
