"""Does a local minimum ever win? Search from the usual starts against a start at the truth."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed

from ctrl_realize.numerics.engine.descend import fit_batch
from ctrl_realize.numerics.engine.modal import parameters_from_poles
from ctrl_realize.numerics.engine.problem import KnownFactor, Structure
from ctrl_realize.numerics.engine.structures import parameter_bounds, search
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window

from . import plants

EQUAL = 1e-3
"""Relative excess of cost up to which two optima are taken for one."""


def missed(name: str, noise: float, seed: int) -> bool:
    """Tell whether a start at the truth finds a better optimum than the search does."""
    plant = {**plants.RIGS, **plants.FACTORIAL}[name]
    structure = Structure(len(plant.poles()), len(plant.poles()))
    record, truth = plants.record(plant, noise, seed)
    data = step_data(record.output, record.input, record.dt, [(plants.BEFORE, 1)])
    problem = window(data, data.output.size, KnownFactor()).problem
    scales = step_scales(data, data.output.size, None)
    # The frequency that stands out is found from a first fit; here none is told to the search.
    found = search(problem, [structure], replace(scales, ringing=0.0))[structure]
    start = np.concatenate([[truth * record.dt], parameters_from_poles(plant.poles() + 0j)])
    box = parameter_bounds(structure, scales)
    _, cost = fit_batch(problem, structure, start[None], box, most_iterations=100)
    return bool(found.cost > cost[0] * (1 + EQUAL))


def starts_table(seeds: int, jobs: int) -> list[str]:
    """Tabulate how often the search misses the optimum near the truth."""
    lines = ["| plant | noise | records | better optimum near the truth |", "|---|---|---|---|"]
    for name in ("R1", "R2", "R3", "R4", "underdamped"):
        for noise in (0.001, 0.01):
            work = functools.partial(missed, name, noise)
            count = sum(Parallel(n_jobs=jobs)(delayed(work)(k) for k in range(seeds)))
            lines.append(f"| {name} | {100 * noise:g} % | {seeds} | {count} |")
    return lines
