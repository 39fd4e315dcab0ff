"""HTML reports: one self-contained file, the verdict first."""

from .build import write_campaign as write_campaign
from .build import write_comparison as write_comparison
from .build import write_identification as write_identification
from .page import Column as Column
from .page import Page as Page
from .page import Row as Row
from .page import Table as Table
from .page import pairs as pairs
from .page import write_page as write_page
from .sketches import Sketch as Sketch
from .verdict import verdict_of as verdict_of

__all__ = [
    "Column",
    "Page",
    "Row",
    "Sketch",
    "Table",
    "pairs",
    "verdict_of",
    "write_campaign",
    "write_comparison",
    "write_identification",
    "write_page",
]


def __dir__() -> list[str]:
    return __all__
