"""What tests of several kinds of one simulated plant tell together, beside each of them alone.

A step, a relay test of four cycles, a random binary signal and an up-and-down staircase, all of the
same amplitude about one operating point; noise is in % of the response to the step.
"""

from __future__ import annotations

import platform
import warnings
from collections import defaultdict
from datetime import date

import numpy as np

import ctrl_realize as cr
from benchmarks.relay.__main__ import AMPLITUDE, plant

PLANTS = ("a quarter of a lag", "two lags", "twice a lag")
NOISES = {"white": (2.0, 0.0, 1.0), "slow": (0.5, 2.0, 5.0)}
"""White noise and slow disturbance in % of the step response, and the disturbance's time in s."""
KINDS = ("step", "relay", "random binary", "staircase")
SEEDS = 10
_SAMPLES = 480  # of the inputs that are not a relay's: 240 s


def inputs(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Held inputs of the three tests that are not made by a relay, in %."""
    k = np.arange(_SAMPLES)
    binary = np.repeat(rng.choice([-1.0, 1.0], _SAMPLES // 20), 20)
    stairs = np.select([k < 60, k < 180, k < 300], [0.0, 1.0, -1.0], 0.0)
    shapes = {"step": np.where(k < 60, 0.0, 1.0), "random binary": binary, "staircase": stairs}
    return {name: 50.0 + AMPLITUDE * shape for name, shape in shapes.items()}


def tests_of(name: str, noise: str, seed: int) -> dict[str, cr.Record]:
    """Records of one plant."""
    rng = np.random.default_rng(seed)
    clean = plant(name, 0.0, 0.0, 1.0)
    per_cent = abs(clean.truth.gain) * AMPLITUDE / 100
    white, slow, time = NOISES[noise]
    noisy = plant(name, white * per_cent, slow * per_cent, time)
    found = {kind: noisy.record(u, rng, name=kind) for kind, u in inputs(rng).items()}
    hysteresis = 3 * np.hypot(white, slow) * per_cent
    test = cr.bench.relay_test(noisy, cycles=4, amplitude=AMPLITUDE, hysteresis=hysteresis, rng=rng)
    return {kind: test if kind == "relay" else found[kind] for kind in KINDS}


def judged(name: str, noise: str, seed: int) -> dict[str, tuple[float, bool, float, bool]]:
    """Error and width of the dead time in samples, and whether its interval and the gain's hold."""
    records = tests_of(name, noise, seed)
    truth = plant(name, 0.0, 0.0, 1.0).truth
    found = {}
    for kind, data in (*records.items(), ("all four", list(records.values()))):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = cr.identify(data).fit
        low, high = fit.interval
        true = truth.dead_time
        least, most = fit.gain_interval
        found[kind] = (
            (fit.dead_time - true) / fit.dt,
            bool(low <= true <= high),
            (high - low) / fit.dt,
            bool(least <= truth.gain <= most),
        )
    return found


def table() -> str:
    """Make the table in Markdown."""
    rows: dict[tuple[str, str], list[tuple[float, bool, float, bool]]] = defaultdict(list)
    for noise in NOISES:
        for name in PLANTS:
            for seed in range(SEEDS):
                for kind, row in judged(name, noise, seed).items():
                    rows[noise, kind].append(row)
    lines = [
        "| noise | test | rms error of the dead time | its interval holds | median width | "
        "interval of the gain holds |",
        "|" + "---|" * 6,
    ]
    for (noise, kind), found in rows.items():
        errors, holds, widths, gains = (np.array(column) for column in zip(*found, strict=True))
        lines.append(
            f"| {noise} | {kind} | {np.sqrt(np.mean(errors**2)):.2f} | {holds.sum()} of "
            f"{holds.size} | {np.median(widths):.1f} | {gains.sum()} of {gains.size} |"
        )
    lines += [
        "",
        f"Made on {date.today()} by `python -m benchmarks.records kinds` (dead times in samples; "
        f"{len(PLANTS)} simulated plants, {SEEDS} seeds each) with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}.",
        "",
    ]
    return "\n".join(lines)
