"""Clocks and meters: CPU time of this process, peak memory and import time of fresh ones."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


def cpu_seconds(work: Callable[[], object], *, least: float = 0.3, runs: int = 15) -> float:
    """Return the least CPU time of several calls; one call is left out, to warm up.

    The least, because other processes take cache and cores away, and never give any.
    """
    work()
    times: list[float] = []
    while len(times) < 2 or (len(times) < runs and sum(times) < least):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def once(work: Callable[[], object]) -> float:
    """Return the CPU time of a single call, for baselines that take seconds."""
    start = time.process_time()
    work()
    return time.process_time() - start


def peak_megabytes(setup: str, work: str) -> float:
    """Return the peak memory of `work` in a fresh process above what is held after `setup`.

    Resident memory of the process, temporaries of the FFT included (Linux).
    """
    # ru_maxrss would still hold the peak of this process: it survives fork and exec.
    code = (
        "import benchmarks.speed\n"
        "def resident(line):\n"
        "    text = open('/proc/self/status').read()\n"
        "    return int(text.split(line + ':')[1].split()[0])\n"
        f"{setup}\n"
        "open('/proc/self/clear_refs', 'w').write('5')\n"
        "held = resident('VmRSS')\n"
        f"{work}\n"
        "print(resident('VmHWM') - held)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return int(done.stdout.split()[-1]) * 1024 / 1e6


def import_seconds(statement: str, *, runs: int = 5) -> float:
    """Return the least CPU time of a fresh process that imports."""
    times = []
    for _ in range(runs + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", statement], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return min(times[1:])


def busiest_seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Return the CPU time of the busiest process of a parallel call, and its wall time (Linux).

    The first is what the call takes on idle cores; on a busy machine the
    wall time says more about the others.
    """
    before, start = _process_seconds(), time.perf_counter()
    work()
    wall = time.perf_counter() - start
    spent = [now - before.get(pid, 0.0) for pid, now in _process_seconds().items()]
    return max(spent), wall


def _process_seconds() -> dict[int, float]:
    """CPU time of this process and of its children."""
    own = os.getpid()
    children = Path(f"/proc/{own}/task/{own}/children").read_text().split()
    seconds = {own: time.process_time()}
    for pid in children:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        seconds[int(pid)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return seconds


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
