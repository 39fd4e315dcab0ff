"""Systems that carry a dead time."""

from .factory import delayed_ss as delayed_ss
from .system import DelayedStateSpace as DelayedStateSpace
