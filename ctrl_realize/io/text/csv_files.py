"""Write tables as CSV files that a spreadsheet does not execute."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

from ..atomic import write_text

if TYPE_CHECKING:
    import pandas as pd

# A spreadsheet takes a cell that begins with one of these for a formula. A tab or a line end may be
# ignored at the beginning, and a semicolon ends a cell if the comma is the decimal sign.
_FORMULA = re.compile(r"(^|[;\t\r\n])(?='*[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20])")

_QUOTED_OR_END = re.compile(r'("[^"]*")|\r\n')


def write_csv(path: str | os.PathLike[str], table: pd.DataFrame, *, index: bool) -> None:
    """Write a table atomically, without formulas.

    Numbers are written with all digits, so that they can be read back exactly. An apostrophe
    precedes a text that a spreadsheet would execute (`as_text`).

    Parameters
    ----------
    path : path-like
    table : pandas.DataFrame
    index : bool
        Write the index, too.

    Raises
    ------
    OSError
        The folder is missing or cannot be written; `path` is then unchanged.

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
    # Pandas quotes cells that contain a part of the line end, so with both parts any name with a
    # line end is one cell. The lines themselves end in a plain one.
    text = safe.to_csv(index=False, lineterminator="\r\n")
    write_text(path, _QUOTED_OR_END.sub(lambda found: found[1] or "\n", text))


def as_text(value: Any) -> Any:
    r"""Put an apostrophe before a text that a spreadsheet would take for a formula.

    Names come from other people's files: a record named ``=cmd|'/c calc'!A1`` would run a program
    when the table is opened. With the apostrophe it is displayed. If there already is one, another
    is added, so that a program that reads the table recovers the name by removing one.

    Examples
    --------
    >>> from ctrl_realize.io.text.csv_files import as_text
    >>> print(as_text("=1+1"), as_text("'=1+1"), as_text("valve 16 mA"), as_text(-1.5))
    '=1+1 ''=1+1 valve 16 mA -1.5
    """
    return _FORMULA.sub(r"\1'", value) if isinstance(value, str) else value
