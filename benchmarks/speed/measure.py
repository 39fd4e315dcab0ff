"""Clocks and meters: CPU time of this process, peak memory and import time of fresh ones."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median


def cpu_seconds(work: Callable[[], object], *, least: float = 0.3, runs: int = 7) -> float:
    """Return the median CPU time of a call; one call is left out, to warm up."""
    work()
    times: list[float] = []
    while len(times) < 2 or (len(times) < runs and sum(times) < least):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return median(times)


def once(work: Callable[[], object]) -> float:
    """Return the CPU time of a single call, for baselines that take seconds."""
    start = time.process_time()
    work()
    return time.process_time() - start


def peak_megabytes(setup: str, work: str) -> float:
    """Return the peak memory of `work` in a fresh process above what is held after `setup`.

    Resident memory of the process, temporaries of the FFT included (Linux).
    """
    code = (
        "import os, resource\n"
        "import benchmarks.speed\n"
        f"{setup}\n"
        "held = int(open('/proc/self/statm').read().split()[1]) * os.sysconf('SC_PAGE_SIZE')\n"
        f"{work}\n"
        "print(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return int(done.stdout.split()[-1]) / 1e6


def import_seconds(module: str, *, runs: int = 5) -> float:
    """Return the least CPU time of importing a module in a fresh process."""
    times = []
    for _ in range(runs + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", f"import {module}"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return min(times[1:])


@dataclass(frozen=True)
class Line:
    """One line of the table.

    `ratio` is how many times faster, `must` and `aim` are the goals for it,
    as text; `how` says where the baseline's time comes from.
    """

    work: str
    ours: str
    baseline: str
    ratio: float | None
    must: str
    aim: str
    how: str = ""


def seconds(value: float) -> str:
    """Write a time with a fitting unit."""
    if value >= 1:
        return f"{value:.3g} s"
    if value >= 1e-3:
        return f"{1e3 * value:.3g} ms"
    return f"{1e6 * value:.3g} us"
