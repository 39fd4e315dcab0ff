"""A headless Chromium without any other program: the DevTools protocol through two pipes."""

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATIENCE = 60.0
"""Seconds to wait for an answer; a busy machine starts a browser slowly."""
CODES = {
    "ArrowRight": 39, "ArrowLeft": 37, "Home": 36, "End": 35, "Enter": 13, "Escape": 27, "Tab": 9,
}  # fmt: skip


def program() -> str | None:
    """Return the browser that is installed, None if there is none."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


def missing() -> str | None:
    """Say what is missing for these tests, None if nothing is."""
    if os.name == "nt":
        return "the pipes to Chromium are those of POSIX"
    return None if program() else f"none of {', '.join(NAMES)} is installed"


class Browser:
    """One window of a given size; to be used in a ``with`` block."""

    def __init__(self, folder: Path, width: int, height: int, *, dark: bool = False) -> None:
        self._folder, self._size, self._dark = folder, (width, height), dark
        self._number, self._rest, self._session = 0, b"", ""
        self._events: list[dict[str, Any]] = []
        self._tabs: list[str] = []

    def __enter__(self) -> Self:
        # Chromium reads from descriptor 3 and writes to 4.
        pipes = 'exec "$@" 3<&0 4>&1 0</dev/null 1>/dev/null 2>/dev/null'
        arguments = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-background-networking",
            "--remote-debugging-pipe",
            f"--user-data-dir={self._folder / f'profile-{time.monotonic_ns()}'}",
        ]
        self._process = subprocess.Popen(
            ["sh", "-c", pipes, "sh", str(program()), *arguments],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            self.tab(0)
        except BaseException:
            self._stop()
            raise
        return self

    def tab(self, number: int) -> None:
        """Go on in a tab, in a new one if it is not there yet."""
        if number == len(self._tabs):
            self._session = ""
            page = self._ask("Target.createTarget", url="about:blank")["targetId"]
            attached = self._ask("Target.attachToTarget", targetId=page, flatten=True)
            self._tabs.append(attached["sessionId"])
            self._session = self._tabs[number]
            for domain in ("Page", "Runtime", "Log", "Network"):
                self._ask(f"{domain}.enable")
            self.show(*self._size, dark=self._dark)
        self._session = self._tabs[number]

    def __exit__(self, *_: object) -> None:
        self._session = ""
        try:
            self._ask("Browser.close")
        finally:
            self._stop()

    def _stop(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(timeout=20)

    def _ask(self, method: str, **parameters: Any) -> Any:
        """Send a command and return its result; what happens meanwhile is kept."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(message).encode() + b"\0")
        self._process.stdin.flush()
        while True:
            answer = self._read()
            if answer.get("id") != self._number:
                self._events.append(answer)
            elif "error" in answer:
                raise RuntimeError(f"{method}: {answer['error']['message']}")
            else:
                return answer["result"]

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        while b"\0" not in self._rest:
            if not select.select([self._process.stdout], [], [], PATIENCE)[0]:
                raise TimeoutError(f"no answer of the browser within {PATIENCE:g} s")
            part = os.read(self._process.stdout.fileno(), 1 << 16)
            if not part:
                raise RuntimeError("the browser has ended")
            self._rest += part
        message, _, self._rest = self._rest.partition(b"\0")
        answer: dict[str, Any] = json.loads(message)
        return answer

    def show(self, width: int, height: int, *, dark: bool = False) -> None:
        """Give the window another size, and the colours of another preference."""
        self._size = (width, height)
        self._ask(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=True,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._ask("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, page: Path | str) -> None:
        """Load a file or an address, and wait until it is there."""
        url = page if isinstance(page, str) else page.resolve().as_uri()
        failed = self._ask("Page.navigate", url=url).get("errorText")
        if failed:
            raise RuntimeError(f"{page}: {failed}")
        while not any(event.get("method") == "Page.loadEventFired" for event in self._events):
            self._events.append(self._read())
        self._events = [e for e in self._events if e.get("method") != "Page.loadEventFired"]

    def run(self, script: str) -> Any:
        """Run a script that returns something."""
        expression = f"(() => {{ {script} }})()"
        answer = self._ask("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description"))
        return answer["result"].get("value")

    def wait(self, script: str) -> Any:
        """Run a script again and again until it returns something true, and return that."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            found = self.run(script)
            if found:
                return found
            time.sleep(0.02)
        raise TimeoutError(f"not so within {PATIENCE:g} s: {script}")

    def picture(self, file: Path, *, whole: bool = False, scale: float = 1.0) -> None:
        """Save what the window shows, or the whole page, as PNG."""
        size = self._ask("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"clip": {"x": 0, "y": 0, "width": self._size[0], "height": size["height"],
                         "scale": scale}}  # fmt: skip
        more = {"captureBeyondViewport": True, **clip} if whole else {}
        data = self._ask("Page.captureScreenshot", format="png", **more)["data"]
        file.write_bytes(base64.b64decode(data))

    def requested(self) -> list[str]:
        """Addresses that were asked for since the last call."""
        self.run("return 0;")
        wanted = "Network.requestWillBeSent"
        found = [e["params"]["request"]["url"] for e in self._events if e.get("method") == wanted]
        self._events = [e for e in self._events if e.get("method") != wanted]
        return found

    def click(self, selector: str) -> None:
        """Click on the first element that fits, as a hand would."""
        x, y = self.run(
            f"const e = document.querySelector({json.dumps(selector)});"
            "e.scrollIntoView({block: 'center', behavior: 'instant'});"
            "const box = e.getBoundingClientRect();"
            "return [box.left + box.width / 2, box.top + box.height / 2];"
        )
        self._mouse("mouseMoved", x, y)
        self._mouse("mousePressed", x, y)
        self._mouse("mouseReleased", x, y)

    def press(self, *keys: str) -> None:
        """Press keys one after the other, for what has the focus."""
        for key in keys:
            more = {"windowsVirtualKeyCode": CODES[key]} if key in CODES else {"text": key}
            self._ask("Input.dispatchKeyEvent", type="keyDown", key=key, **more)
            self._ask("Input.dispatchKeyEvent", type="keyUp", key=key, **more)

    def drag(self, *places: tuple[float, float], release: bool = True) -> None:
        """Drag with the mouse from the first of some points of the window to the last."""
        start, *others = places
        self._mouse("mouseMoved", *start)
        self._mouse("mousePressed", *start)
        for place in others:
            self._mouse("mouseMoved", *place, held=True)
        if release:
            self.release(*places[-1])

    def move(self, x: float, y: float) -> None:
        """Go on with a drag."""
        self._mouse("mouseMoved", x, y, held=True)

    def release(self, x: float, y: float) -> None:
        """Let go of the mouse's button."""
        self._mouse("mouseReleased", x, y)

    def _mouse(self, kind: str, x: float, y: float, *, held: bool = False) -> None:
        pressed = kind != "mouseMoved"
        button = "left" if pressed or held else "none"
        buttons = int(kind == "mousePressed" or held)
        self._ask(
            "Input.dispatchMouseEvent",
            type=kind, x=x, y=y, button=button, buttons=buttons, clickCount=int(pressed),
        )  # fmt: skip

    def complaints(self) -> list[str]:
        """Everything that the console has been told since the last call, and errors of scripts."""
        self.run("return 0;")  # what has happened until now is in the pipe
        events, self._events = self._events, []
        said = []
        for event in events:
            parameters = event.get("params", {})
            if event.get("method") == "Log.entryAdded":
                said.append(parameters["entry"]["text"])
            elif event.get("method") == "Runtime.consoleAPICalled":
                said.append(" ".join(str(a.get("value", "")) for a in parameters["args"]))
            elif event.get("method") == "Runtime.exceptionThrown":
                said.append(parameters["exceptionDetails"].get("text", "an error"))
        return said
