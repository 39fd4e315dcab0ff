"""How long the fuzz lane runs, and what counts as a good end of a case.

A target is a test with the argument `rng`, a `random.Random`, from which it draws everything.
In the ordinary test command Hypothesis stands behind it, takes the same few cases every time, and
shrinks what fails. ``FUZZ_CASES=100000 pytest tests/fuzz`` runs that many cases a target, drawn
ten times as fast; each is repeatable by its number:

FUZZ_CASES    number of the last case of a target
FUZZ_FIRST    number of the first of them (default 0), to go on where a run was ended
FUZZ_SEED     other seeds, other cases (default 0)
FUZZ_SECONDS  end a target after that time, however many cases it has had
FUZZ_CASE     run the case of this number alone
FUZZ_LOG      file to which each target adds a line: cases, ends, failures, time

Ctrl-C ends a target with its line in the log.
"""

import functools
import inspect
import json
import os
import random
import resource
import signal
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ctrl_realize.errors import CtrlRealizeError, CtrlRealizeWarning

CASES = int(os.environ.get("FUZZ_CASES", "0"))
FIRST = int(os.environ.get("FUZZ_FIRST", "0"))
SEED = os.environ.get("FUZZ_SEED", "0")
SECONDS = float(os.environ.get("FUZZ_SECONDS", "inf"))
CASE = os.environ.get("FUZZ_CASE")
LOG = os.environ.get("FUZZ_LOG")
MOST_FAILURES = 20
LEAK_MB = 300.0

ends: Counter[str] = Counter()
"""How the cases of the target that runs have ended."""

Target = Callable[..., None]


def fuzz(short: int) -> Callable[[Target], Target]:
    """Make a test a target, with `short` cases in the ordinary run."""

    def decorate(test: Target) -> Target:
        @functools.wraps(test)
        def run(**fixtures: Any) -> None:
            case = functools.partial(test, **fixtures)
            if CASE or CASES:
                name = os.environ.get("PYTEST_CURRENT_TEST", test.__name__)
                _long(name.split("::")[-1].split(" (")[0], case)
            else:
                _short(case, short)

        signature = inspect.signature(test)
        run.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[p for p in signature.parameters.values() if p.name != "rng"]
        )
        return run

    return decorate


def _short(case: Target, count: int) -> None:
    @settings(
        max_examples=count, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck)
    )
    @given(st.randoms(use_true_random=False, note_method_calls=True))
    def run(rng: random.Random) -> None:
        case(rng=rng)

    run()


def _long(name: str, case: Target) -> None:
    """Run case after case, on after a failure, and tell of all failures at the end."""
    ends.clear()
    numbers = [int(CASE)] if CASE else range(FIRST, CASES)
    start, failures, done, early = time.monotonic(), [], 0, 0.0
    stopped: KeyboardInterrupt | None = None
    for number in numbers:
        if time.monotonic() - start > SECONDS:
            break
        try:
            case(rng=random.Random(f"{SEED}:{name}:{number}"))
        except KeyboardInterrupt as interrupt:
            stopped = interrupt
            break
        except Exception as error:
            if CASE:
                raise
            ends["FAILED"] += 1
            if len(failures) < MOST_FAILURES:
                failures.append(f"case {number}: {_told(error)}")
        done += 1
        if done == max(CASES // 10, 1000):
            early = _megabytes()
    grown = _megabytes() - early if early else 0.0
    if LOG:
        line = {
            "target": name, "seed": SEED, "first": FIRST, "cases": done,
            "ends": dict(ends.most_common(12)),
            "seconds": round(time.monotonic() - start), "grown_mb": round(grown),
            "failures": failures,
        }  # fmt: skip
        with Path(LOG).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    if stopped:
        raise stopped
    assert not failures, "\n".join([f"{ends['FAILED']} of {done} cases:", *failures])
    assert grown < LEAK_MB, f"nine tenths of the cases took {grown:.0f} MB that stay"


def _told(error: Exception) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(str(error).split())[:300]
    return f"{type(error).__name__}: {text} ({Path(last.filename).name}:{last.lineno})"


def _megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@contextmanager
def good_end(seconds: float = 20.0, megabytes: float = 1000.0) -> Iterator[list[Any]]:
    """Let a case end in a result, in one of our warnings or in one of our errors.

    Anything else fails: another exception, a warning of NumPy or of anybody else, more than
    `seconds` of processor time (or twenty times as many of waiting), more than `megabytes` of
    memory on top of the highest so far. What the case puts into the list is there for further
    checks; on an error of ours it stays empty.
    """
    results: list[Any] = []
    before = _megabytes()

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
            # as in the ordinary run: what python-control itself calls
            warnings.filterwarnings("ignore", category=DeprecationWarning, module="control")
            warnings.simplefilter("ignore", CtrlRealizeWarning)
            yield results
        ends["result"] += 1
    except CtrlRealizeError as error:
        results.clear()
        ends[type(error).__name__] += 1
        text = str(error)
        assert text, "an error without a message"
        assert len(text) < 3000, f"a message of {len(text)} characters"
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0)
            signal.signal(number, old[number])
    assert not expired, f"the case takes longer than {seconds} s"
    grown = _megabytes() - before
    assert grown < megabytes, f"the case took {grown:.0f} MB"
