"""Operands of the arithmetic of measured frequency responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import DataError, warn_caller
from ..numerics.arrays import ComplexArray, FloatArray

SAME = 1e-9
"""Relative difference up to which two frequencies count as equal: rounding of unit conversions."""


@dataclass(frozen=True)
class Operand:
    """One operand, with arrays of shape (p, m, K) or (p, m, 1); an exact one has no variance."""

    values: ComplexArray
    variance: FloatArray | None = None
    coherence: FloatArray | None = None
    hold: float | None = None
    repeats: float | None = None
    measured: bool = False

    @property
    def spread(self) -> FloatArray:
        """Variance; zero for an exact operand."""
        return np.zeros(self.values.shape) if self.variance is None else self.variance

    @property
    def is_scalar(self) -> bool:
        """Whether it is a scalar or a single channel, which acts on each entry."""
        return self.values.shape[:2] == (1, 1)


def power(values: ComplexArray) -> FloatArray:
    """Square of the magnitude."""
    return np.asarray(values.real**2 + values.imag**2)


def last_axis(values: Any) -> ComplexArray:
    """Move frequencies from the first axis to the last."""
    return np.moveaxis(values, 0, 2)


def matmul(one: Any, two: Any) -> Any:
    """Multiply matrices at each frequency; a single channel scales all entries."""
    if (1, 1) in (one.shape[:2], two.shape[:2]):
        return one * two
    return np.moveaxis(np.moveaxis(one, 2, 0) @ np.moveaxis(two, 2, 0), 0, 2)


def blocks(one: Any, two: Any, count: int) -> Any:
    """Make block-diagonal matrices of two, at each of `count` frequencies."""
    (p, m), (q, n) = one.shape[:2], two.shape[:2]
    out = np.zeros((p + q, m + n, count), dtype=np.result_type(one, two))
    out[:p, :m], out[p:, m:] = one, two
    return out


def check_shapes(one: Operand, two: Operand, *, same: bool) -> None:
    """Refuse matrices whose shapes do not match."""
    (p, m), (q, n) = one.values.shape[:2], two.values.shape[:2]
    if one.is_scalar or two.is_scalar or ((p, m) == (q, n) if same else m == q):
        return
    how = "a sum needs the same" if same else "a product needs as many inputs as then outputs"
    raise DataError(f"{p} outputs, {m} inputs and {q} outputs, {n} inputs; {how}")


def same_time(one: float, two: float) -> bool:
    """Whether two sample times are equal."""
    return abs(one - two) <= 1e-6 * two


def warn_of_hold(what: str, hold: float) -> None:
    """Warn that a result contains no hold, or two, which its sample time cannot describe."""
    warn_caller(
        f"{what} of measured responses does not contain exactly one hold of {hold:g} s, so "
        "sample_time is dropped; give hold and dt where the result is fitted or compared"
    )


def common_hold(one: Operand, two: Operand, what: str) -> float | None:
    """Hold of a sum: that of all measured operands; an exact path keeps it."""
    holds = [side.hold for side in (one, two) if side.measured]
    known = [hold for hold in holds if hold is not None]
    if known and len(known) == len(holds) and same_time(known[0], known[-1]):
        return known[0]
    if known:
        warn_of_hold(what, known[0])
    return None


def one_hold(one: Operand, two: Operand) -> float | None:
    """Hold of a product: that of one operand."""
    known = [side.hold for side in (one, two) if side.hold is not None]
    if len(known) == 2:
        warn_of_hold("a product", known[0])
        return None
    return known[0] if known else None
