"""Planned tests: which input tells a dead time, gain or margin most closely, and how closely."""

# Loaded on demand, as the names of the package itself; the stub beside this file lists them.
import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
