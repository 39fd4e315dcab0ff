"""Computations of the demo: the paper from start to end on the simulated valve."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import control as ct
import numpy as np

from .. import bench, paper
from ..data import MeasuredFRF, Record
from ..delayed import DelayedStateSpace, fit_of
from ..errors import DataError
from ..frequency import FRFComparison, compare_frf, stepped_sine_frf
from ..identification.campaign.campaign import Campaign
from ..identification.campaign.run import identify_campaign
from ..identification.output_error.fit import fit_output_error
from ..identification.realization.result import Realization
from ..valves import ValveReport, valve_report
from .terminal import progress

SHOWN = (
    paper.SETUP.step_sizes_ma.index(paper.SHOWN_RECORD[0]) * paper.SETUP.records_per_size
    + paper.SHOWN_RECORD[1]
    - 1
)
"""Position of the record in the paper's Figs. 3 to 7."""


@dataclass(frozen=True, eq=False)
class DemoResult:
    """Results of the demo; all data are simulated.

    Attributes
    ----------
    valve : Valve
        The simulated set-up, with its true parameters.
    records : tuple of Record
        Forty step records.
    frf : MeasuredFRF
        Stepped sine.
    campaign : Campaign
        The paper's method on every record.
    printed : DelayedStateSpace
        Final model of the paper's method, including the filter's lag.
    unfiltered : FrequencyResponseData
        The same model, with the filter divided out of its frequency response.
    fitted : DelayedStateSpace
        Output-error fit of the record of Figs. 3 to 7. The dead time of this valve differs from
        record to record, so that their mean is the response of none of them.
    comparisons : dict of str to FRFComparison
        Of ``"printed"``, ``"unfiltered"`` and ``"fitted"`` with the stepped sine.
    static : ValveReport
        Linearity and hysteresis, from the static test of section 2.2.
    seconds : float
        Computing time of simulation and identification.
    """

    valve: bench.Valve
    seed: int
    records: tuple[Record, ...]
    frf: MeasuredFRF
    campaign: Campaign
    printed: DelayedStateSpace
    unfiltered: ct.FrequencyResponseData
    fitted: DelayedStateSpace
    comparisons: dict[str, FRFComparison]
    static: ValveReport
    seconds: float


def run_demo(seed: int, jobs: int) -> DemoResult:
    """Simulate and identify everything."""
    steps = iter(progress(_stages(seed, jobs), 5, "demo"))
    results = [result for result in steps if isinstance(result, DemoResult)]
    return results[0]


def _stages(seed: int, jobs: int) -> Iterator[DemoResult | None]:
    """Yield after each stage, for the progress bar; the last one yields the result."""
    start = time.perf_counter()
    rng = np.random.default_rng(seed)
    valve = bench.paper_valve()
    records = valve.step_campaign(rng)
    yield None
    frf = stepped_sine_frf(valve.stepped_sine(rng), name="stepped sine (simulated)")
    yield None
    campaign = identify_campaign(records, method="paper", n_jobs=jobs, progress=False)
    if campaign.failed:
        raise DataError(f"{campaign.failed[0].name}: {campaign.failed[0].error}")
    printed = campaign.system.replace(name="as the paper makes it")
    yield None
    fitted = fit_output_error(records[SHOWN]).replace(name="output-error fit")
    yield None
    unfiltered = _without_filter(printed, frf)
    comparisons = {
        "printed": compare_frf(printed, frf),
        "unfiltered": compare_frf(unfiltered, frf, hold=None),
        "fitted": compare_frf(fitted, frf),
    }
    static = valve_report(
        valve.static_test(rng), command_range=paper.SETUP.current_range,
        travel_range=valve.travel_range, fit=False,
    )  # fmt: skip
    yield DemoResult(
        valve, seed, records, frf, campaign, printed, unfiltered, fitted, comparisons, static,
        time.perf_counter() - start,
    )  # fmt: skip


def _without_filter(system: DelayedStateSpace, frf: MeasuredFRF) -> ct.FrequencyResponseData:
    """Divide the filter in the data out of a model's frequency response."""
    omega = 2 * np.pi * frf.frequency_hz
    response = np.asarray(system(np.exp(1j * omega * system.dt)))
    left = fit_of(system, Realization).impulse.filter
    values = response if left is None else response / left.response(omega)
    return ct.frd(values, omega, smooth=True, name="filter divided out")
