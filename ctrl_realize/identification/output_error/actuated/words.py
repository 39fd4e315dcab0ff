"""Sentences about an actuator that was fitted."""

from __future__ import annotations

from collections.abc import Sequence

from ...._parameters import Parameter
from ...._wording import plainly
from ....results import Flag
from .alternatives import ALTERNATIVES

_OF_THE_RECORD = frozenset({
    "hum", "drift", "no_rest", "not_at_rest", "coarse_quantisation", "outliers",
    "stuck_output", "held_output", "output_at_limit", "onset_in_gap", "cut", "noncausal",
    "feedback",
})  # fmt: skip
"""Flags about a record, whatever the model is."""


def of_the_record(code: str, *, load: bool) -> bool:
    """Whether a flag of a linear fit remains, if a model with an actuator takes its place."""
    return code in _OF_THE_RECORD or (load and code == "load_disturbance")


def missing_tests(names: Sequence[str]) -> str:
    """Say which tests would identify what the command cannot."""
    every = [ALTERNATIVES[name] for name in names]
    tests = "; ".join(f"{one.words} ({one.test.rstrip(',')})" for one in every)
    return f"not tried, since the command cannot identify them (with a test that can): {tests}"


def cannot_tell(name: str) -> str:
    """Say why an actuator that was requested is not fitted."""
    one = ALTERNATIVES[name]
    return (
        f"actuator={name!r}: expected {one.expected}, got records that cannot distinguish "
        f"{one.words} from gain and dead time; try {one.test} or actuator='auto'"
    )


def not_needed(names: Sequence[str], evidence: float) -> str:
    """Say that a linear model is enough."""
    tried = " or ".join(ALTERNATIVES[name].words for name in names)
    return (
        f"linear: the evidence for {tried} is not very strong (information criterion "
        f"{plainly(abs(evidence), 3)} {'lower' if evidence > 0 else 'higher'} with it)"
    )


def unresolved(parameter: Parameter, test: str) -> str:
    """Say that the records determine a parameter badly, and which test would help."""
    return (
        f"{parameter.label} lies between {parameter.low:.3g} and {parameter.high:.3g}, and the "
        f"records do not determine it more closely; {test} would"
    )


def not_told(sentences: Sequence[str]) -> Flag:
    """Report parameters of an actuator that the records determine badly."""
    return Flag("actuator_not_resolved", "; ".join(sentences))


def structured(normalized_rms: float) -> Flag:
    """Report a residual above the noise."""
    return Flag(
        "structured_misfit",
        f"with the actuator, too, the residual is {plainly(normalized_rms, 3)} times the noise: "
        "the valve does something that neither model describes; dead time and actuator are "
        "apparent values",
    )
