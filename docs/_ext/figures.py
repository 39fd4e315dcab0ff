"""Words for a figure that cannot be seen: the heading above it, not the name of its file."""

from __future__ import annotations

from typing import Any

from docutils import nodes


def name_figures(app: Any, doctree: nodes.document, docname: str) -> None:
    for image in doctree.findall(nodes.image):
        if image.get("alt"):
            continue
        above = image.parent
        while above is not None and not isinstance(above, nodes.section):
            above = above.parent
        if above is not None:
            image["alt"] = f"figure: {above[0].astext()}"


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", name_figures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
