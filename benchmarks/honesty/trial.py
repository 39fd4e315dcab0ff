"""What one simulated case has shown, and how an estimator is called in it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any

import ctrl_realize as cr


@dataclass(frozen=True)
class Seen:
    """One case: which, what each interval did, which flags were raised.

    Attributes
    ----------
    study, kind, plant : str
    noise : float
    seed : int
    covered : dict of str to float
        1 where the interval holds the truth, 0 where not, a part of 1 for a band of many points.
    numbers : dict of str to float
    flags : list of str
    failed : str
        Error that was raised instead of an answer.
    """

    study: str
    kind: str
    plant: str
    noise: float
    seed: int
    covered: dict[str, float] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    flags: list[str] = field(default_factory=list)
    failed: str = ""

    @property
    def key(self) -> tuple[str, str, str, float, int]:
        """What tells one case from another."""
        return self.study, self.kind, self.plant, self.noise, self.seed

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


Trial = Callable[[str, str, float, int], Seen]
"""Of kind, plant, noise and seed."""


@contextmanager
def quietly() -> Iterator[None]:
    """Leave the toolbox's own warnings out: they repeat the flags."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cr.CtrlRealizeWarning)
        yield


def inside(ends: tuple[float, float], truth: float) -> float:
    return float(ends[0] <= truth <= ends[1])
