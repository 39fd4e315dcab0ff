"""The page of the app in a real browser: mouse, keys, files, tabs, and nothing from outside."""

import base64
import json
import threading

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.interactive.hosting import Host
from ctrl_realize.interactive.server import AppServer
from ctrl_realize.interactive.session import Session
from tests import browser
from tests.app_records import messy_csv, step_record

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(browser.missing() is not None, reason=str(browser.missing())),
]

READY = """
return document.querySelectorAll('.loop figure').length === 4
  && document.querySelector('.bar').hidden;
"""
DROP = """
const bytes = Uint8Array.from(atob(%s), (one) => one.charCodeAt(0));
const data = new DataTransfer();
data.items.add(new File([bytes], %s));
document.querySelector('.app').dispatchEvent(new DragEvent('drop',
  {dataTransfer: data, bubbles: true, cancelable: true}));
"""
GRIP = """
const handle = document.querySelector('[data-panel=%s] [data-handle=%s]');
handle.scrollIntoView({block: 'center', behavior: 'instant'});
const box = handle.querySelector('.grip').getBoundingClientRect();
return [box.left + box.width / 2, box.top + box.height / 2];
"""
NOW = "return Number(document.querySelector('[data-panel=%s] [data-handle=%s]').ariaValueNow);"
MODEL = "return document.querySelector('[data-panel=%s] path.model').getAttribute('d');"
TOLD = "return document.querySelector('.told').innerText;"
NUMBERS = """
return [...document.querySelectorAll('.numbers tr')].map((row) => row.innerText.split('\\t'));
"""


class Served:
    """A session on a server, in a thread."""

    def __init__(self):
        self.session = Session()

    def __enter__(self):
        self.host = Host(self.session)
        self.server = AppServer(self.host)
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()
        self.host.close()

    @property
    def address(self):
        return self.server.address


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    with browser.Browser(tmp_path_factory.mktemp("profile"), 1280, 900) as opened:
        yield opened


@pytest.fixture(scope="module")
def served():
    with Served() as running:
        running.session.add_record(step_record())
        yield running


@pytest.fixture
def page(window, served):
    """The page of a fitted record, with nothing known or struck out."""
    fresh = {"model": {"known": {}}, "record": {"struck": []}, "loop": {"rule": "simc"}}
    for part, values in fresh.items():
        served.session.apply({"do": "set", "part": part, "values": values, "index": 0})
    window.tab(0)
    window.show(1280, 900)
    window.open(served.address)
    window.wait(READY)
    window.requested()
    yield window
    assert window.complaints() == []


def drop(window, name, content):
    window.run(DROP % (json.dumps(base64.b64encode(content).decode()), json.dumps(name)))


def known(served, name):
    return served.session.state["model"]["known"].get(name)


def test_from_a_dropped_messy_file_to_pid_numbers(window, tmp_path):
    with Served() as empty:
        window.tab(0)
        window.requested()
        window.open(empty.address)
        window.wait("return document.querySelector('.drop') !== null;")
        drop(window, "log.csv", messy_csv())
        window.wait(READY)
        window.click("[data-key=form]")
        window.run(
            "const form = document.querySelector('[data-key=form]');"
            "form.value = 'rockwell_pide_dependent';"
            "form.dispatchEvent(new Event('change'));"
        )
        window.wait("return document.querySelector('.numbers').innerText.includes('PGain');")
        path = tmp_path / "log.csv"
        path.write_bytes(messy_csv())
        system = cr.identify(cr.read_record(path, missing="keep"))
        pid = cr.design.pid(system)
        expected = [list(row) for row in pid.as_form("rockwell_pide_dependent")._rows()]
        assert window.run(NUMBERS) == expected
        asked = window.requested()
        assert len(asked) > 5
        own = empty.address.partition("/")[2].partition("/")[2].partition("/")[0]
        outside = [url for url in asked if not url.startswith(("data:", f"http://{own}/"))]
        assert outside == []
        assert window.complaints() == []


