"""pytest plugin of tools/mutation.py: the collected tests once for every change.

The tests are collected once. Every change is then tried in a process of its own, forked from
there: first the tests that reach the changed function, the quickest first, then the others, until
one fails. Where the list of changes is and where their ends go, the environment says.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import time
from pathlib import Path

import pytest
from mutmut.mutation import trampoline

NOTICED, SURVIVED, ENDLESS, UNREACHED, BROKEN = (
    "noticed",
    "survived",
    "endless",
    "no test",
    "broken",
)
SLACK, FACTOR = 10.0, 5.0
"""CPU seconds that a change may take beyond, and times, what the tests take without one."""

MEMORY = 6 * 2**30
"""Bytes of addresses that a change may take: a loop that fills a list ends in a MemoryError."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool:
    names = json.loads(Path(os.environ["MUTATION_NAMES"]).read_text(encoding="utf-8"))
    found = Path(os.environ["MUTATION_ENDS"])
    if session.config.option.collectonly or session.testsfailed or not session.items:
        return False
    read, write = os.pipe()
    if os.fork() == 0:
        os.close(read)
        with os.fdopen(write, "w") as pipe:
            pipe.write(json.dumps(without_change(session)))
            pipe.flush()
            os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        clean = json.loads(pipe.read() or "null")
    os.wait()
    if clean is None:
        return False
    ends = {}
    limit = SLACK + FACTOR * sum(seconds for seconds, _ in clean)
    for name in names:
        function = name.rpartition("__mutmut_")[0]
        reaching = [function in reached for _, reached in clean]
        order = sorted(range(len(clean)), key=lambda i: (not reaching[i], clean[i][0]))
        end = with_change(session, name, order, limit)
        ends[name] = UNREACHED if end == SURVIVED and not any(reaching) else end
        found.write_text(json.dumps(ends), encoding="utf-8")
    return True


def without_change(session: pytest.Session) -> list[tuple[float, list[str]]] | None:
    """Run all tests as they are: the seconds and the functions of each; None where one fails."""
    silence()
    os.environ["MUTANT_UNDER_TEST"] = "stats"
    seen: set[str] = set()
    trampoline.record_trampoline_hit = lambda name, **_: seen.add(name)
    told = []
    for i, item in enumerate(session.items):
        seen.clear()
        started = time.process_time()
        protocol(session, item, session.items[i + 1] if i + 1 < len(session.items) else None)
        if session.testsfailed:
            return None
        told.append((time.process_time() - started, sorted(seen)))
    return told


def with_change(session: pytest.Session, name: str, order: list[int], limit: float) -> str:
    child = os.fork()
    if child == 0:
        silence()
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        os.environ["MUTANT_UNDER_TEST"] = name
        items = [session.items[i] for i in order]
        try:
            for item, following in zip(items, [*items[1:], None], strict=True):
                protocol(session, item, following)
                if session.testsfailed:
                    os._exit(1)
        except BaseException:
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return ENDLESS if os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL) else NOTICED
    return SURVIVED if os.WEXITSTATUS(status) == 0 else NOTICED


def protocol(session: pytest.Session, item: pytest.Item, following: pytest.Item | None) -> None:
    session.config.hook.pytest_runtest_protocol(item=item, nextitem=following)


def silence() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
