"""How long the fuzz lane runs, and what counts as a good end of a case.

Short by default. ``FUZZ_CASES=100000 pytest tests/fuzz`` runs that many cases a target, other
ones on every run; Hypothesis prints how to repeat a failure, and keeps it in its database.
"""

from __future__ import annotations

import os
import resource
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis import HealthCheck, settings

from ctrl_realize.errors import CtrlRealizeError, CtrlRealizeWarning

CASES = int(os.environ.get("FUZZ_CASES", "0"))


def fuzz(short: int) -> settings:
    """Settings of a target with `short` cases in the ordinary run."""
    return settings(
        max_examples=CASES or short,
        derandomize=not CASES,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


@contextmanager
def good_end(seconds: float = 20.0, megabytes: float = 1000.0) -> Iterator[list[Any]]:
    """Let a case end in a result, in one of our warnings or in one of our errors.

    Anything else fails: another exception, a warning of NumPy or of anybody else, more than
    `seconds` of processor time (or twenty times as many of waiting), more than `megabytes` of
    memory on top of the highest so far. What the case puts into the list is there for further
    checks; on an error of ours it stays empty.
    """
    results: list[Any] = []
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    expired = False

    def too_long(*_: object) -> None:
        # noted as well, for code that turns any exception into an error of ours
        nonlocal expired
        expired = True
        raise AssertionError(f"the case takes longer than {seconds} s")

    # processor time for what computes, also on a busy machine; the clock for what waits
    timers = {
        signal.SIGPROF: (signal.ITIMER_PROF, seconds),
        signal.SIGALRM: (signal.ITIMER_REAL, 20 * seconds),
    }
    old = {number: signal.signal(number, too_long) for number in timers}
    for timer, limit in timers.values():
        signal.setitimer(timer, limit)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", CtrlRealizeWarning)
            yield results
    except CtrlRealizeError as error:
        results.clear()
        text = str(error)
        assert text, "an error without a message"
        assert len(text) < 3000, f"a message of {len(text)} characters"
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0)
            signal.signal(number, old[number])
    assert not expired, f"the case takes longer than {seconds} s"
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < megabytes, f"the case took {grown:.0f} MB"
