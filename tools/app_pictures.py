#!/usr/bin/env python3
"""Take the pictures of the app for the pages: the measured heater, in headless Chromium.

python tools/app_pictures.py
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import ctrl_realize as cr  # noqa: E402
from ctrl_realize.interactive.hosting import Host  # noqa: E402
from ctrl_realize.interactive.server import AppServer  # noqa: E402
from ctrl_realize.interactive.session import Session  # noqa: E402
from tests.browser import Browser  # noqa: E402

FOLDER = ROOT / "docs" / "images"
READY = """
return document.querySelectorAll('.loop figure').length === 4
  && document.querySelector('.bar').hidden && !document.querySelector('.stale');
"""
GRIP = """
const box = document.querySelector('[data-panel=start] [data-handle=dead_time] .grip')
  .getBoundingClientRect();
return [box.left + box.width / 2, box.top + box.height / 2];
"""
SHOWN = """
for (const one of document.querySelectorAll('.app > *')) one.style.display = 'none';
document.querySelector('.%s').style.display = '';
scrollTo(0, 0);
"""


def main() -> None:
    session = Session()
    session.add_file(cr.datasets.path("tclab"))
    session.apply({"do": "set", "part": "model", "values": {"structure": [2, 2]}})
    with (
        closing(Host(session)) as host,
        AppServer(host) as server,
        tempfile.TemporaryDirectory() as folder,
        Browser(Path(folder), 1180, 560) as window,
    ):
        threading.Thread(target=server.serve_forever, daemon=True).start()
        window.open(server.address)
        window.wait(READY)
        window.run("for (const one of document.querySelectorAll('details')) one.open = false;")
        for part in ("data", "loop"):
            window.run(SHOWN % part)
            window.picture(FOLDER / f"app_{part}.png", whole=True)
        window.run(SHOWN % "model")
        x, y = window.run(GRIP)
        window.drag((x, y), (x + 20, y), (x + 36, y), release=False)
        window.wait("return document.querySelector('.told').innerText.includes('outside');")
        time.sleep(0.3)
        window.picture(FOLDER / "app_model.png", whole=True)
        window.release(x + 36, y)
        server.shutdown()


if __name__ == "__main__":
    main()
