"""The page on this machine: a server on the loopback address, for one user.

A request needs the token of the address, the host name of this machine, and no other origin.
Nothing is loaded from outside: the content security policy of the page forbids it.
"""

from __future__ import annotations

import hmac
import json
import secrets
import webbrowser
from collections.abc import Callable, Iterable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from .hosting import Host, page_style, static
from .session import Session

LOOPBACK = "127.0.0.1"
MOST_BYTES = 768 * 2**20
"""Largest command: a file of half a gigabyte in base 64."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' "
    "data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_KINDS = {"html": "text/html", "js": "text/javascript", "css": "text/css",
          "json": "application/json"}  # fmt: skip


class AppServer(ThreadingHTTPServer):
    """Server of one session; `address` is what a browser opens.

    Parameters
    ----------
    host : Host
    port : int
        0: a free one.
    """

    daemon_threads = True

    def __init__(self, host: Host, port: int = 0) -> None:
        super().__init__((LOOPBACK, port), _Handler)
        self.host = host
        self.token = secrets.token_urlsafe(24)

    @property
    def address(self) -> str:
        """Address with the token."""
        return f"http://{LOOPBACK}:{self.server_address[1]}/{self.token}/"


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: AppServer

    def do_GET(self) -> None:
        """Send the page or one of its parts."""
        if (place := self._allowed()) is None:
            return
        pages: dict[str, Callable[[], str]] = {
            "": lambda: static("index.html"),
            "app.js": lambda: static("app.js"),
            "page.js": lambda: static("page.js"),
            "app.css": page_style,
        }
        if place not in pages:
            self._send(404, "html", "there is no such page")
            return
        kind = place.rpartition(".")[2] or "html"
        self._send(200, kind, pages[place]())

    def do_POST(self) -> None:
        """Carry out a command."""
        place = self._allowed(json_only=True)
        if place is None:
            return
        length = int(self.headers.get("Content-Length") or 0)
        if place not in ("command", "cancel") or not 0 <= length <= MOST_BYTES:
            self._send(404, "json", "{}")
            return
        try:
            command = json.loads(self.rfile.read(length) or b"{}")
            assert isinstance(command, dict)
        except (ValueError, AssertionError, RecursionError):
            self._send(400, "json", json.dumps({"error": "expected a command as a JSON object"}))
            return
        host = self.server.host
        if place == "cancel":
            host.cancel()
            self._send(200, "json", "{}")
        else:
            self._send(200, "json", json.dumps(host.answer(command)))

    def _allowed(self, json_only: bool = False) -> str | None:
        """Part of the address behind the token, or None after a refusal."""
        port = self.server.server_address[1]
        names = [f"{name}:{port}" for name in (LOOPBACK, "localhost")]
        origin = self.headers.get("Origin")
        token, _, place = self.path.partition("?")[0].lstrip("/").partition("/")
        reasons = {
            "another host name": self.headers.get("Host") not in names,
            "another origin": origin is not None
            and origin not in [f"http://{name}" for name in names],
            "another site": self.headers.get("Sec-Fetch-Site", "none")
            not in ("same-origin", "none"),
            "not JSON": json_only
            and self.headers.get_content_type() != "application/json",
            "a wrong token": not hmac.compare_digest(
                token.encode(), self.server.token.encode()
            ),
        }  # fmt: skip
        wrong = [reason for reason, is_so in reasons.items() if is_so]
        if not wrong:
            return place
        self.close_connection = True  # what else the request holds is not read
        self._send(403, "html", f"refused: {wrong[0]}")
        return None

    def _send(self, code: int, kind: str, text: str) -> None:
        content = text.encode()
        self.send_response(code)
        self.send_header("Content-Type", f"{_KINDS[kind]}; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Requests are not told; the address with its token would be among them."""


def serve(
    files: Iterable[Path], *, say: Callable[[str], None], browser: bool = True, port: int = 0
) -> None:
    """Open files in a session, show the page, and serve it until interrupted.

    Parameters
    ----------
    files : iterable of path
    say : callable
        Takes lines for the user: the address, and files that cannot be read.
    browser : bool
        Open the address in the browser of the system.
    port : int
        0: a free one.
    """
    session = Session()
    for path in files:
        answer = session.add_file(path)
        if "error" in answer:
            say(answer["error"])
    with Host(session) as host, AppServer(host, port) as server:
        opened = browser and webbrowser.open(server.address)
        say(f"{'opened' if opened else 'open in a browser'}: {server.address}")
        say("Ctrl-C ends it; save the work in the page first")
        with suppress(KeyboardInterrupt):
            server.serve_forever()
