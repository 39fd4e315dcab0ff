"""Reports in a real browser: desktop, phone and dark."""

import pytest

import ctrl_realize as cr
from ctrl_realize import report
from tests import browser

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
    valve = cr.bench.valve(pre_step_time=0.5, hold=1.0)
    record = valve.step_record(16.0, rng=5, name="a name that is rather " + "long" * 40)
    system = cr.identify(record, method="scan", order=3, max_delay=80)
    one = report.write_identification(
        folder / "one.html", system, record, settings={"path": "/a/b" * 60},
        calls=[("In a terminal", "ctrl-realize identify " + "x" * 300)],
    )  # fmt: skip
    pid = cr.design.pid(system)
    tuned = report.write_identification(folder / "tuned.html", system, record, controller=pid)
    records = [valve.step_record(16.0, rng=k) for k in range(3)]
    campaign = cr.identify_campaign(records, method="scan", order=3, max_delay=80, progress=False)
    many = report.write_campaign(folder / "many.html", campaign, records=records)
    return {"one": (one, 7), "tuned": (tuned, 8), "many": (many, 5)}


pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(browser.missing() is not None, reason=str(browser.missing())),
]


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    with browser.Browser(tmp_path_factory.mktemp("profile"), 1280, 900) as opened:
        yield opened


@pytest.mark.parametrize(("width", "height", "dark"), [(1280, 900, False), (375, 800, True)])
def test_a_report_shows_every_figure_without_overflow_or_error(window, pages, width, height, dark):
    window.show(width, height, dark=dark)
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


VIEW = "return document.querySelector('svg.plot').getAttribute('viewBox').split(' ').map(Number);"
MIDDLE = """
const svg = document.querySelector('svg.plot');
svg.scrollIntoView({block: 'center'});
const box = svg.getBoundingClientRect();
return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)];
"""
READ = "return document.querySelector('.tools output').textContent;"


def test_figures_zoom_by_button_key_and_hand_and_are_whole_on_paper(window, pages):
    window.show(1280, 900)
    window.open(pages["one"][0])
    whole = window.run(VIEW)
    assert whole[2] > 300
    window.click(".tools button[aria-label=closer]")
    near = window.run(VIEW)
    assert near[2] == pytest.approx(whole[2] / 1.5)
    assert near[3] / near[2] == pytest.approx(whole[3] / whole[2])
    window.press("ArrowRight")  # the button that was clicked has the focus
    assert window.run(VIEW)[0] == pytest.approx(near[0] + near[2] / 8)
    before = window.run(VIEW)
    x, y = window.run(MIDDLE)
    window.drag((x, y), (x + 60, y))
    assert window.run(VIEW)[0] < before[0]
    window.press("-", "-")
    assert window.run(VIEW) == pytest.approx(whole)
    window.press("+")
    window.run("dispatchEvent(new Event('beforeprint')); return 0;")
    assert window.run(VIEW) == pytest.approx(whole)
    # Where the pointer is, a time and a value are read off.
    window.drag((x, y), (x + 1, y + 1))
    assert " ms, " in window.run(READ)
    assert window.complaints() == []


def test_the_page_runs_its_own_script_and_no_other(window, tmp_path, pages):
    text = pages["one"][0].read_text(encoding="utf-8")
    foreign = tmp_path / "foreign.html"
    script = "<script>document.title = 'taken'</script></body>"
    foreign.write_text(text.replace("</body>", script), encoding="utf-8")
    window.open(foreign)
    assert window.run("return document.title;") != "taken"
    assert any("Content Security Policy" in line for line in window.complaints())
    assert window.run("return document.querySelectorAll('.tools').length;") == 7
