"""Two examples of limits, with the source in which they were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from .._facts import facts


@dataclass(frozen=True)
class ExampleLimits:
    """Limits of a manufacturer, as the argument ``limits`` of `valve_report`.

    Attributes
    ----------
    name : str
        Whose limits they are, and of what.
    limits : mapping
        Metric: largest permitted value in % of the span.
    source : str
        Document, section, page.
    url : str
        Where the page was read.
    reading : str
        How its words were taken, and what was left out.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> example = cr.valves.EXAMPLE_LIMITS["samson_3730_3"]
    >>> dict(example.limits)
    {'hysteresis': 0.3, 'linearity': 1.0}
    """

    name: str
    limits: Mapping[str, Any]
    source: str
    url: str
    reading: str


EXAMPLE_LIMITS: Mapping[str, ExampleLimits] = MappingProxyType(
    {
        key: ExampleLimits(**{**row, "limits": MappingProxyType(row["limits"])})
        for key, row in facts("valves/limits.toml").items()
    }
)
"""Examples by key. They are of positioners: a valve with friction may not meet them."""
