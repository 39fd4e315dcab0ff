"""Long code in tables may break behind the signs that part its words, and nowhere else."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes

LONG = 12
"""Letters from which code may break."""
BEHIND = re.compile(r"(?<=[/_.:(,=])(?=[^/_.:(,=)])")


def let_code_break(app: Any, doctree: nodes.document, docname: str) -> None:
    if app.builder.format != "html":
        return
    if docname.startswith("generated/api"):  # names of the reference stay whole
        return
    for entry in doctree.findall(nodes.entry):
        for code in list(entry.findall(nodes.literal)):
            words = code.astext()
            if len(words) <= LONG or len(code.children) != 1:
                continue
            parts: list[nodes.Node] = []
            for part in BEHIND.split(words):
                parts += [nodes.Text(part), nodes.raw("", "<wbr>", format="html")]
            code.children = []
            code.extend(parts[:-1])


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", let_code_break)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
