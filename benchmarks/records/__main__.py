"""Print a table of speeds, each a ratio to a named baseline: ``python -m benchmarks.records``.

Data are simulated; CPU time of the process, one call each. ``python -m benchmarks.records
measured`` prints how well halves of measured records are simulated, beside rivals, and
``responses`` what measured frequency responses gave, ``joint`` what they gave with step records,
``several`` what several records of a plant give together, ``kinds`` tests of several kinds,
``lags`` and ``lags_of_inputs`` plants of very many lags, ``statements`` what it gains to state a
fastest lag.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import control as ct
import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr

from . import joint, kinds, many_lags, measured, responses, several, statements


def cpu(work: Callable[[], object]) -> float:
    """Return the CPU time of one call in s."""
    start = time.process_time()
    work()
    return time.process_time() - start


def record(n: int) -> cr.Record:
    """Make a record of white input and 10 % output noise."""
    rng = np.random.default_rng(0)
    u = rng.standard_normal(n)
    y = lfilter([0.0] * 20 + [0.02], [1, -0.98], u)
    return cr.Record(0.01 * np.arange(n), u, y + 0.1 * y.std() * rng.standard_normal(n))


def dense_least_squares(data: cr.Record, lags: int) -> np.ndarray:
    """Solve the regression with its matrix in memory (the baseline)."""
    rows = np.lib.stride_tricks.sliding_window_view(data.input, lags)[:, ::-1]
    phi = np.column_stack([rows, np.ones(len(rows))])
    return np.linalg.lstsq(phi, data.output[lags - 1 :], rcond=None)[0]


def recursive_bank(data: cr.Record, delays: int, forgetting: float) -> np.ndarray:
    """Track gain and offset by recursive least squares for every delay (the baseline)."""
    theta, P = np.zeros((delays, 2)), np.tile(1e6 * np.eye(2), (delays, 1, 1))
    u, phi = np.concatenate([np.zeros(delays), data.input]), np.ones((delays, 2))
    for k, y in enumerate(data.output):
        phi[:, 0] = u[k + 1 : k + delays + 1][::-1]
        gain = np.einsum("dij,dj->di", P, phi)
        gain /= forgetting + np.einsum("di,di->d", gain, phi)[:, None]
        theta += gain * (y - np.einsum("di,di->d", phi, theta))[:, None]
        P = (P - gain[:, :, None] * np.einsum("di,dij->dj", phi, P)[:, None, :]) / forgetting
    return theta


def main() -> None:
    """Time and print."""
    long = record(100_000)
    dense = cpu(lambda: dense_least_squares(long, 300))
    ours = cpu(lambda: cr.impulse_from_io(long, 300, method="least_squares"))
    print(f"least squares, 1e5 samples, 300 lags: {ours:.2f} s, {dense / ours:.0f}x the dense one")
    for kernel in ("TC", "SS"):
        spent = cpu(
            lambda kernel=kernel: cr.impulse_from_io(
                long, 1000, method="regularized", kernel=kernel
            )
        )
        print(f"{kernel} kernel, 1e5 samples, 1000 lags, hyper-parameters found: {spent:.2f} s")
    short = record(5000)
    core = ct.ss([[0.98]], [[1.0]], [[0.02]], [[0.0]], 0.01)
    tracker = cr.DelayTracker(core, max_delay=100, forgetting_time=10.0)
    ours = cpu(lambda: tracker.track(short)) / short.n_samples
    bank = cpu(lambda: recursive_bank(short, 101, 0.999)) / short.n_samples
    print(
        f"tracker, 101 delays with gain, offset and a pole: {1e6 * ours:.0f} us a sample; "
        f"{bank / ours:.1f}x a vectorised bank of RLS with gain and offset"
    )


if __name__ == "__main__":
    tables = {
        "measured": measured.table,
        "responses": responses.table,
        "joint": joint.table,
        "kinds": kinds.table,
        "lags": many_lags.table,
        "lags_of_inputs": many_lags.table_of_inputs,
        "several": several.table,
        "statements": statements.table,
    }
    asked = [tables[word] for word in sys.argv[1:] if word in tables]
    for made in asked:
        print(made())
    if not asked:
        main()
