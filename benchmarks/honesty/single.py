"""fit_output_error of one step record as it comes: the main study."""

from __future__ import annotations

import ctrl_realize as cr

from .trial import Seen, inside, quietly
from .worlds import DT, NOISES, PLANTS, WRONG, step_case

STRUCTURES = {"R1": (1, 1), "R2": (2, 2), "R3": (3, 3), "R4": (4, 4)}
DOUBTS = (
    "structured_misfit",
    "structures_disagree",
    "no_delay_resolved",
    "many_lags",
    "dispersed_flow",
    "delay_at_bound",
)
"""Flags that tell the reader not to trust the interval's middle."""


def fit_once(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Fit one record with the defaults."""
    case = step_case(kind, plant, noise, seed)
    truth = case.delay * DT
    with quietly():
        try:
            fit = cr.fit_output_error(case.record).fit
        except cr.CtrlRealizeError as error:
            return Seen("fit", kind, plant, noise, seed, failed=str(error))
    reach = 1.96 * fit.std_given_structure
    near = (fit.dead_time - reach, fit.dead_time + reach)
    covered = {"interval": inside(fit.interval, truth), "std": inside(near, truth)}
    rows = {(row.order, row.relative_degree): row for row in fit.structures}
    own = rows.get(STRUCTURES.get(plant, (0, 0)))
    if own is not None and own.interval is not None:
        covered["own structure"] = inside(own.interval, truth)
    flags = [flag.code for flag in fit.flags]
    numbers = {
        "error": fit.delay - case.delay,
        "width": (fit.interval[1] - fit.interval[0]) / DT,
        "early": float(truth < fit.interval[0]),
        "late": float(truth > fit.interval[1]),
        "noise level": float(fit.at_noise_level),
        "silent miss": float(not covered["interval"] and not set(flags) & set(DOUBTS)),
    }
    return Seen("fit", kind, plant, noise, seed, covered, numbers, flags)


def cell(kind: str, seed: int) -> tuple[str, float]:
    """Plant and noise level of a seed: every 16 (24) seeds hold every pair once."""
    plants = WRONG if kind == "wrong structure" else tuple(PLANTS)
    return plants[seed % len(plants)], NOISES[seed // len(plants) % len(NOISES)]
