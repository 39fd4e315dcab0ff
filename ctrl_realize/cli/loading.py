"""Signals, as of interruptions while compiled code is loaded, which may show as any error."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def handled(signals: Iterable[Any], default: Any, handler: Callable[..., None]) -> Iterator[None]:
    """Handle those signals in the block that have their default handler, which is restored."""
    # only the main thread may handle signals
    main = threading.current_thread() is threading.main_thread()
    mine = [one for one in signals if main and signal.getsignal(one) is default]
    try:
        for one in mine:
            signal.signal(one, handler)
        yield
    finally:
        for one in mine:
            signal.signal(one, default)


@contextmanager
def loading() -> Iterator[None]:
    """Notice an interruption in the block; it ends in KeyboardInterrupt, whatever it led to."""
    stopped = []

    def stop(number: int, frame: FrameType | None) -> None:
        stopped.append(number)
        raise KeyboardInterrupt

    try:
        with handled([signal.SIGINT], signal.default_int_handler, stop):
            yield
    except BaseException:
        if not stopped:
            raise
    if stopped:
        raise KeyboardInterrupt
