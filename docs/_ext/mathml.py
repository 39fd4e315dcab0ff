"""Formulas as MathML: browsers draw them themselves, without a script and without a network."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math import latex2mathml


def _markup(formula: str, *, block: bool) -> str:
    # The converter knows \ldots only, which \dots means between commas.
    return latex2mathml.tex2mathml(formula.replace(r"\dots", r"\ldots"), as_block=block)


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_markup(node.astext(), block=False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    translator.body.append(
        f'<div class="math-block">{_markup(node.astext(), block=True)}{number}</div>'
    )
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
