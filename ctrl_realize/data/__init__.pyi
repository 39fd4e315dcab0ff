# What the module offers, loaded when it is first asked for.

from .frf import MeasuredFRF as MeasuredFRF
from .impulse import FilterSpec as FilterSpec
from .impulse import ImpulseResponse as ImpulseResponse
from .impulse_estimate import ImpulseEstimate as ImpulseEstimate
from .record import Record as Record
from .step import StepEdge as StepEdge
from .step import StepResponse as StepResponse
