"""Models with dead time from measured responses, as python-control systems.

record = cr.read_record("valve.csv")      # or cr.Record(t, u, y)
sys    = cr.identify(record)              # a control.StateSpace with z^-d
ct.bode_plot([sys, cr.read_frf("frf.csv")])
"""

# Importing everything takes half as long as importing python-control, and most callers need only
# a part: names are loaded when they are first used. The stub beside this file lists them.
from importlib import import_module
from typing import Any

import lazy_loader

__version__ = "0.1.0"

_offered, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Load a name, or tell in which part of the package it is."""
    try:
        return _offered(name)
    except AttributeError as error:
        for part in () if name.startswith("_") else ("design", "plots", "io", "identification"):
            if name in import_module(f"{__name__}.{part}").__all__:
                raise AttributeError(
                    f"ctrl_realize has no {name!r}; did you mean ctrl_realize.{part}.{name}?"
                ) from error
        raise
