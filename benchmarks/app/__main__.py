"""How quickly the page of the app follows: ``python -m benchmarks.app [TABLE]``.

In headless Chromium, on the clock of the page: from the event of the mouse to the frame that shows
what it does. Records are simulated: one lag with dead time, a step, noise of 1 %.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

import ctrl_realize as cr
from benchmarks.speed.measure import cpu_seconds
from ctrl_realize.interactive.hosting import Host
from ctrl_realize.interactive.models import identified
from ctrl_realize.interactive.server import AppServer
from ctrl_realize.interactive.session import Session
from tests.browser import Browser

TABLE = Path(__file__).resolve().parents[2] / "docs" / "tables" / "app_table.md"
STEPS, RELEASES = 40, 8
READY = """
return document.querySelectorAll('.loop figure').length === 4
  && document.querySelector('.bar').hidden && !document.querySelector('.stale');
"""
CLOCK = """
window.began = 0; window.times = [];
addEventListener('pointermove', () => { window.began = performance.now(); }, true);
addEventListener('pointerup', () => { window.released = performance.now(); }, true);
const path = document.querySelector('[data-panel=start] path.model');
new MutationObserver(() => requestAnimationFrame(() => {
  window.times.push(performance.now() - window.began);
})).observe(path, {attributes: true});
"""
FITTED = """
window.fitted = 0;
const observer = new MutationObserver(() => {
  if (document.querySelector('.parameters [data-name=dead_time] input:checked') && !window.fitted) {
    requestAnimationFrame(() => { window.fitted = performance.now() - window.released; });
    observer.disconnect();
  }
});
observer.observe(document.querySelector('.model'), {childList: true});
"""
GRIP = """
const handle = document.querySelector('[data-panel=start] [data-handle=dead_time]');
handle.scrollIntoView({block: 'center', behavior: 'instant'});
const box = handle.querySelector('.grip').getBoundingClientRect();
return [box.left + box.width / 2, box.top + box.height / 2];
"""


def record(count: int) -> cr.Record:
    """30 s of a lag of 2 s with a dead time of 1.2 s."""
    time = np.linspace(0, 30, count)
    moved = 6 * -np.expm1(-np.maximum(time - 4.2, 0) / 2)
    noise = 0.06 * np.random.default_rng(1).standard_normal(count)
    return cr.Record(time, np.where(time < 3, 20.0, 30.0), 50 + moved + noise, name="heater")


@contextmanager
def page(window: Browser, given: cr.Record | Path) -> Iterator[Session]:
    """A page with one record whose structure is stated, and its session."""
    session = Session()
    if isinstance(given, Path):
        session.add_file(given)
    else:
        session.add_record(given)
    with closing(Host(session)) as host, AppServer(host) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        window.open(server.address)
        window.wait(READY)
        session.apply({"do": "set", "part": "model", "values": {"structure": [1, 1]}})
        window.open(server.address)
        window.wait(READY)
        yield session
        server.shutdown()


def dragged(window: Browser) -> list[float]:
    """Times in ms from each move of the mouse to the redrawn model."""
    window.run(CLOCK)
    x, y = window.run(GRIP)
    window.drag((x, y), (x + 1, y), release=False)
    window.wait("return window.times.length > 0;")
    window.run("window.times.length = 0;")
    for step in range(STEPS):
        window.move(x + 2 + step, y)
        window.wait(f"return window.times.length > {step};")
    times: list[float] = window.run("return window.times;")
    window.release(x + 2 + STEPS, y)
    window.wait(READY)
    return times


def released(window: Browser, session: Session) -> list[float]:
    """Times in ms from the release of the dead time to the fit of the other parameters."""
    found = []
    for number in range(RELEASES):
        session.apply({"do": "set", "part": "model", "values": {"known": {}}})
        window.run("location.reload();")
        time.sleep(0.5)
        window.wait(READY)
        window.run(CLOCK + FITTED)
        x, y = window.run(GRIP)
        # Another place each time: what was fitted once is kept.
        window.drag((x, y), (x + 5 + number, y))
        window.wait("return window.fitted > 0;")
        found.append(window.run("return window.fitted;"))
        window.wait(READY)
    return found


def opened(given: cr.Record | Path) -> tuple[float, float, int]:
    """Seconds to draw a record and to fit all structures, and the size of the view in kB."""
    session, start = Session(), time.perf_counter()
    if isinstance(given, Path):
        session.add_file(given)
    else:
        session.add_record(given)
        session.view()
    drawn = time.perf_counter()
    answer = session.apply({"do": "compute"})
    fitted = time.perf_counter()
    while answer["view"]["pending"]:
        answer = session.apply({"do": "compute"})
    return drawn - start, fitted - drawn, len(json.dumps(answer)) // 1000


def computed(count: int) -> str:
    """Processor time in ms of a step of a drag, and of the fits at a stated structure."""
    given, session = record(count), Session()
    session.add_record(given)
    session.apply({"do": "set", "part": "model", "values": {"structure": [1, 1]}})
    while session.apply({"do": "compute"})["view"]["pending"]:
        pass
    known = {"name": "P1D", "fixed": {"dead_time": 1.25}}
    works = (
        lambda: json.dumps(session.apply({"do": "drag", "values": {"dead_time": 1.25}})),
        lambda: identified([given], [1, 1], {}),
        lambda: identified([given], None, known),
    )
    return f"| {count} | " + " | ".join(f"{1e3 * cpu_seconds(one):.0f}" for one in works) + " |"


def line(name: str, times: list[float]) -> str:
    middle, high, worst = np.percentile(times, [50, 90, 100])
    return f"| {name} | {middle:.0f} | {high:.0f} | {worst:.0f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", nargs="?", type=Path, default=TABLE)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        with Browser(Path(folder), 1280, 900) as window:
            for count in (3000, 100_000):
                with page(window, record(count)) as session:
                    rows.append(line(f"a step of a drag, {count} samples", dragged(window)))
                    what = f"release to the fit of one lag, {count} samples"
                    rows.append(line(what, released(window, session)))
        files = []
        processor = [computed(count) for count in (3000, 100_000)]
        for count in (3000, 100_000):
            path = Path(folder) / f"{count}.csv"
            record(count).to_frame().to_csv(path)
            drawn, fitted, size = opened(path)
            files.append(f"| {count} | {drawn:.1f} s | {fitted:.1f} s | {size} kB |")
    parts = [
        f"| from the mouse to the frame ({STEPS} steps, {RELEASES} releases) | median ms | 90 % ms "
        "| most ms |", "|---|---|---|---|", *rows, "",
        "| samples of a CSV file | read and drawn | all structures fitted | size of the view |",
        "|---|---|---|---|", *files, "",
        "| samples | processor time of a step of a drag, ms | of the fit of one lag | of the same "
        "with a known dead time |", "|---|---|---|---|", *processor, "",
    ]  # fmt: skip
    parser.parse_args().table.write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
