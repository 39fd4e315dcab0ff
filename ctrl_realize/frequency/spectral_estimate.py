"""Arguments and result of an estimate from spectra."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from ..numerics.arrays import ComplexArray, FloatArray

Stream: TypeAlias = Iterator[tuple[FloatArray, FloatArray, float]]
"""Input (m, N), output (p, N) and sample time of each record."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated frequency response, at increasing frequencies.

    ``response``, ``coherence`` and ``std`` have the shape (K,), or (p, m, K) with several channels;
    ``std`` is estimated from ``repeats``.
    """

    frequency_hz: FloatArray
    response: ComplexArray
    coherence: FloatArray
    std: FloatArray
    repeats: float
