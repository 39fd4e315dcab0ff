"""HTML reports: one self-contained file, the verdict first."""

from .build import write_campaign as write_campaign
from .build import write_comparison as write_comparison
from .build import write_identification as write_identification
from .page import Column as Column
from .page import Row as Row
from .page import Table as Table
from .sketches import Sketch as Sketch
