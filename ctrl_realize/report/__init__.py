"""HTML reports: one self-contained file, the verdict first."""

from .build import write_campaign, write_comparison, write_identification
from .loops import write_loop_report
from .valves import write_valve_report
from .verdict import verdict_of

__all__ = [
    "verdict_of",
    "write_campaign",
    "write_comparison",
    "write_identification",
    "write_loop_report",
    "write_valve_report",
]


def __dir__() -> list[str]:
    return __all__
