"""Pages of the site in a real browser, as wide as a desk and as a telephone."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests import browser

DOCS = Path(__file__).resolve().parents[1] / "docs"
BUILDERS = "sphinx", "myst_nb", "furo", "numpydoc", "sphinx_copybutton"
LEFT_OUT = "_build,_ext,generated,theory,api,course,*_table.md"
"""Parts without which the pages are built in seconds; their cells are not run either. Links are
followed by Sphinx when all of the site is built."""
PAGES = "index", "tutorial", "datasets", "flags", "glossary", "howto/index", "howto/own_csv"
MEASURE = """
return {
  title: document.querySelector('h1').innerText,
  scroll: document.documentElement.scrollWidth,
  missing: [...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src),
  background: getComputedStyle(document.body).backgroundColor,
};
"""
WHITE = "rgb(255, 255, 255)"


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    if absent := [name for name in BUILDERS if find_spec(name) is None]:
        pytest.skip(f"the site is built with {', '.join(absent)}: the extra 'docs'")
    folder = tmp_path_factory.mktemp("site")
    settings = ["-D", "nb_execution_mode=off", "-D", f"exclude_patterns={LEFT_OUT}"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-Q", "-b", "html", *settings, DOCS, folder],
        capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "Agg"}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.browser
@pytest.mark.skipif(browser.missing() is not None, reason=str(browser.missing()))
@pytest.mark.parametrize(("width", "height", "dark"), [(1280, 900, False), (390, 844, True)])
def test_pages_fit_the_window_and_complain_of_nothing(tmp_path, site, width, height, dark):
    with browser.Browser(tmp_path, width, height, dark=dark) as window:
        for page in PAGES:
            window.open(site / f"{page}.html")
            seen = window.run(MEASURE)
            assert window.complaints() == [], page
            assert seen["title"], page
            assert seen["scroll"] <= width, page
            assert seen["missing"] == [], page
            assert (seen["background"] == WHITE) is not dark, page
