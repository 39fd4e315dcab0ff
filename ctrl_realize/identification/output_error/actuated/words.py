"""Sentences about an actuator that was fitted."""

from __future__ import annotations

from collections.abc import Sequence

from ...._parameters import Parameter
from ...._wording import plainly
from ....results import Flag

_OF_THE_RECORD = frozenset(
    {
        "hum",
        "drift",
        "no_rest",
        "not_at_rest",
        "coarse_quantisation",
        "outliers",
        "stuck_output",
        "held_output",
        "output_at_limit",
        "onset_in_gap",
        "cut",
        "noncausal",
        "feedback",
    }
)
"""Flags about a record, whatever the model is."""
_WELL = 0.25  # relative half width of an interval up to which a parameter is told

_WORDS = {"slew_rate": "a slew-rate limit", "dead_band": "a dead band", "stiction": "stiction"}


def of_the_record(code: str) -> bool:
    """Whether a flag of a linear fit remains, if a model with an actuator takes its place."""
    return code in _OF_THE_RECORD


def missing_test(name: str) -> str:
    """Say which test would tell what the command cannot."""
    return (
        f"{_WORDS[name]} was not tried: the command does not turn, so that it cannot be told from "
        "gain and dead time; a staircase up and down tells it"
    )


def not_needed(names: Sequence[str], evidence: float) -> str:
    """Say that a linear model is enough."""
    tried = " or ".join(_WORDS[name] for name in names)
    return (
        f"linear: the evidence for {tried} is not very strong (information criterion "
        f"{plainly(abs(evidence), 3)} {'lower' if evidence > 0 else 'higher'} with it)"
    )


def unresolved(parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """List the parameters that the records tell badly, with the test that would do better."""
    tests = {
        "slew_rate": "a larger step",
        "dead_band": "more reversals, each after two moves in one direction",
        "S": "reversals in small steps or by a slow ramp",
        "J": "small steps or a slow ramp, in which the stem is seen to jump",
    }
    return tuple(
        f"{one.label} lies between {one.low:.3g} and {one.high:.3g}, and the records do not tell "
        f"it closer; {tests[one.name]} would"
        for one in parameters
        if not one.high - one.low <= 2 * _WELL * one.value
    )


def structured(misfit: float) -> Flag:
    """Report a residual above the noise."""
    return Flag(
        "structured_misfit",
        f"with the actuator, too, the residual is {plainly(misfit, 3)} times the noise: the "
        "valve does something that neither says; dead time and actuator are apparent values",
    )
