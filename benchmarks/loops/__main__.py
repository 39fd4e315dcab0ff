"""Print the table of closed loops and write it for the docs: ``python -m benchmarks.loops``.

Both sides are timed in one run: a `DelaySystem`, and the same loop as python-control makes it of
the augmented matrices, where those can be made.
"""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import control as ct
import numpy as np

import ctrl_realize as cr

from ..speed.__main__ import conditions
from ..speed.measure import cpu_seconds, once, seconds
from ..speed.rigs import TS, valve

TABLE = Path(__file__).resolve().parents[2] / "docs" / "tables" / "loops_table.md"
DELAYS = (37, 300, 1000, 10_000)
LARGEST = 1000
"""Samples up to which python-control is asked: the matrix of 10 000 states takes hours."""
POINTS, SAMPLES = 500, 4000


def main() -> None:
    """Time the loops."""
    pi = ct.ss([[1.0]], [[1.0]], [[0.5 * TS / 0.2]], [[0.5]], TS)
    points = np.exp(1j * TS * np.geomspace(0.1, 0.99 * np.pi / TS, POINTS))
    time = TS * np.arange(SAMPLES)
    lines = [
        conditions(),
        "",
        "| closed loop of valve and PI controller | d | ours | python-control | ratio |",
        "|---|---|---|---|---|",
    ]

    def line(work: str, d: int, fast: float, slow: float | None) -> None:
        cells = seconds(fast), "-" if slow is None else seconds(slow)
        ratio = "" if slow is None else _ratio(slow / fast)
        lines.append(f"| {work} | {d} | {cells[0]} | {cells[1]} | {ratio} |")
        print(lines[-1], flush=True)

    for d in DELAYS:
        loop = ct.feedback(cr.delayed_ss(valve(), d, dt=TS) * pi)
        plain = None
        if d <= LARGEST:
            full = cr.delayed_ss(valve(), d, dt=TS)
            plain = ct.feedback(ct.StateSpace(full.A, full.B, full.C, full.D, TS) * pi)
        part = 500 // (1 if d < 300 else 25)
        slow = None if plain is None else once(lambda p=plain, k=part: p(points[:k]))
        slow = None if slow is None else slow * POINTS / part
        line(f"frequency response, {POINTS} points", d, cpu_seconds(lambda s=loop: s(points)), slow)
        slow = None if plain is None else once(lambda p=plain: ct.step_response(p, time))
        fast = cpu_seconds(lambda s=loop: s.step_response(time))
        line(f"step response, {SAMPLES} samples", d, fast, slow)
        slow = None if plain is None else once(plain.poles)
        line("ten dominant poles", d, cpu_seconds(loop.dominant_poles), slow)
        tracemalloc.start()
        made = ct.feedback(cr.delayed_ss(valve(), d, dt=TS) * pi)
        made(points)
        made.step(SAMPLES)
        made.dominant_poles()
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        needed = "-" if plain is None else f"{8e-6 * (d + 4) ** 2:.3g} MB for A"
        lines.append(f"| peak memory of all three | {d} | {peak:.2g} MB | {needed} | |")
        print(lines[-1], flush=True)
    TABLE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _ratio(value: float) -> str:
    return f"{value:.2g}" if value < 10 else f"{value:,.0f}".replace(",", " ")


if __name__ == "__main__":
    main()
