"""How a run ends that is stopped from outside: in one line, with nothing left behind."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130
_SIGNALS = ("SIGTERM", "SIGHUP")


class Stopped(KeyboardInterrupt):
    """The system asks the process to end: cleaned up after as after Ctrl-C."""


class Ending:
    """How the run ended, as an exit code; None as long as nobody stopped it."""

    code: int | None = None


@contextmanager
def stopped_by_signals() -> Iterator[Ending]:
    """Let SIGTERM and SIGHUP raise `Stopped` in the block, once; handlers are put back after it.

    Python ends at once at these signals, without cleaning up: folders half written would stay,
    and workers go on.
    """
    ending = Ending()
    if threading.current_thread() is not threading.main_thread():
        yield ending  # only the main thread may handle signals
        return
    known = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]

    def stop(number: int, frame: FrameType | None) -> None:
        for one in known:
            signal.signal(one, signal.SIG_IGN)  # what is cleaned up now takes a moment
        ending.code = 128 + number
        raise Stopped

    # one that is ignored (nohup), or not Python's, stays as it is
    before = {one: signal.getsignal(one) for one in known}
    mine = [one for one, handler in before.items() if handler is signal.SIG_DFL]
    try:
        for one in mine:
            signal.signal(one, stop)
        yield ending
    finally:
        for one in mine:
            signal.signal(one, before[one])
