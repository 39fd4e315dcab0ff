"""Reports in a real browser: desktop, phone and dark."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

import ctrl_realize as cr
from ctrl_realize import report

_spec = importlib.util.spec_from_file_location("browser", Path(__file__).with_name("browser.py"))
browser = importlib.util.module_from_spec(_spec)
sys.modules["browser"] = browser
_spec.loader.exec_module(browser)

MEASURE = """
const wide = [...document.querySelectorAll('main > *, figure, svg.plot, .verdict, pre')]
  .filter(e => e.getBoundingClientRect().right > window.innerWidth + 1)
  .map(e => e.tagName);
const figures = [...document.querySelectorAll('figure')].map(f => {
  const box = f.querySelector('svg').getBoundingClientRect();
  return [f.id, box.width, box.height, f.querySelectorAll('svg path').length];
});
return {
  scroll: document.documentElement.scrollWidth,
  width: window.innerWidth,
  wide: wide,
  figures: figures,
  first: document.querySelector('.verdict').getBoundingClientRect().top,
  background: getComputedStyle(document.body).backgroundColor,
  ink: getComputedStyle(document.querySelector('svg.plot text')).fill,
};
"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    valve = cr.bench.valve(rest=0.5, hold=1.0)
    record = valve.step_record(16.0, rng=5, name="a name that is rather " + "long" * 40)
    system = cr.identify(record, method="scan", order=3, max_delay=80)
    one = report.write_identification(
        folder / "one.html", system, record, settings={"path": "/a/b" * 60},
        calls=[("In a terminal", "ctrl-realize identify " + "x" * 300)],
    )  # fmt: skip
    records = [valve.step_record(16.0, rng=k) for k in range(3)]
    campaign = cr.identify_campaign(records, method="scan", order=3, max_delay=80, progress=False)
    many = report.write_campaign(folder / "many.html", campaign, records=records)
    return {"one": (one, 7), "many": (many, 4)}


@pytest.mark.browser
@pytest.mark.skipif(browser.missing() is not None, reason=str(browser.missing()))
@pytest.mark.parametrize(
    ("width", "height", "dark"), [(1280, 900, False), (375, 800, False), (375, 800, True)]
)
def test_a_report_shows_every_figure_without_overflow_or_error(
    tmp_path, pages, width, height, dark
):
    with browser.Browser(tmp_path, width, height, dark=dark) as window:
        for page, count in pages.values():
            window.open(page)
            seen = window.run(MEASURE)
            assert window.complaints() == []
            assert seen["width"] == width
            assert seen["scroll"] <= width
            assert seen["wide"] == []
            assert len(seen["figures"]) == count
            for name, wide, high, paths in seen["figures"]:
                assert wide > 0.8 * min(width, 480), name
                assert high > 0.4 * wide, name
                assert paths > 10, name
            assert seen["first"] < height  # the verdict is on the first screen
            light = "rgb(255, 255, 255)"
            assert (seen["background"] == light) is not dark
            assert seen["ink"] != seen["background"]
