"""Measured data: records, step and impulse responses, frequency responses."""

from .frf import MeasuredFRF
from .impulse import FilterSpec, ImpulseResponse
from .impulse_estimate import ImpulseEstimate
from .record import Record
from .step import StepEdge, StepResponse

__all__ = [
    "FilterSpec",
    "ImpulseEstimate",
    "ImpulseResponse",
    "MeasuredFRF",
    "Record",
    "StepEdge",
    "StepResponse",
]


def __dir__() -> list[str]:
    return __all__
