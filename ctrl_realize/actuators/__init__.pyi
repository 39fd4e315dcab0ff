# What the module offers, loaded when it is first asked for.

from .base import Actuator as Actuator
from .base import Series as Series
from .characteristic import Characteristic as Characteristic
from .limits import Backlash as Backlash
from .limits import DeadZone as DeadZone
from .limits import Resolution as Resolution
from .limits import Saturation as Saturation
from .limits import SlewRateLimit as SlewRateLimit
from .stiction import KanoStiction as KanoStiction
from .stiction import Stiction as Stiction
