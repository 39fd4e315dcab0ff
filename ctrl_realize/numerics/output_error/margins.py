"""Decisions so close that rounding, or another processor, may change them.

All values that are compared have converged (`compared_fits`): different rounding of the same record
changes them by much less than `CLOSE`; structures that were not followed to their minimum by
hundredths of a variance at most. The definition of close is our own rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from ..constants import VERY_STRONG
from ..engine.problem import Structure
from ..engine.structures import charged, needless_parameters, plausible
from ..engine.window_fit import WindowFit

CLOSE = 1e-3
"""Distance from a threshold, as a part of it, within which a decision is called close. Structures
compare by the part of `VERY_STRONG` by which their criteria differ: a hundredth of a variance."""

DecisionKey: TypeAlias = Literal["structure", "ruled_out", "adequate", "likelihood"]


@dataclass(frozen=True)
class CloseDecision:
    """A decision near its threshold: its kind, and the structure that would be chosen instead."""

    key: DecisionKey
    structure: Structure | None = None


def close_to(key: DecisionKey, value: float, threshold: float) -> tuple[CloseDecision, ...]:
    """Report a value within `CLOSE` of its threshold."""
    return (CloseDecision(key),) if abs(value - threshold) <= CLOSE * threshold else ()


def close_choices(fits: WindowFit, level: float, chosen: Structure) -> tuple[CloseDecision, ...]:
    """List structures whose criterion nearly equals `level`, that of the chosen one.

    Frequencies of pairs are charged, as in the choice. Also those that could have determined the
    noise level, on which everything depends.
    """
    level += fits.frequency_charge(chosen)
    near = [
        s
        for s, value in fits.criterion.items()
        if abs(value + needless_parameters(s) + fits.frequency_charge(s) - level)
        <= CLOSE * VERY_STRONG
    ]
    near += [s for s, excess in fits.rivals.items() if excess <= CLOSE * VERY_STRONG]
    return tuple(CloseDecision("structure", s) for s in dict.fromkeys(near) if s != chosen)


def close_exclusions(fits: WindowFit, level: float, chosen: Structure) -> tuple[CloseDecision, ...]:
    """List structures that are just ruled out, or just not; `level` includes penalties."""
    values = charged(fits.criterion, fits.penalty)
    most, least = (
        plausible(fits.candidates, values, fits.variance, fits.candidates[chosen], level, slack)
        for slack in (CLOSE * VERY_STRONG, -CLOSE * VERY_STRONG)
    )
    return tuple(CloseDecision("ruled_out", s) for s in most if s not in least)
