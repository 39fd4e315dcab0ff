"""Print the table: ``python -m benchmarks.design``."""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from statistics import median

import control as ct
import numpy as np

import ctrl_realize as cr

from .plants import controller, exact_margins, valve


def cpu_seconds(work: Callable[[], object], runs: int = 5) -> float:
    """Median CPU time of a call; the first is left out where calls are short."""
    start = time.process_time()
    work()
    first = time.process_time() - start
    if first > 5:
        return first
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return median(times)


def margin_rows(delays: list[int]) -> None:
    """Margins: values against root finding on the core, times against python-control."""
    print(
        "\n| margins at d | exact GM / PM | ours | python-control | ours ms | theirs ms | ratio |"
    )
    print("|---|---|---|---|---|---|---|")
    for delay in delays:
        plant, pi = valve(delay), controller()
        gm, pm = exact_margins(delay)
        ours = cr.design.margins(plant, pi)
        augmented = ct.ss(plant) * pi
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                theirs = ct.stability_margins(augmented)[:2]
                words = f"{theirs[0]:.4g} / {theirs[1]:.4g}"
                slow = cpu_seconds(lambda a=augmented: ct.stability_margins(a))
            except (ValueError, np.linalg.LinAlgError, ct.ControlArgument) as error:
                words, slow = type(error).__name__, float("nan")
        fast = cpu_seconds(lambda p=plant, c=pi: cr.design.margins(p, c))
        print(
            f"| {delay} | {gm:.6g} / {pm:.6g} | {ours.gain_margin:.6g} / {ours.phase_margin:.6g} "
            f"| {words} | {1e3 * fast:.3g} | {1e3 * slow:.3g} | {slow / fast:.3g} |",
            flush=True,
        )
        error = max(abs(ours.gain_margin / gm - 1), abs(ours.phase_margin - pm))
        if error > 1e-6:
            raise SystemExit(f"margins at d={delay} are off by {error:.2g}")


def regulator_rows(delays: list[int]) -> None:
    """State feedback: gains and times against dlqr of the augmented system."""
    print("\n| LQR at d | largest relative difference | ours ms | dlqr ms | ratio |")
    print("|---|---|---|---|---|")
    for delay in delays:
        plant = cr.delayed_ss(cr.design.reduce(valve(0), 3).delay_free, delay)
        weight = np.zeros((plant.nstates, plant.nstates))
        weight[:3, :3] = np.eye(3)
        fast = cpu_seconds(lambda p=plant: cr.design.predictor_lqr(p, np.eye(3), 1.0))
        if delay > 300:
            print(f"| {delay} | - | {1e3 * fast:.3g} | - | - |", flush=True)
            continue
        big = ct.dlqr(plant.A, plant.B, weight, 1.0)[0]
        slow = cpu_seconds(lambda p=plant, w=weight: ct.dlqr(p.A, p.B, w, 1.0), runs=1)
        found = cr.design.predictor_lqr(plant, np.eye(3), 1.0).gain
        off = np.abs(found - big).max() / np.abs(big).max()
        print(
            f"| {delay} | {off:.1e} | {1e3 * fast:.3g} | {1e3 * slow:.3g} | {slow / fast:.3g} |",
            flush=True,
        )


def main() -> None:
    """Run the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--delays", type=int, nargs="*", default=[0, 37, 100, 300])
    options = parser.parse_args()
    print(
        f"CPU time, one BLAS thread, python-control {ct.__version__} "
        f"{'with' if ct.exception.slycot_check() else 'without'} slycot."
    )
    margin_rows(options.delays)
    regulator_rows([*(d for d in options.delays if d <= 300), 1000])


if __name__ == "__main__":
    main()
