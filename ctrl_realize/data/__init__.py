"""What is measured: records, step and impulse responses, frequency responses."""

from .frf import MeasuredFRF as MeasuredFRF
from .impulse import FilterSpec as FilterSpec
from .impulse import ImpulseResponse as ImpulseResponse
from .impulse_estimate import ImpulseEstimate as ImpulseEstimate
from .record import Record as Record
from .step import StepEdge as StepEdge
from .step import StepResponse as StepResponse

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
