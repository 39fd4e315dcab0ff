"""Records of the commands, and the lines of Python that read them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..data import Record
from ..io import read_record, read_records


@dataclass(frozen=True)
class Source:
    """One record: its name, its file, and the record or a function that reads it."""

    name: str
    file: Path
    content: Record | Callable[[], Record]

    def record(self) -> Record:
        """Return the record."""
        return self.content if isinstance(self.content, Record) else self.content()


@dataclass(frozen=True)
class Reading:
    """How to read records: arguments of `read_record`, and how tests in a file are separated."""

    keywords: Mapping[str, Any]
    tests: Mapping[str, Any]

    def sources(self, files: Sequence[Path]) -> list[Source]:
        """One source for each file, or for each test in the files.

        A function that reads a file can be sent to other processes; tests are read at once.
        """
        if not self.tests:
            return [
                Source(folder_name(file), file, partial(read_record, file, **self.keywords))
                for file in files
            ]
        return [
            Source(record.name, file, record)
            for file in files
            for record in read_records(file, by=self.tests.get("by"), **self.keywords)
        ]


def folder_name(file: Path) -> str:
    """Name of a record's folder: that of the file without extension, and never "." or ".."."""
    return file.stem if file.stem.strip(".") else "record"


def python_keywords(keywords: Mapping[str, object]) -> str:
    """Return keyword arguments as Python text."""
    return "".join(f", {name}={value!r}" for name, value in keywords.items())


def reading_in_python(files: Sequence[Path], how: Reading) -> tuple[list[str], str]:
    """Return the lines of Python that read files, and the name of what they read."""
    keywords = python_keywords({**how.tests, **how.keywords}).replace(", split=True", "")
    lines = ["import ctrl_realize as cr"]
    if len(files) == 1 and not how.tests:
        return [*lines, f"record = cr.read_record({str(files[0])!r}{keywords})"], "record"
    names = ",\n    ".join(repr(str(file)) for file in files)
    lines.append(f"files = [\n    {names},\n]")
    if how.tests:
        reader = f"one for file in files for one in cr.io.read_records(file{keywords})"
    else:
        reader = f"cr.read_record(file{keywords}) for file in files"
    return [*lines, f"records = [{reader}]"], "records"
