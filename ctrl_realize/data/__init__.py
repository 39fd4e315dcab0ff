"""What is measured: records, step and impulse responses, frequency responses."""

from .frf import MeasuredFRF as MeasuredFRF
from .impulse import FilterSpec as FilterSpec
from .impulse import ImpulseResponse as ImpulseResponse
from .record import Record as Record
from .step import StepEdge as StepEdge
from .step import StepResponse as StepResponse
