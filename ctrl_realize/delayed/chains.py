"""Shift registers for whole-sample delays, attached to the matrices of a core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._checks import integer
from ..errors import DelayRangeError, OptionError
from ..numerics.arrays import ComplexArray, FloatArray, whole_power

ON_CIRCLE = 1 - 1e-12
"""Magnitude from which on a point counts as one on the unit circle."""

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def parse_delays(given: int | Sequence[int], count: int, name: str, side: str) -> tuple[int, ...]:
    """Return one whole number of samples for each of `count` signals."""
    values = [given] * count if isinstance(given, int) or np.ndim(given) == 0 else list(given)
    if len(values) != count:
        raise DelayRangeError(f"{name}={given!r}; the core has {count} {side}(s)")
    try:
        return tuple(integer(value, name, 0) for value in values)
    except OptionError as error:
        raise DelayRangeError(f"{error}; for a fractional dead time see delayed_ss") from None


def chain_labels(
    inputs: Sequence[str],
    outputs: Sequence[str],
    before: tuple[int, ...],
    behind: tuple[int, ...],
) -> list[str]:
    """Name the states of the chains: u[k-1] ... and, for outputs before their delay, y*[k-1]."""
    labels = [f"{u}[k-{i}]" for u, d in zip(inputs, before, strict=True) for i in range(1, d + 1)]
    labels += [
        f"{y}*[k-{i}]" for y, q in zip(outputs, behind, strict=True) for i in range(1, q + 1)
    ]
    return labels


def augment(core: Matrices, before: tuple[int, ...], behind: tuple[int, ...]) -> Matrices:
    """Join core and chains; states [core; u[k-1] ... u[k-d]; y[k-1] ... y[k-q]]."""
    core_A, core_B, core_C, core_D = core
    n, m = core_B.shape
    p = core_C.shape[0]
    size = n + sum(before) + sum(behind)
    A, B = np.zeros((size, size)), np.zeros((size, m))
    C, D = np.zeros((p, size)), np.zeros((p, m))
    A[:n, :n] = core_A
    C[:, :n] = core_C
    at = n
    for j, d in enumerate(before):
        if d == 0:
            B[:n, j], D[:, j] = core_B[:, j], core_D[:, j]
            continue
        B[at, j] = 1.0
        A[np.arange(at + 1, at + d), np.arange(at, at + d - 1)] = 1.0
        A[:n, at + d - 1], C[:, at + d - 1] = core_B[:, j], core_D[:, j]
        at += d
    for i, q in enumerate(behind):
        if q == 0:
            continue
        A[at], B[at] = C[i], D[i]
        A[np.arange(at + 1, at + q), np.arange(at, at + q - 1)] = 1.0
        C[i], D[i] = 0.0, 0.0
        C[i, at + q - 1] = 1.0
        at += q
    return A, B, C, D


def powers(points: ComplexArray, delays: tuple[int, ...]) -> ComplexArray:
    """Stack x^-d for each delay, shape (delays, K)."""
    if np.all(np.abs(points) >= ON_CIRCLE):
        return np.stack([whole_power(1 / points, d) for d in delays])
    return np.stack([points ** (-d) for d in delays])
