"""Systems that carry a dead time."""

from .factory import delayed_ss as delayed_ss
from .system import DelayedStateSpace as DelayedStateSpace
from .system import fit_of as fit_of
