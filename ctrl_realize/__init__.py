"""Models with dead time from measured responses, as python-control systems.

record = cr.read_record("valve.csv")      # or cr.Record(t, u, y)
sys    = cr.identify(record)              # a control.StateSpace with z^-d
ct.bode_plot([sys, cr.read_frf("frf.csv")])
"""

# Importing everything takes half as long as importing python-control, and most callers need only
# a part: names are loaded when they are first used. The stub beside this file lists them.
import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
