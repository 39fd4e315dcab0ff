"""Content of a report, and its conversion to a self-contained HTML file."""

from __future__ import annotations

import base64
import functools
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from .._facts import facts
from .sketches import Sketch
from .verdict import Level

# control characters, and those that change the direction of writing, may occur in file names
_CONTROLS = (*range(9), 11, 12, *range(14, 32), *range(127, 160))
_UNSEEN = dict.fromkeys((*_CONTROLS, *range(0x202A, 0x202F), *range(0x2066, 0x206A)), "\ufffd")

_TABLES = facts("report/tables.toml")


@dataclass(frozen=True)
class Column:
    """Column heading.

    Attributes
    ----------
    name : str
        With its unit.
    kind : {"text", "label", "name", "number", "mono"}
        Format of the cells: numbers right-aligned, ``"mono"`` in a fixed-width font.

    Examples
    --------
    >>> from ctrl_realize.report.page import Column
    >>> Column("dead time [ms]", "number")
    Column(name='dead time [ms]', kind='number')
    """

    name: str
    kind: str = "text"


@dataclass(frozen=True)
class Row:
    """Cells of a table.

    Attributes
    ----------
    cells : tuple of str
    kind : {"", "best", "failed"}
        Emphasis of the row.

    Examples
    --------
    >>> from ctrl_realize.report.page import Row
    >>> Row(("valve_16mA_05", "37.1"), "best")
    Row(cells=('valve_16mA_05', '37.1'), kind='best')
    """

    cells: tuple[str, ...]
    kind: str = ""


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
        Heading above the table.
    rows : tuple of Row
    columns : tuple of Column
        Without names if the table has no headings.
    note : str
        A sentence below.
    folded : bool
        Whether only the title is shown until the reader opens it.

    Examples
    --------
    >>> from ctrl_realize.report.page import Column, Row, Table
    >>> columns = (Column("record", "name"), Column("delay [samples]", "number"))
    >>> rows = (Row(("valve_1", "37.1"), "best"), Row(("valve_2", "38.0")))
    >>> table = Table("Delays", rows, columns, note="two of forty")
    >>> table.columns[1].kind, len(table.rows)
    ('number', 2)
    """

    title: str
    rows: tuple[Row, ...]
    columns: tuple[Column, ...]
    note: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Controller:
    """What to enter, the closed loop, and what would make it unsafe; from `controller_of`."""

    title: str
    level: Level
    judgement: str
    entered: Table
    facts: tuple[tuple[str, str], ...]
    unsafe: tuple[str, ...]
    figure: Sketch


def pairs(
    title: str, rows: Sequence[tuple[str, str]], *, mono: bool = False, folded: bool = False
) -> Table:
    """Make a table of labels and values.

    Parameters
    ----------
    title : str
    rows : sequence of (label, value)
    mono : bool, default False
        Show the values in a fixed-width font.
    folded : bool, default False
        Show the title only until the reader opens the table.

    Returns
    -------
    Table

    Examples
    --------
    >>> from ctrl_realize.report.page import pairs
    >>> table = pairs("Bench", [("shaker", "4.2 kg"), ("room", "21 °C")])
    >>> [row.cells for row in table.rows]
    [('shaker', '4.2 kg'), ('room', '21 °C')]
    """
    columns = Column("", "label"), Column("", "mono" if mono else "text")
    return Table(title, tuple(Row(tuple(row)) for row in rows), columns, folded=folded)


def headed(
    key: str, rows: Sequence[Sequence[str]], kinds: Sequence[str] | None = None, /, **words: Any
) -> Table:
    """Make a table with the title, the columns and the note of a row of `tables.toml`.

    Columns without a single value are left out; `kinds` are those of each `Row`.
    """
    told = _TABLES[key]
    columns = [Column(name.format(**words), kind) for name, kind in told["columns"].items()]
    kept = [k for k in range(len(columns)) if any(row[k] for row in rows)]
    note = told.get("note", "").format(**words)
    filled = tuple(
        Row(tuple(row[k] for k in kept), kind)
        for row, kind in zip(rows, kinds or [""] * len(rows), strict=True)
    )
    shown = tuple(columns[k] for k in kept)
    return Table(told["title"], filled, shown, note=note, folded=told.get("folded", False))


@functools.cache
def _template() -> Template:
    """Return the page's template, compiled once, with style and script."""
    folder = resources.files("ctrl_realize.report") / "templates"
    html, css, js = (
        (folder / name).read_text(encoding="utf-8")
        for name in ("report.html.j2", "report.css", "report.js")
    )
    # The page allows only this script, whatever the data contain.
    digest = base64.b64encode(hashlib.sha256(js.encode("utf-8")).digest()).decode("ascii")
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    parts = {"css": Markup(css), "js": Markup(js), "js_digest": digest}
    return environment.from_string(html, globals=parts)


def rendered(page: Mapping[str, Any]) -> str:
    """Return a self-contained page; all text is escaped, control characters are removed.

    Parameters
    ----------
    page : mapping
        What the template reads: `title`, `subtitle`, `verdict`, `version` (of the package, for the
        footer), `sketches`, `tables`, `calls` (commands that reproduce the result), `simulated`,
        `parameters` and `controller`, either of which may be None.
    """
    return _template().render(page=page).translate(_UNSEEN) + "\n"
