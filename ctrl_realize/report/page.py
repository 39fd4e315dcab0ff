"""A report as data, and its HTML: one file that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup

from ..io.atomic import write_text
from .verdict import Verdict


@dataclass(frozen=True)
class PageFigure:
    """A picture with its words; `svg` is ours and is not escaped."""

    key: str
    title: str
    caption: str
    svg: Markup


@dataclass(frozen=True)
class Column:
    """Heading of a column; `kind` is "text", "name", "number" or "mono"."""

    name: str
    kind: str = "text"


@dataclass(frozen=True)
class Row:
    """Cells of a table as text; `kind` is "", "best" or "failed"."""

    cells: tuple[str, ...]
    kind: str = ""


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str
    rows: tuple[Row, ...]
    columns: tuple[Column, ...] = ()
    kinds: tuple[str, ...] = ()
    note: str = ""

    def kind_of(self, position: int) -> str:
        """Return the kind of the column at `position`."""
        kinds = tuple(column.kind for column in self.columns) or self.kinds
        return kinds[position] if position < len(kinds) else "text"


@dataclass(frozen=True)
class Page:
    """Everything that a report says."""

    title: str
    subtitle: str
    verdict: Verdict
    version: str
    figures: Sequence[PageFigure] = ()
    tables: Sequence[Table] = ()
    calls: Sequence[tuple[str, str]] = field(default=())
    simulated: bool = False


def pairs(title: str, rows: Sequence[tuple[str, str]], *, mono: bool = False) -> Table:
    """Make a table of labels and values."""
    return Table(
        title,
        tuple(Row(tuple(row)) for row in rows),
        kinds=("label", "mono" if mono else "text"),
    )


def render(page: Page) -> str:
    """Write a page as HTML; all text of it is escaped."""
    folder = resources.files("ctrl_realize.report") / "templates"
    html, css, js = (
        (folder / name).read_text(encoding="utf-8")
        for name in ("report.html.j2", "report.css", "report.js")
    )
    environment = Environment(
        loader=DictLoader({"report": html}), autoescape=True, undefined=StrictUndefined
    )
    # The page allows this script and no other, whatever came with the data.
    digest = base64.b64encode(hashlib.sha256(js.encode("utf-8")).digest()).decode("ascii")
    template = environment.get_template("report")
    return template.render(page=page, css=Markup(css), js=Markup(js), js_digest=digest) + "\n"


def write_page(path: str | os.PathLike[str], page: Page) -> Path:
    """Write a page to a file, whole or not at all."""
    target = Path(path)
    write_text(target, render(page))
    return target
