"""Errors and warnings of the toolbox.

Every error derives from `CtrlRealizeError` and from the corresponding builtin exception. Errors are
raised if there is no answer, warnings if the answer needs attention.
"""

from __future__ import annotations

import sys
import warnings

__all__ = [
    "CtrlRealizeError", "CtrlRealizeWarning", "DataError", "DataWarning", "DelayRangeError",
    "FileFormatError", "MissingFileError", "MissingPackageError", "ModelWarning", "NoStepError",
    "OptionError", "OrderError", "TimeAxisError", "UnresolvedWarning", "UnsuitableSystemError",
]  # fmt: skip

_INSIDE = ("ctrl_realize", "control", "contextlib")
"""Modules whose frames are skipped when a warning is attributed to a line of the caller."""


class CtrlRealizeError(Exception):
    """Base class of all errors of this toolbox."""


class DataError(CtrlRealizeError, ValueError):
    """The data cannot be used: wrong shape, not finite, too short, or constant."""


class TimeAxisError(DataError):
    """The time axis is not uniform, or not increasing."""


class NoStepError(DataError):
    """The record contains no step."""


class OrderError(CtrlRealizeError, ValueError):
    """The requested model order does not fit the data."""


class DelayRangeError(CtrlRealizeError, ValueError):
    """The requested delay or range of delays does not fit the data."""


class OptionError(CtrlRealizeError, ValueError):
    """An argument has an invalid value."""


class UnsuitableSystemError(CtrlRealizeError, ValueError):
    """The function cannot handle this kind of system."""


class FileFormatError(CtrlRealizeError, ValueError):
    """The content of the file is not as expected."""


class MissingFileError(CtrlRealizeError, FileNotFoundError):
    """The file does not exist."""


class MissingPackageError(CtrlRealizeError, ImportError):
    """An optional package is needed that is not installed."""


class CtrlRealizeWarning(UserWarning):
    """Base class of all warnings of this toolbox."""


class DataWarning(CtrlRealizeWarning):
    """Only part of the data could be used."""


class ModelWarning(CtrlRealizeWarning):
    """The model has a property that affects its use."""


class UnresolvedWarning(ModelWarning):
    """The record does not determine a quantity that the design relies on."""


def warn_caller(message: str, category: type[Warning] = DataWarning) -> None:
    """Warn at the line that called this toolbox, directly or through python-control.

    Parameters
    ----------
    message : str
    category : type of Warning

    Examples
    --------
    >>> from ctrl_realize.errors import DataWarning, warn_caller
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     warn_caller("half of it is missing", DataWarning)
    >>> print(caught[0].message)
    half of it is missing
    """
    level, frame = 2, sys._getframe(1)
    while frame.f_back and frame.f_globals.get("__name__", "").split(".")[0] in _INSIDE:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level)


def __dir__() -> list[str]:
    return __all__
