"""A flag with a world in which it is due and one in which it is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Codes = frozenset[str]
Run = Callable[[int], Codes]
"""Makes a seed into the codes that are seen."""


@dataclass(frozen=True)
class FlagCase:
    """A flag of a result; `raising` and `quiet` make a seed into the codes that are seen."""

    result: str
    code: str
    due: str
    raising: Run
    not_due: str
    quiet: Run


def codes(result: Any) -> Codes:
    """Flags of a result."""
    return frozenset(flag.code for flag in result.flags)
