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


def scan_curve(surface: Surface, order: int) -> tuple[FloatArray, int, tuple[int, int]]:
    """IAE of one order for all delays, the best delay, and the ends of those within 5 % of its IAE.

    The best is the smallest delay whose IAE equals the minimum up to rounding: exact data of a
    strictly proper plant are fitted exactly by two delays, and the choice between them must not
    depend on rounding.
    """
    iae = surface.iae[surface.orders.index(order)]
    best = int(np.flatnonzero(iae <= iae.min() + surface.rounding)[0])
    flat = np.flatnonzero(iae <= FLAT * iae[best] + surface.rounding)
    return iae, best, (int(flat[0]), int(flat[-1]))


def scan_flags(surface: Surface, order: int) -> Iterator[Flag]:
    """List the flags that follow from the curve of one order, and from the noise."""
    iae, delay, (low, high) = scan_curve(surface, order)
    last, least = iae.size - 1, float(iae[delay])
    contrast = float(iae[0]) / least if least > 0 else np.inf
    if high == last and last > 0:
        best = "the best delay is" if delay == last else "delays that fit equally well reach up to"
        yield flagged("delay_at_bound.scan", best=best, max_delay=last)
    if contrast < CONTRAST:
        yield flagged("no_delay_resolved.scan", contrast=contrast, delay=delay)
    # separate minima within 5 % of the smallest IAE
    minima = len(runs(iae <= FLAT * iae[delay] + surface.rounding)[0])
    if minima > 1:
        yield flagged("several_minima", minima=minima, low=low, high=high)
    floor = surface.noise_floor
    ratio = float(surface.singular_values[delay, order - 1]) / floor if floor else np.inf
    if ratio < NOISE_REFUSE:
        yield flagged("order_in_noise", order=order, ratio=ratio)
    elif ratio < NOISE_CAUTION:
        yield flagged("order_near_noise", order=order, ratio=ratio)
