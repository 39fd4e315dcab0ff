"""Delay scan, order scan and campaign against a loop over python-control."""

from __future__ import annotations

from collections.abc import Iterator

import control as ct
import numpy as np

import ctrl_realize as cr

from .measure import Line, busiest_seconds, cpu_seconds, once, seconds
from .rigs import DELAYS, MAX_DELAY, SAMPLES, pulse, record

BASELINE_DELAYS = (0, 25, 50, 75, 100)
RECORDS = 40

GOALS = {"zero-phase": ("60", "120"), "causal": ("60", "120"), "unfiltered": ("30", "50")}


def baseline_misfit(markov: np.ndarray, delay: int, order: int) -> float:
    """One delay by python-control: dense SVD, simulation, misfit over the window of the scan."""
    data = markov[delay : delay + SAMPLES + 1]
    model, _ = ct.eigensys_realization(data, order, m=SAMPLES // 2, n=SAMPLES // 2)
    window = markov[: SAMPLES + MAX_DELAY + 1]
    count = window.size - delay
    pulse_input = np.zeros(count)
    pulse_input[0] = 1.0
    response = ct.forced_response(model, np.arange(count), pulse_input).outputs
    return float(np.abs(window[:delay]).sum() + np.abs(window[delay:] - response).sum())


def baseline_seconds(markov: np.ndarray, order: int) -> tuple[float, np.ndarray]:
    """Time of the scan by python-control, extrapolated from some delays, and their misfits."""
    misfits: list[float] = []
    times = []
    for d in BASELINE_DELAYS:
        times.append(once(lambda d=d: misfits.append(baseline_misfit(markov, d, order))))
    return min(times) * DELAYS, np.array(misfits)


def ours(impulse: cr.ImpulseResponse, order: int) -> cr.identification.DelayScan:
    """The scan with its model, its flags and all."""
    return cr.estimate_delay(impulse, order, max_delay=MAX_DELAY, samples=SAMPLES).fit


def surface(impulse: cr.ImpulseResponse) -> cr.identification.OrderScan:
    """Orders 1...8."""
    return cr.scan_orders(impulse, 8, max_delay=MAX_DELAY, samples=SAMPLES)


def lines() -> Iterator[Line]:
    """Time everything."""
    how = f"python-control, least of {len(BASELINE_DELAYS)} delays, scaled to {DELAYS}"
    per_record = {}
    for kind in ("clean", "zero-phase", "causal", "unfiltered"):
        impulse = pulse(kind)
        slow, misfits = baseline_seconds(impulse.markov, 3)
        fast = cpu_seconds(lambda impulse=impulse: ours(impulse, 3), least=1.0)
        scan = ours(impulse, 3)
        off = np.abs(scan.iae[list(BASELINE_DELAYS)] - misfits)
        allowed = 1e-11 * np.abs(impulse.markov).sum() + 1e-9 * misfits
        must, aim = GOALS.get(kind, ("", ""))
        note = f"{how}; difference of the curves {float((off / allowed).max()):.2g} of the allowed"
        per_record[kind] = slow, fast
        yield Line(
            f"delay scan, n = {SAMPLES}, {DELAYS} delays, order 3, {kind}",
            seconds(fast), seconds(slow), slow / fast, must, aim, note,
        )  # fmt: skip
        all_orders = cpu_seconds(lambda impulse=impulse: surface(impulse), least=1.0)
        yield Line(
            f"order x delay surface, orders 1...8, {kind}: {all_orders / fast:.2f} x the scan",
            seconds(all_orders), seconds(8 * slow), 8 * slow / all_orders,
            "<= 2 x the scan", "1.5 x", "python-control, eight scans",
        )  # fmt: skip
    yield from campaign(per_record["zero-phase"][0])


def campaign(one_record: float) -> Iterator[Line]:
    """Forty records from their steps to the statistics, on one and on two processes."""
    records = [record(seed, 2e-3) for seed in range(RECORDS)]

    def identify(n_jobs: int, some: list[cr.Record] = records) -> None:
        cr.identify_campaign(some, method="paper", n_jobs=n_jobs, progress=False)

    slow = RECORDS * one_record
    serial = cpu_seconds(lambda: identify(1), runs=3, least=9.0)
    yield Line(
        f"campaign of {RECORDS} records, from the steps to the statistics, serial",
        seconds(serial), seconds(slow), slow / serial,
        "60", "100", f"python-control, the realizations of one record scaled to {RECORDS}",
    )  # fmt: skip
    identify(2, records[:4])  # starts the workers
    busiest, wall = busiest_seconds(lambda: identify(2))
    yield Line(
        f"campaign of {RECORDS} records, two processes, CPU time of the busier one",
        seconds(busiest), seconds(slow), slow / busiest, "100", "190",
        f"python-control, serial; wall time {seconds(wall)} on this machine as it was",
    )  # fmt: skip
