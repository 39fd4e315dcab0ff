"""Evaluation of a curve of IAE over delay: minimum, flatness, warnings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._flags import Flag, flagged
from ...numerics.arrays import FloatArray, runs
from .scan_surface import Surface

FLAT = 1.05
"""IAE relative to the smallest, up to which delays count as equally good."""

CONTRAST = 1.3
"""IAE without delay relative to the smallest, below which no delay is resolved."""

NOISE_CAUTION = 3.0
NOISE_REFUSE = 1.3
"""Last singular value relative to that of the noise: above 3 the scan works, below 1.3 it follows
the noise (paper scan on simulated valves: errors of 3-5 samples between, 10 and more below)."""


def best_delay(iae: FloatArray, rounding: float) -> int:
    """Return the smallest delay whose IAE equals the minimum up to rounding.

    Exact data of a strictly proper plant are fitted exactly by two delays; the choice between them
    must not depend on rounding.
    """
    return int(np.flatnonzero(iae <= iae.min() + rounding)[0])


def flat_set(iae: FloatArray, delay: int, rounding: float) -> tuple[int, int]:
    """Return the smallest and largest delay within 5 % of the smallest IAE."""
    flat = np.flatnonzero(iae <= FLAT * iae[delay] + rounding)
    return int(flat[0]), int(flat[-1])


def scan_flags(surface: Surface, order: int) -> Iterator[Flag]:
    """List the flags that follow from the curve of one order, and from the noise."""
    iae, rounding = surface.iae[surface.orders.index(order)], surface.rounding
    delay, last = best_delay(iae, rounding), iae.size - 1
    least = float(iae[delay])
    contrast = float(iae[0]) / least if least > 0 else np.inf
    low, high = flat_set(iae, delay, rounding)
    if high == last and last > 0:
        best = "the best delay is" if delay == last else "delays that fit equally well reach up to"
        yield flagged("delay_at_bound.scan", best=best, max_delay=last)
    if contrast < CONTRAST:
        yield flagged("no_delay_resolved.scan", contrast=contrast, delay=delay)
    # separate minima within 5 % of the smallest IAE
    minima = len(runs(iae <= FLAT * iae[delay] + rounding)[0])
    if minima > 1:
        yield flagged("several_minima", minima=minima, low=low, high=high)
    floor = surface.noise_floor
    ratio = float(surface.singular_values[delay, order - 1]) / floor if floor else np.inf
    if ratio < NOISE_REFUSE:
        yield flagged("order_in_noise", order=order, ratio=ratio)
    elif ratio < NOISE_CAUTION:
        yield flagged("order_near_noise", order=order, ratio=ratio)
