"""Controllers and models for other programs: PLC, C, Python, MATLAB, FMI."""

from .code import to_c, to_python, to_structured_text
from .fmu import to_fmu
from .matlab import to_matlab

__all__ = ["to_c", "to_fmu", "to_matlab", "to_python", "to_structured_text"]


def __dir__() -> list[str]:
    return __all__
