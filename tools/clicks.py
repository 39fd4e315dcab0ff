#!/usr/bin/env python3
"""Count clicks from the front page of the built site to the page of each of ten tasks.

    python tools/clicks.py docs/_build/html                      the table, printed
    python tools/clicks.py docs/_build/html --before OTHER/html  beside another state of the site

Tasks and pages are in docs/tasks.toml. Two ways are counted: links in the text alone, and the
navigation beside it, where unfolding a section is a click of its own.
"""

from __future__ import annotations

import argparse
import tomllib
from collections import deque
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

TASKS = Path(__file__).resolve().parents[1] / "docs" / "tasks.toml"
VOID = {"area", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "wbr"}


class Links(HTMLParser):
    """Links of the text, and those of the navigation with the depth at which they stand."""

    def __init__(self) -> None:
        super().__init__()
        self.text: list[str] = []
        self.navigation: dict[str, int] = {}
        self._open: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = {name: value or "" for name, value in attrs}
        if tag not in VOID:
            self._open.append((tag, f"{named.get('id', '')} {named.get('class', '')}"))
        if tag == "a" and named.get("href"):
            inside = {word for _, words in self._open for word in words.split()}
            depth = [word for word in inside if word.startswith("toctree-l")]
            if "sidebar-tree" in inside and depth:
                level = max(int(word.removeprefix("toctree-l")) for word in depth)
                self.navigation.setdefault(named["href"], level)
            elif "furo-main-content" in inside:
                self.text.append(named["href"])

    def handle_endtag(self, tag: str) -> None:
        if tag in {each for each, _ in self._open}:  # a stray end closes nothing
            while self._open.pop()[0] != tag:
                pass


def links_of(site: Path, page: str) -> Links:
    parser = Links()
    parser.feed((site / f"{page}.html").read_text(encoding="utf-8"))
    return parser


def target(site: Path, page: str, href: str) -> str | None:
    """Return the page that a link of another one leads to, or None where it leaves the site."""
    parts = urlsplit(href)
    if parts.scheme or not parts.path.endswith(".html"):
        return None
    path = (site / page).parent.joinpath(unquote(parts.path)).resolve()
    inside = path.is_relative_to(site) and path.exists()
    return path.relative_to(site).with_suffix("").as_posix() if inside else None


def through_text(site: Path) -> dict[str, int]:
    """Return the least number of clicks to every page, by a breadth-first search."""
    clicks, waiting = {"index": 0}, deque(["index"])
    while waiting:
        page = waiting.popleft()
        for href in links_of(site, page).text:
            found = target(site, page, href)
            if found is not None and found not in clicks:
                clicks[found] = clicks[page] + 1
                waiting.append(found)
    return clicks


def through_navigation(site: Path) -> dict[str, int]:
    """Return the clicks to every page that the front page's navigation lists."""
    listed = links_of(site, "index").navigation
    pages = {target(site, "index", href): level for href, level in listed.items()}
    return {page: level for page, level in pages.items() if page is not None}


def table(sites: dict[str, Path]) -> str:
    tasks = tomllib.loads(TASKS.read_text(encoding="utf-8"))["task"]
    ways = {
        f"{label}{name}": search(site.resolve())
        for label, search in (("text", through_text), ("navigation", through_navigation))
        for name, site in sites.items()
    }
    lines = ["| task | " + " | ".join(ways) + " |", "|---|" + "---|" * len(ways)]
    for task in tasks:
        cells = (str(way.get(task["page"], "none")) for way in ways.values())
        lines.append(f"| {task['name']} | " + " | ".join(cells) + " |")
    mean = []
    for way in ways.values():
        found = [way[task["page"]] for task in tasks if task["page"] in way]
        mean.append(f"{sum(found) / len(found):.1f} ({len(found)} of {len(tasks)})")
    lines.append("| *mean of those that have a page* | " + " | ".join(mean) + " |")
    shown = {
        name: sum(level == 1 for level in through_navigation(site.resolve()).values())
        for name, site in sites.items()
    }
    counts = ", ".join(f"{n}{name}" for name, n in shown.items())
    return "\n".join([*lines, "", f"Entries in sight in the navigation: {counts}.", ""])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("site", type=Path)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    sites = {", before": options.before} if options.before else {}
    text = table({**sites, ", now" if options.before else "": options.site})
    if options.output:
        options.output.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
