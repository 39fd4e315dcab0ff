"""Shift registers for whole-sample delays, attached to the matrices of a core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._checks import integer
from ..errors import DelayRangeError, OptionError
from ..numerics.arrays import ComplexArray, Matrices, whole_power
from ..numerics.internal_delays.form import DelayForm, delayed_ends
from ..numerics.internal_delays.recurrence import absorbed

ON_CIRCLE = 1 - 1e-12
"""Magnitude from which on a point counts as one on the unit circle."""


def parse_delays(given: int | Sequence[int], count: int, name: str, side: str) -> tuple[int, ...]:
    """Return one whole number of samples for each of `count` signals."""
    values = [given] * count if isinstance(given, int) or np.ndim(given) == 0 else list(given)
    if len(values) != count:
        raise DelayRangeError(f"{name}={given!r}; the core has {count} {side}(s)")
    try:
        return tuple(integer(value, name, 0) for value in values)
    except OptionError as error:
        raise DelayRangeError(f"{error}; for a fractional dead time see delayed_ss") from None


def past_of(signals: Sequence[str], delays: Sequence[float]) -> list[str]:
    """Name the states of delay lines: u[k-1] ... u[k-d] of each signal."""
    each = zip(signals, delays, strict=True)
    return [f"{signal}[k-{i}]" for signal, delay in each for i in range(1, int(delay) + 1)]


def augment(core: Matrices, before: Sequence[int], behind: Sequence[int]) -> Matrices:
    """Join core and chains; states [core; u[k-1] ... u[k-d]; y[k-1] ... y[k-q]]."""
    return with_chains(delayed_ends(DelayForm(*core), before, behind))


def with_chains(form: DelayForm) -> Matrices:
    """Matrices of a discrete system, with a chain of states for every delay."""
    full = absorbed(form, list(range(len(form.delays))))
    return full.A, full.B, full.C, full.D


def powers(points: ComplexArray, delays: tuple[int, ...]) -> ComplexArray:
    """Stack x^-d for each delay, shape (delays, K)."""
    if np.all(np.abs(points) >= ON_CIRCLE):
        return np.stack([whole_power(1 / points, d) for d in delays])
    return np.stack([points ** (-d) for d in delays])
