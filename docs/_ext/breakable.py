"""Long code in tables and long names in titles break where their words meet, and nowhere else."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes

LONG = 12
"""Letters from which code may break."""
BEHIND = re.compile(r"(?<=[/_.:(,=])(?=[^/_.:(,=)])")
WORDS = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=_)")


def let_code_break(app: Any, doctree: nodes.document, docname: str) -> None:
    if app.builder.format != "html":
        return
    if docname.startswith("generated/api"):  # in tables of the reference names stay whole
        for title in list(doctree.findall(nodes.title))[:1]:
            _break(title, WORDS)
        return
    for entry in doctree.findall(nodes.entry):
        for code in list(entry.findall(nodes.literal)):
            if len(code.astext()) > LONG:
                _break(code, BEHIND)


def _break(element: nodes.TextElement, where: re.Pattern[str]) -> None:
    if len(element.children) != 1:
        return
    parts: list[nodes.Node] = []
    for part in where.split(element.astext()):
        parts += [nodes.Text(part), nodes.raw("", "<wbr>", format="html")]
    element.children = []
    element.extend(parts[:-1])


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", let_code_break)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
