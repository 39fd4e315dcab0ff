"""What each metric of a valve test means, where the definition is from, which test it needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from .._facts import facts


@dataclass(frozen=True)
class Definition:
    """Definition of a metric.

    Attributes
    ----------
    name : str
    unit : str
        ``"s"``, ``"%"`` (of the span), ``"%/%"``, ``"%/s"``.
    sentence : str
        What is measured.
    source : str
        Where the definition is from, as far as it was read.
    needs : str
        The test without which it is not known.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.valves.DEFINITIONS["t86"].unit
    's'
    """

    name: str
    unit: str
    sentence: str
    source: str
    needs: str


DEFINITIONS: Mapping[str, Definition] = MappingProxyType(
    {name: Definition(**row) for name, row in facts("valves/definitions.toml").items()}
)
"""Metrics by name, in the order of the report."""
