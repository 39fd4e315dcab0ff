"""The command line: ``look``, ``identify``, ``tune``, ``compare``, ``valve`` and ``loop``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .loading import loading


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.

    Returns
    -------
    int
        0: success. 1: success, but some records or the report failed. 2: wrong usage, unusable
        input or a disk error; no results were written. 3: a defect of this program, with its
        traceback. 130: interrupted. 143: terminated by the system.
    """
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    try:
        with loading():
            from .commands import run
    except KeyboardInterrupt:
        sys.stderr.write("ctrl-realize: interrupted\n")
        return 130
    return run(words)