def test_the_dead_time_is_dragged_with_the_mouse(page, served):
    before, (x, y) = page.run(MODEL % "start"), page.run(GRIP % ("start", "dead_time"))
    value = page.run(NOW % ("start", "dead_time"))
    width = page.run(
        "return document.querySelector('[data-panel=start] .ground').width.baseVal.value;"
    )
    panels = {one["key"]: one for one in served.session.view()["model"]["panels"]}
    per_pixel = np.diff(panels["start"]["x"]["ends"])[0] / width
    page.drag((x, y), *[(x + k, y) for k in range(4, 44, 4)], release=False)
    page.wait("return document.querySelector('.told').innerText.includes('outside of what');")
    assert page.run(MODEL % "start") != before
    # to the pixel, and to half of one at the grip
    assert page.run(NOW % ("start", "dead_time")) - value == pytest.approx(40 * per_pixel, rel=0.02)
    assert known(served, "dead_time") is None  # not before it is released
    page.release(x + 40, y)
    page.wait("return [...document.querySelectorAll('.parameters input:checked')].length === 1;")
    page.wait(READY)
    assert known(served, "dead_time") - value == pytest.approx(40 * per_pixel, rel=0.02)


def test_the_dead_time_is_moved_with_arrow_keys(page, served):
    page.run("document.querySelector('[data-panel=criterion] [data-handle=dead_time]').focus();")
    start = page.run(NOW % ("criterion", "dead_time"))
    page.press("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft")
    page.wait("return [...document.querySelectorAll('.parameters input:checked')].length === 1;")
    page.wait(READY)
    drawn = next(
        one for one in served.session.view()["model"]["panels"] if one["key"] == "criterion"
    )
    assert known(served, "dead_time") == pytest.approx(start + 2 * drawn["handles"][0]["step"])
    # and the next key moves it on
    assert page.run("return document.activeElement.dataset.handle;") == "dead_time"


