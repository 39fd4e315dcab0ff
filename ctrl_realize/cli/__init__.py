"""The command line: ``ctrl-realize identify``, ``compare`` and ``demo``."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Sequence
from types import FrameType


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.

    Returns
    -------
    int
        0: success. 1: success, but some records or the report failed. 2: wrong usage or unusable
        input; nothing was written. 3: a defect of this program, with its traceback. 130:
        interrupted. 143: terminated by the system.
    """
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    stopped = []

    def stop(number: int, frame: FrameType | None) -> None:
        stopped.append(number)
        raise KeyboardInterrupt

    # Loading takes a second or more. An interruption while compiled code is loaded may show as any
    # error, or as none.
    ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    try:
        if ours:
            signal.signal(signal.SIGINT, stop)
        from .commands import run
    except BaseException:
        if not stopped:
            raise
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
    if stopped:
        sys.stderr.write("ctrl-realize: interrupted\n")
        return 130
    return run(words)
