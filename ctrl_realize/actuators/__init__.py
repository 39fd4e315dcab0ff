"""Models of what actuators do that no linear model says: stiction, backlash, slew limits.

Each is a frozen record of its parameters; it simulates a command, and becomes a system of
python-control, so that control loops with it can be simulated.

Examples
--------
>>> import ctrl_realize as cr
>>> sticking = cr.actuators.Stiction(S=4.0, J=2.0)
>>> sticking.simulate([50, 52, 54, 56]).tolist()
[50.0, 50.0, 50.0, 55.0]
>>> sticking.nlsys(0.1).nstates
7
"""

# Loaded on demand, as the names of the package itself; the stub beside this file lists them.
import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
