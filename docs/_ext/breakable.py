"""Long code in tables and long names in titles break where their words meet, and nowhere else."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes

LONG = 12
"""Letters from which code may break."""
BEHIND = re.compile(r"(?<=[/_.:(,=])(?=[^/_.:(,=)])")
LINE = 40
"""Letters from which code in a sentence may break."""
UNITS = (re.compile(r"(?<=[\d)]) (?=(?:%|s|ms|Hz)(?!\w))"), "\u00a0")
NUMBERS = (
    (re.compile(r"(?:-\+|\+-|\u2213) (?=[\d.])"), "\u00b1\u00a0"),
    UNITS,
    (re.compile(r"(?<=\d)\u2013(?=\d)"), "\u2060\u2013\u2060"),
    (re.compile(r"(?<=\d) (?=\d{3}(?!\d))"), "\u00a0"),
    (re.compile(r"(?<=\d) (to|\u2026|\.\.\.) (?=-?\d)"), "\u00a0\\1\u00a0"),
)
"""What stands between numbers and units -> what does not break there."""
SENTENCES = (nodes.paragraph, nodes.strong, nodes.emphasis, nodes.reference)
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
        for text in list(entry.findall(nodes.Text)):
            if not isinstance(text.parent, nodes.literal):
                text.parent.replace(text, nodes.Text(_kept_together(text.astext())))
    for paragraph in doctree.findall(nodes.paragraph):
        for text in list(paragraph.findall(nodes.Text)):
            if isinstance(text.parent, SENTENCES):
                text.parent.replace(text, nodes.Text(UNITS[0].sub(UNITS[1], text.astext())))
    for code in list(doctree.findall(nodes.literal)):
        if len(code.astext()) > LINE:
            _break(code, BEHIND)
        elif len(code.astext()) <= LONG:
            code["classes"].append("whole")


def _kept_together(words: str) -> str:
    """Keep a number with its unit and a range in one line; write the sign of both ways as one."""
    for pattern, instead in NUMBERS:
        words = pattern.sub(instead, words)
    return words


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
