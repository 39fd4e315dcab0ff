# What the module offers, loaded when it is first asked for.

from .definitions import DEFINITIONS as DEFINITIONS
from .definitions import Definition as Definition
from .evaluate import valve_report as valve_report
from .groups import Interval as Interval
from .groups import SizeAndDirection as SizeAndDirection
from .limits import EXAMPLE_LIMITS as EXAMPLE_LIMITS
from .limits import ExampleLimits as ExampleLimits
from .loops.diagnose import diagnose_loop as diagnose_loop
from .loops.methods import LoopMethod as LoopMethod
from .loops.result import LoopDiagnosis as LoopDiagnosis
from .metrics import Metric as Metric
from .part import TestPart as TestPart
from .parts import split_test as split_test
from .plan import ValveTestPlan as ValveTestPlan
from .planning import valve_test_plan as valve_test_plan
from .result import ValveReport as ValveReport
from .statics import StaticCurve as StaticCurve
from .steps import Ranges as Ranges
from .steps import StepMetrics as StepMetrics
