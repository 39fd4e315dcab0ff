"""Pages of the gallery, and their thumbnails: each script in docs/gallery is run and drawn.

The first line of a script's docstring is the title; its last line, `See: page, page`, names
where to read on, as paths from the pages that are written.
"""

from __future__ import annotations

import ast
import runpy
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

THUMBNAIL = 400
"""Width in pixels."""


@dataclass(frozen=True)
class Example:
    """One script, in parts."""

    name: str
    title: str
    words: str
    pages: tuple[str, ...]
    code: str


def examples(folder: Path) -> list[Example]:
    """Read all scripts, in the order of their names."""
    return [_read(path) for path in sorted(folder.glob("*.py"))]


def _read(path: Path) -> Example:
    source = path.read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source)) or ""
    words, _, pages = docstring.rpartition("See: ")
    title, _, words = words.partition("\n")
    code = source.split('"""', 2)[2].strip() + "\n"
    return Example(path.stem, title, words.strip(), tuple(pages.split(", ")), code)


def write(folder: Path, into: Path, package: Path) -> None:
    """Write a page for each script, its figure, and the cards of all."""
    into.mkdir(parents=True, exist_ok=True)
    newest = max(path.stat().st_mtime for path in package.rglob("*.py"))
    found = examples(folder)
    for example in found:
        script, figure = folder / f"{example.name}.py", into / f"{example.name}.png"
        if not figure.exists() or figure.stat().st_mtime < max(newest, script.stat().st_mtime):
            _draw(script, figure)
        _update(into / f"{example.name}.md", _page(example))
    _update(into / "cards.txt", _cards(found))
    for path in into.glob("*.md"):  # of scripts that are no more
        if path.stem not in {example.name for example in found}:
            path.unlink()


def _draw(script: Path, figure: Path) -> None:
    """Run a script, and store the figure that it leaves, large and small."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with mpl.rc_context():
        runpy.run_path(str(script))
        drawn = plt.gcf()
        drawn.savefig(figure.with_suffix(".thumb.png"), dpi=THUMBNAIL / drawn.get_figwidth())
        drawn.savefig(figure, dpi=150)
        plt.close("all")


def _page(example: Example) -> str:
    links = ", ".join(f"{{doc}}`{page}`" for page in example.pages)
    return (
        f"# {example.title}\n\n{example.words}\n\n"
        f"```{{image}} {example.name}.png\n:alt: {example.title}\n:class: drawn\n```\n\n"
        f"```python\n{example.code}```\n\n"
        f"Read on: {links}. Script: {{download}}`{example.name}.py "
        f"<../../gallery/{example.name}.py>`.\n"
    )


def _cards(found: list[Example]) -> str:
    cards = [
        f":::{{container}}\n[![{each.title}](generated/gallery/{each.name}.thumb.png)]"
        f"(generated/gallery/{each.name}.md)\n\n[{each.title}](generated/gallery/{each.name}.md)\n:::"
        for each in found
    ]
    return "::::{container} thumbnails\n" + "\n".join(cards) + "\n::::\n"


def _update(path: Path, text: str) -> None:
    # Unchanged pages are not touched, so that a second build has nothing to do.
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
