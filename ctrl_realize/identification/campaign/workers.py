"""Records of a campaign distributed over processes, one of which may be killed.

A process is killed if memory is exhausted or compiled code crashes. Which of the running records
caused it is unknown, so each of them is identified once more in a separate process; a record whose
process is killed again gives a row with that error, and the others continue.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..methods import Method
from .rows import CampaignRow, RecordSource, RowStore, identify_row, killed_row


def identified(
    sources: Sequence[RecordSource],
    n_jobs: int,
    method: Method,
    options: Mapping[str, Any],
    store: RowStore | None,
) -> Generator[tuple[int, CampaignRow], None, None]:
    """Identify records with joblib; yield position and row of each as it is finished."""
    from joblib import Parallel, delayed  # not needed for a single record

    pending = dict(enumerate(sources))
    with TemporaryDirectory(prefix="ctrl_realize-", ignore_cleanup_errors=True) as marks:

        def spread(positions: Sequence[int], processes: int) -> Iterator[tuple[int, CampaignRow]]:
            tasks = (
                delayed(_marked)(Path(marks), pending[position], position, method, options, store)
                for position in positions
            )
            rows: Any = Parallel(n_jobs=processes, return_as="generator_unordered")(tasks)
            for position, row in rows:
                yield position, row
                del pending[position]

        while pending:
            try:
                yield from spread(list(pending), n_jobs)
            except BrokenProcessPool:
                started = [
                    position for position in pending if _mark(Path(marks), position).exists()
                ]
                for position in started or list(pending):
                    try:
                        # two processes: one would be this one
                        yield from spread([position], 2)
                    except BrokenProcessPool as again:
                        yield position, _killed(pending.pop(position), position, again)


def _marked(
    marks: Path,
    source: RecordSource,
    position: int,
    method: Method,
    options: Mapping[str, Any],
    store: RowStore | None,
) -> tuple[int, CampaignRow]:
    """Identify a record; a mark shows that it is running."""
    with suppress(OSError):
        _mark(marks, position).touch()
    row = identify_row(source, position, method, options, store)
    with suppress(OSError):
        _mark(marks, position).unlink()
    return position, row


def _mark(marks: Path, position: int) -> Path:
    return marks / str(position)


def _killed(source: RecordSource, position: int, error: Exception) -> CampaignRow:
    codes = re.search(r"exit codes? of the workers? (?:are|is) \{(.*?)\}", str(error))
    return killed_row(source, position, f" ({codes[1]})" if codes else "")
