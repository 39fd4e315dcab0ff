"""Text of a table: that of a file, or the sheet of a workbook written as text."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from ..checks import read_head, read_tail


@dataclass(frozen=True)
class TextSource:
    """A text and the file that it is from, which messages name.

    ``content`` is None where the file itself is the text; ``row_name`` is what its lines are.
    """

    path: Path
    content: bytes | None = None
    row_name: str = "line"

    def head(self, n_bytes: int) -> bytes:
        """First bytes."""
        return read_head(self.path, n_bytes) if self.content is None else self.content[:n_bytes]

    def tail(self, n_bytes: int) -> bytes:
        """Last bytes, from an even place on."""
        if self.content is None:
            return read_tail(self.path, n_bytes)
        return self.content[max(0, len(self.content) - n_bytes) // 2 * 2 :]

    def open(self, encoding: str, newline: str | None = None) -> TextIO:
        """Open the text for reading; bytes that are no characters are replaced."""
        if self.content is None:
            return self.path.open(encoding=encoding, errors="replace", newline=newline)
        return io.TextIOWrapper(
            io.BytesIO(self.content), encoding=encoding, errors="replace", newline=newline
        )
