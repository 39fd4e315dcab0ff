"""Controllers for plants with dead time, and analysis of the closed loop.

All functions use core and delay separately, so that they are exact at any delay. Results are
`control` systems.
"""

# Loaded on demand, as the names of the package itself; the stub beside this file lists them.
import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
