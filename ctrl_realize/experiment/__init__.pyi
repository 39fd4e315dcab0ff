# What the module offers, loaded when it is first asked for.

from .comparison import Achieved as Achieved
from .comparison import achieved as achieved
from .planning import plan as plan
from .result import ExperimentPlan as ExperimentPlan
from .result import PlannedTest as PlannedTest