def test_the_curve_that_is_drawn_is_the_profile_of_the_fit(page, served):
    page.run(
        "fetch('command', {method: 'POST', headers: {'Content-Type': 'application/json'},"
        "body: JSON.stringify({do: 'view'})}).then((one) => one.json())"
        ".then((one) => { window.seen = one.view; });"
    )
    panels = page.wait("return window.seen && window.seen.model.panels;")
    drawn = next(one for one in panels if one["key"] == "criterion")
    curve = next(one for one in drawn["layers"] if one["look"] == "model")
    dead_time, misfit = cr.identify(step_record()).fit.estimate.profile
    np.testing.assert_allclose(curve["x"], dead_time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(curve["y"], misfit, rtol=0, atol=1e-9)
    path = page.run(MODEL % "criterion")
    assert path.count("L") == len(dead_time) - 1


def test_a_fit_is_cancelled_and_made_later(page, served):
    page.run("document.querySelector('[data-structure=\"2,2\"] button').click();")
    page.wait("return !document.querySelector('.bar').hidden;")
    page.run("document.querySelector('[data-do=cancel]').click();")
    page.wait("return document.querySelector('.error').innerText.startsWith('cancelled');")
    page.wait("return document.querySelector('[data-do=fit]') !== null;")
    page.run("document.querySelector('[data-do=fit]').click();")
    page.wait(READY)
    assert (
        page.run("return document.querySelector('tr.best[data-structure]').dataset.structure;")
        == "2,2"
    )
    page.run("document.querySelector('[data-do=choose]').click();")
    page.wait("return document.querySelector('[data-do=choose]') === null;")
    page.wait(READY)


def test_a_broken_file_is_a_sentence_and_nothing_typed_is_lost(page):
    page.run(
        "const one = document.querySelector('[data-key=limits]'); one.focus(); one.value = '-1 to';"
    )
    drop(page, "broken.csv", b"\x00\x01\x02\x03" * 50)
    page.wait("return document.querySelector('.error').innerText.startsWith('broken.csv');")
    assert page.run("return document.querySelector('[data-key=limits]').value;") == "-1 to"
    assert page.run("return document.activeElement.dataset.key;") == "limits"


def test_a_stretch_is_struck_out_and_comes_back_with_undo(page, served):
    page.click("[data-do=strike]")
    x, y, wide = page.run(
        "const one = document.querySelector('[data-panel=record-output] .ground');"
        "one.scrollIntoView({block: 'center', behavior: 'instant'});"
        "const box = one.getBoundingClientRect();"
        "return [box.left, box.top + box.height / 2, box.width];"
    )
    page.drag((x + 0.5 * wide, y), (x + 0.55 * wide, y), (x + 0.6 * wide, y))
    page.wait("return document.querySelector('[data-panel=record-output] .span.out') !== null;")
    ((start, stop),) = served.session.state["records"][0]["struck"]
    # a pixel is 0.05 s
    assert (start, stop) == pytest.approx((0.5 * 29.9, 0.6 * 29.9), abs=0.15)
    page.wait(READY)
    page.run("document.querySelector('[data-do=undo]').click();")
    page.wait("return document.querySelector('[data-panel=record-output] .span.out') === null;")
    page.wait(READY)


def test_two_tabs_show_the_same_work_and_a_reload_keeps_it(page, served):
    page.tab(1)
    page.open(served.address)
    page.wait(READY)
    page.tab(0)
    page.run("const one = document.querySelector('[data-key=rule]'); one.value = 'amigo';"
             "one.dispatchEvent(new Event('change'));")  # fmt: skip
    page.wait("return document.querySelector('.script').innerText.includes('amigo');")
    page.tab(1)
    page.wait("return document.querySelector('.script').innerText.includes('amigo');")
    page.wait(READY)
    page.open(served.address)
    page.wait(READY)
    assert page.run("return document.querySelector('[data-key=rule]').value;") == "amigo"


@pytest.mark.parametrize(("width", "dark"), [(1280, True), (768, False), (400, True)])
def test_the_page_is_whole_at_every_width(page, width, dark):
    page.show(width, 850, dark=dark)
    page.run("document.querySelectorAll('details').forEach((one) => { one.open = true; });")
    page.wait("return document.querySelectorAll('.evidence svg').length === 3"
              " && document.querySelector('.bar').hidden;")  # fmt: skip
    assert page.run("return document.documentElement.scrollWidth;") <= width
    shown = page.run(
        "return [...document.querySelectorAll('svg.panel')].map((one) => one.clientWidth);"
    )
    assert len(shown) == 10
    assert min(shown) > 300
    assert page.run("return document.querySelectorAll('[role=slider]').length;") >= 8
    colour = page.run("return getComputedStyle(document.body).backgroundColor;")
    assert (colour == "rgb(255, 255, 255)") is not dark


def test_a_widget_draws_itself_apart_from_the_styles_of_its_page(page):
    """The model of a notebook is one of get, set and events; here they end at the server."""
    page.run(
        """
        window.outside = getComputedStyle(document.querySelector('h1')).fontSize;
        const held = {}, heard = {};
        const model = {
          get: (name) => held[name], set: (name, value) => { held[name] = value; },
          on: (name, call) => { heard[name] = call; },
          save_changes: () => fetch('command', {
            method: 'POST', headers: {'Content-Type': 'application/json'},
            body: JSON.stringify(held.command),
          }).then((one) => one.json()).then((one) => {
            held.answer = one; heard['change:answer']();
          }),
        };
        const el = document.body.appendChild(document.createElement('div'));
        el.id = 'cell';
        Promise.all([import('./app.js'), fetch('app.css').then((one) => one.text())])
          .then(([app, style]) => { held.style = style; window.end = app.render({model, el}); });
        """
    )
    page.wait(
        "const root = document.querySelector('#cell').shadowRoot;"
        "return root && root.querySelectorAll('svg.panel').length === 10;"
    )
    ink, size = page.run(
        "const root = document.querySelector('#cell').shadowRoot;"
        "return [getComputedStyle(root.querySelector('path.measured')).stroke,"
        "  getComputedStyle(root.querySelector('h1')).fontSize];"
    )
    assert ink == "rgb(0, 114, 178)"
    assert size == page.run("return window.outside;")
    page.run("window.end(); document.querySelector('#cell').remove();")
