"""Write tables as CSV that a spreadsheet shows and does not execute."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

from ..atomic import write_text

if TYPE_CHECKING:
    import pandas as pd

# A spreadsheet takes a cell that begins with one of these for a formula. A tab or a line end may
# be dropped before it looks, and a semicolon ends a cell where the comma is the decimal sign.
_FORMULA = re.compile(r"(^|[;\t\r\n])(?='*[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20])")

_QUOTED_OR_END = re.compile(r'("[^"]*")|\r\n')


def write_csv(path: str | os.PathLike[str], table: pd.DataFrame, *, index: bool) -> None:
    """Write a table, whole or not at all; its texts are no formulas.

    Numbers have all their digits, so that what is read is what was written. An apostrophe stands
    before a text that a spreadsheet would execute (`as_text`).

    Parameters
    ----------
    path : path-like
    table : pandas.DataFrame
    index : bool
        Write the index as well.

    Raises
    ------
    OSError
        The folder is missing or cannot be written; `path` is then as it was.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pandas as pd
    >>> from ctrl_realize.io.text.csv_files import write_csv
    >>> table = pd.DataFrame({"record": ["valve", "=1+1"], "delay": [44.5, 45.0]})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_csv(Path(folder) / "records.csv", table, index=False)
    ...     print((Path(folder) / "records.csv").read_text(encoding="utf-8"), end="")
    record,delay
    valve,44.5
    '=1+1,45.0
    """
    whole = table.reset_index() if index else table
    safe = whole.rename(columns=as_text).apply(lambda column: column.map(as_text))
    # Pandas puts cells in quotes that hold a part of the line end, so with both parts any name
    # that holds one is one cell. Between the lines a plain one is written.
    text = safe.to_csv(index=False, lineterminator="\r\n")
    write_text(path, _QUOTED_OR_END.sub(lambda found: found[1] or "\n", text))


def as_text(value: Any) -> Any:
    r"""Put an apostrophe before a text that a spreadsheet would take for a formula.

    Names come from files of others: ``=cmd|'/c calc'!A1`` as the name of a record would run a
    program where the table is opened. With the apostrophe it is shown as it is. Where one stands
    already another is put before it, so that a program that reads the table gets the name back
    by leaving out one.

    Examples
    --------
    >>> from ctrl_realize.io.text.csv_files import as_text
    >>> print(as_text("=1+1"), as_text("'=1+1"), as_text("valve 16 mA"), as_text(-1.5))
    '=1+1 ''=1+1 valve 16 mA -1.5
    """
    return _FORMULA.sub(r"\1'", value) if isinstance(value, str) else value
