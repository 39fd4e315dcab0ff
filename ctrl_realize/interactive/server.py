"""The page on this machine: a server on the loopback address, for one user.

A request needs the token of the address, the host name of this machine, and no other origin.
Nothing is loaded from outside: the content security policy of the page forbids it.
"""

from __future__ import annotations

import hmac
import json
import secrets
import sys
import webbrowser
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from .hosting import PAGE, Host, page_part
from .session import Session

LOOPBACK = "127.0.0.1"
MOST_BYTES = 768 * 2**20
"""Largest command: a file of half a gigabyte in base 64."""


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
        self.host, self.token = host, secrets.token_urlsafe(24)

    def handle_error(self, *request: Any) -> None:
        """Tell a defect; a browser that has gone away is none."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(*request)

    @property
    def address(self) -> str:
        """Address with the token."""
        return f"http://{LOOPBACK}:{self.server_address[1]}/{self.token}/"


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # which holds back the second part of an answer for 40 ms
    server: AppServer

    def do_GET(self) -> None:
        """Send the page or one of its parts."""
        place = self._allowed()
        if place in PAGE["files"]:
            self._send(200, *page_part(place))
        elif place is not None:
            self._send(404, "text/html", "there is no such page")

    def do_POST(self) -> None:
        """Carry out a command."""
        place = self._allowed(json_only=True)
        length = int(self.headers.get("Content-Length") or 0)
        if place is None:
            return None
        if place != "command" or not 0 <= length <= MOST_BYTES:
            return self._send(404, "text/html", "there is no such page")
        command = None
        with suppress(ValueError, RecursionError):
            command = json.loads(self.rfile.read(length))
        if not isinstance(command, dict):
            return self._send(400, "text/html", "expected a command, a JSON object")
        return self._send(200, "application/json", json.dumps(self.server.host.answer(command)))

    def _allowed(self, json_only: bool = False) -> str | None:
        """Part of the address behind the token, or None after a refusal."""
        hosts = [f"{name}:{self.server.server_address[1]}" for name in (LOOPBACK, "localhost")]
        token, _, place = self.path.partition("?")[0].lstrip("/").partition("/")
        said, own = self.headers, self.server.token.encode()
        allowed = {
            "another host name": said.get("Host") in hosts,
            "another origin": said.get("Origin") in (None, *(f"http://{one}" for one in hosts)),
            "another site": said.get("Sec-Fetch-Site") in (None, "none", "same-origin"),
            "not JSON": not json_only or said.get_content_type() == "application/json",
            "a wrong token": hmac.compare_digest(token.encode(), own),
        }
        if all(allowed.values()):
            return place
        self.close_connection = True  # what else the request holds is not read
        wrong = next(why for why, is_so in allowed.items() if not is_so)
        self._send(403, "text/html", f"refused: {wrong}")
        return None

    def _send(self, code: int, kind: str, text: str) -> None:
        content = text.encode()
        self.send_response(code)
        own = {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(content))}
        for name, value in (own | PAGE["headers"]).items():
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
        if said := session.add_file(path).get("error"):
            say(said)
    with closing(Host(session)) as host, AppServer(host, port) as server:
        opened = browser and webbrowser.open(server.address)
        say(f"{'opened' if opened else 'open in a browser'}: {server.address}")
        say("Ctrl-C ends it; save the work in the page first")
        with suppress(KeyboardInterrupt):
            server.serve_forever()
