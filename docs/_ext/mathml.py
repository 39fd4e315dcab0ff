"""Formulas as MathML: browsers draw them themselves, without a script and without a network."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import latex2mathml

NAMESPACE = "http://www.w3.org/1998/Math/MathML"
ACCENTS = ("\u02c6", "\u02c9", "\u02d9", "\u02dc")
"""Hat, bar, dot and tilde, as the converter writes them."""


def _markup(formula: str, *, block: bool) -> str:
    # The converter knows \ldots only, which \dots means between commas.
    written = latex2mathml.tex2mathml(formula.replace(r"\dots", r"\ldots"), as_block=block)
    math = ElementTree.fromstring(written.replace("&ApplyFunction;", "\u2061"))
    _repair(math)
    ElementTree.register_namespace("", NAMESPACE)
    return ElementTree.tostring(math, encoding="unicode", short_empty_elements=False)


def _repair(math: ElementTree.Element) -> None:
    """Set an index beside an accented letter, not below it; take the spaces off bars."""
    for both in list(math.iter(f"{{{NAMESPACE}}}munderover")):
        letter, index, above = both
        if above.text in ACCENTS:
            accented = ElementTree.Element(f"{{{NAMESPACE}}}mover", {"accent": "true"})
            accented.extend([letter, above])
            both.tag = f"{{{NAMESPACE}}}msub"
            both[:] = [accented, index]
    for sign in math.iter(f"{{{NAMESPACE}}}mo"):
        if sign.text == "|":
            sign.attrib.update(lspace="0", rspace="0")


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_markup(node.astext(), block=False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    translator.body.append(
        f'<div class="math-block">{_markup(node.astext(), block=True)}{number}</div>'
    )
    raise nodes.SkipNode


def keep_stops(app: Any, doctree: nodes.document, docname: str) -> None:
    """Hold a formula and the full stop or comma behind it together."""
    for formula in list(doctree.findall(nodes.math)):
        place = formula.parent.index(formula)
        behind = formula.parent[place + 1 : place + 2]
        if not behind or not isinstance(behind[0], nodes.Text) or behind[0][:1] not in ".,;:)":
            continue
        text = behind[0].astext()
        formula.parent.replace(behind[0], nodes.Text(text[1:]))
        held = nodes.inline("", "", classes=["whole"])
        formula.parent.replace(formula, held)
        held += [formula, nodes.Text(text[0])]


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", keep_stops)
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
