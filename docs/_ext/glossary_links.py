"""The first mention of a glossary term on a page becomes a link to its explanation."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes

GLOSSARY = "glossary"

EVERYDAY = {"order", "core", "structure"}
"""Terms that are common words as well; they are linked by hand where they are meant."""

CLOSED = (nodes.literal, nodes.reference, nodes.title, nodes.math, nodes.caption, nodes.term)
"""Nodes whose text is left alone."""


def _pattern(terms: dict[str, str]) -> re.Pattern[str] | None:
    # Longer terms first, so that the "zero-phase filter" is not taken for a filter.
    longest = sorted(terms, key=len, reverse=True)
    words = "|".join(re.escape(term).replace(r"\ ", r"\s+") for term in longest)
    return re.compile(rf"(?<![\w-])({words})(?![\w-])", re.IGNORECASE) if words else None


def _is_open(text: nodes.Text) -> bool:
    parent = text.parent
    while parent is not None:
        if isinstance(parent, (*CLOSED, nodes.literal_block, nodes.raw)):
            return False
        parent = parent.parent
    return True


def link_terms(app: Any, doctree: nodes.document, docname: str) -> None:
    if docname == GLOSSARY or docname.startswith("generated/api") or app.builder.format != "html":
        return
    objects = app.env.get_domain("std").objects
    targets = {
        name.lower(): place[1]
        for (kind, name), place in objects.items()
        if kind == "term" and name.lower() not in EVERYDAY
    }
    left = dict(targets)
    page = app.builder.get_relative_uri(docname, GLOSSARY)
    for paragraph in doctree.findall(nodes.paragraph):
        for text in list(paragraph.findall(nodes.Text)):
            parts = _linked(str(text), left, page) if _is_open(text) else []
            if len(parts) > 1:
                text.parent.replace(text, parts)


def _linked(text: str, left: dict[str, str], page: str) -> list[nodes.Node]:
    """Cut a text at the terms that are left, and take those from them."""
    parts: list[nodes.Node] = []
    while (pattern := _pattern(left)) and (found := pattern.search(text)):
        uri = f"{page}#{left.pop(' '.join(found[1].lower().split()))}"
        link = nodes.reference("", found[1], refuri=uri, internal=True, classes=["glossary"])
        parts += [nodes.Text(text[: found.start()]), link]
        text = text[found.end() :]
    return [part for part in (*parts, nodes.Text(text)) if part.astext()]


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", link_terms)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
