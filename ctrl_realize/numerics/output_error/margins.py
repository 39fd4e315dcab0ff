"""Decisions whose margin is so small that rounding, or another processor, may turn them.

What a decision compares has converged (`compared_fits`): two ways to round the same record differ
in it by much less than `CLOSE`. What was not followed to its minimum differs by hundredths of
a variance at most. What counts as close is our own rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from ..separable.structures import PLAUSIBLE, charged, needless_parameters, plausible
from ..separable.varpro import Structure
from ..separable.window import WindowFit

CLOSE = 1e-3
"""Distance from a threshold, as a part of it, within which a decision is called close. Structures
compare by the part of `PLAUSIBLE` by which their criteria differ: a hundredth of a variance."""

DecisionKey: TypeAlias = Literal["structure", "ruled_out", "adequate"]


@dataclass(frozen=True)
class CloseDecision:
    """A decision near its threshold: which, and the structure that would be in its place."""

    key: DecisionKey
    structure: Structure | None = None


def close_to(key: DecisionKey, value: float, threshold: float) -> tuple[CloseDecision, ...]:
    """Report a value within `CLOSE` of its threshold."""
    return (CloseDecision(key),) if abs(value - threshold) <= CLOSE * threshold else ()


def close_choices(whole: WindowFit, level: float, chosen: Structure) -> tuple[CloseDecision, ...]:
    """List structures with the criterion of the chosen, which is `level`, but for little.

    And those that might as well have been asked how much noise there is, on which all hangs.
    """
    near = [
        s
        for s, value in whole.criterion.items()
        if abs(value + needless_parameters(s) - level) <= CLOSE * PLAUSIBLE
    ]
    near += [s for s, excess in whole.rivals.items() if excess <= CLOSE * PLAUSIBLE]
    return tuple(CloseDecision("structure", s) for s in dict.fromkeys(near) if s != chosen)


def close_exclusions(
    whole: WindowFit, level: float, chosen: Structure
) -> tuple[CloseDecision, ...]:
    """List structures that are just ruled out, or just not; `level` with its charges, as there."""
    values = charged(whole.criterion, whole.penalty)
    most, least = (
        plausible(whole.candidates, values, whole.variance, whole.candidates[chosen], level, slack)
        for slack in (CLOSE * PLAUSIBLE, -CLOSE * PLAUSIBLE)
    )
    return tuple(CloseDecision("ruled_out", s) for s in most if s not in least)
