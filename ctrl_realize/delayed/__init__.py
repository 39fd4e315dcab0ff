"""Systems with dead time."""

from .factory import delayed_ss as delayed_ss
from .inside.pure import delay as delay
from .inside.pure import exp as exp
from .inside.system import DelaySystem as DelaySystem
from .joined import interconnect as interconnect
from .system import DelayedStateSpace as DelayedStateSpace
from .system import fit_of as fit_of
