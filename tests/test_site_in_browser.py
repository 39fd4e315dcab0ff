"""Pages of the site in a real browser, as wide as a desk and as a telephone."""

import os
import runpy
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from tests import browser

DOCS = Path(__file__).resolve().parents[1] / "docs"
BUILDERS = "sphinx", "myst_nb", "furo", "numpydoc", "sphinx_copybutton"
PAGES = "index", "tutorial", "datasets", "flags", "glossary", "howto/index", "howto/own_csv"
"""Others are left out, no cell and no script of the gallery is run: `dev.py docs` builds it all."""
MEASURE = """
return {
  title: document.querySelector('h1').innerText,
  scroll: document.documentElement.scrollWidth,
  missing: [...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src),
  background: getComputedStyle(document.body).backgroundColor,
};
"""
SLIDER = """
const figure = document.querySelector('.front-picture');
const stored = JSON.parse(figure.querySelector('script').textContent);
return {
  at: Number(figure.querySelector('input').value),
  curve: stored.paths.indexOf(figure.querySelector('.model').getAttribute('d')),
  interval: stored.interval,
  outside: figure.classList.contains('outside'),
  said: figure.querySelector('.said').innerText,
};
"""
WHITE = "rgb(255, 255, 255)"


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    if absent := [name for name in BUILDERS if find_spec(name) is None]:
        pytest.skip(f"the site is built with {', '.join(absent)}: the extra 'docs'")
    folder = tmp_path_factory.mktemp("site")
    kept = {DOCS / f"{page}.md" for page in PAGES}
    others = [str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md") if page not in kept]
    left_out = ",".join(["_build", "_ext", "generated", *others])
    settings = ["-D", "nb_execution_mode=off", "-D", f"exclude_patterns={left_out}"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-Q", "-b", "html", "-t", "without_gallery", *settings,
         DOCS, folder],
        capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "Agg"}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    with browser.Browser(tmp_path_factory.mktemp("profile"), 1280, 900) as opened:
        yield opened


pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(browser.missing() is not None, reason=str(browser.missing())),
]


@pytest.mark.parametrize(("width", "height", "dark"), [(1280, 900, False), (390, 844, True)])
def test_pages_fit_the_window_and_complain_of_nothing(window, site, width, height, dark):
    window.show(width, height, dark=dark)
    for page in PAGES:
        window.open(site / f"{page}.html")
        seen = window.run(MEASURE)
        assert window.complaints() == [], page
        assert seen["title"], page
        assert seen["scroll"] <= width, page
        assert seen["missing"] == [], page
        assert (seen["background"] == WHITE) is not dark, page


def test_the_slider_of_the_front_page_shows_the_best_model_of_the_assumed_dead_time(
    window, tmp_path
):
    picture = runpy.run_path(str(DOCS / "_ext" / "front_picture.py"))
    drawn = picture["html"](picture["candidates"](np.arange(0.0, 41.0, 20.0)))
    script = (DOCS / "_static" / "front.js").read_text(encoding="utf-8")
    page = tmp_path / "front.html"
    page.write_text(f"<meta charset='utf-8'><script>{script}</script>{drawn}", encoding="utf-8")
    window.show(1280, 900)
    window.open(page)
    assert not window.run(SLIDER)["outside"]  # it begins at the estimate
    window.click(".front-picture input")
    for key, at in (("Home", 0), ("End", 2), ("ArrowLeft", 1)):
        window.press(key)
        seen = window.run(SLIDER)
        assert seen["at"] == seen["curve"] == at
        low, high = seen["interval"]
        assert seen["outside"] is not (low <= 20 * at <= high)
        assert f"With {20 * at} s" in seen["said"]
        assert ("rule it out" in seen["said"]) is seen["outside"]
    assert window.complaints() == []
