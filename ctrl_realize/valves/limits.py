"""Two examples of limits, with the source in which they were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any


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


_ALL = {
    "samson_3730_3": ExampleLimits(
        "positioner SAMSON type 3730-3",
        MappingProxyType({"hysteresis": 0.3, "linearity": 1.0}),
        "SAMSON, mounting and operating instructions EB 8384-3 EN, section 3.7, table 12, p. 27 "
        "(edition not on that page)",
        "https://www.manualslib.com/manual/3208419/Samson-3730-3.html?page=27",
        "deviation of the characteristic up to 1 % taken as the linearity of a linear one; "
        "hysteresis up to 0.3 %, of which the page does not say whether it contains the dead band "
        "(here it does not); left out: sensitivity up to 0.1 %, which the page does not define",
    ),
    "masoneilan_svi1000": ExampleLimits(
        "positioner Masoneilan SVi 1000",
        MappingProxyType({"dead_band": 0.6, "hysteresis": 0.6, "linearity": 0.5}),
        "Baker Hughes, Masoneilan SVi 1000 instruction manual, 2017, table 8, p. 70",
        "https://manualarchiveguide.com/manuals/"
        "Baker-Hughes-Masoneilan-SVi-1000-Instruction-Manual-2691623?page=70",
        "hysteresis and dead band of +/- 0.3 % of full span taken as a width of 0.6 %; conformity "
        "of +/- 0.5 % taken as linearity; left out: accuracy +/- 1 % and repeatability +/- 0.3 %, "
        "of which there are no metrics here",
    ),
}

EXAMPLE_LIMITS: Mapping[str, ExampleLimits] = MappingProxyType(_ALL)
"""Examples by key. They are of positioners: a valve with friction may not meet them."""
