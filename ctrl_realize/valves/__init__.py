"""Control valves: step tests with metrics and report, and the diagnosis of oscillating loops."""

from __future__ import annotations

from .definitions import DEFINITIONS, Definition
from .evaluate import valve_report
from .groups import Interval, SizeAndDirection
from .limits import EXAMPLE_LIMITS, ExampleLimits
from .loops.diagnose import diagnose_loop
from .loops.methods import LoopMethod
from .loops.result import LoopDiagnosis
from .metrics import Metric
from .part import TestPart
from .parts import split_test
from .plan import ValveTestPlan
from .planning import valve_test_plan
from .result import ValveReport
from .statics import StaticCurve
from .steps import Ranges, StepMetrics

__all__ = [
    "DEFINITIONS",
    "EXAMPLE_LIMITS",
    "Definition",
    "ExampleLimits",
    "Interval",
    "LoopDiagnosis",
    "LoopMethod",
    "Metric",
    "Ranges",
    "SizeAndDirection",
    "StaticCurve",
    "StepMetrics",
    "TestPart",
    "ValveReport",
    "ValveTestPlan",
    "diagnose_loop",
    "split_test",
    "valve_report",
    "valve_test_plan",
]


def __dir__() -> list[str]:
    return __all__
