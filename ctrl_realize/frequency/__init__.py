"""Measured frequency responses: estimation, fit, comparison with models."""

from __future__ import annotations

from .compare import compare_frf
from .comparison import FRFComparison
from .fit_frf import fit_frf
from .frf_fit import FRFFit
from .from_frf import impulse_from_frf
from .spectral import spectral_frf
from .stepped_sine import stepped_sine_frf

__all__ = [
    "FRFComparison",
    "FRFFit",
    "compare_frf",
    "fit_frf",
    "impulse_from_frf",
    "spectral_frf",
    "stepped_sine_frf",
]


def __dir__() -> list[str]:
    return __all__
