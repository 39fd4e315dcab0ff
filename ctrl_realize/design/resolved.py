"""Refuse, or warn about, models whose record does not determine what a design needs."""

from __future__ import annotations

from typing import Any

from ..delayed import DelayedStateSpace
from ..errors import UnresolvedWarning, UnsuitableSystemError, warn_caller
from ..identification.output_error.words import is_firm, sign_is_told
from ..results import Flag, ModelFit

GAIN_OPEN = "gain_not_resolved"

QUANTITIES = {
    GAIN_OPEN: "the gain",
    "no_common_gain": "the gain",
    "not_settled": "the gain and the slowest time constant",
    "delay_at_bound": "the dead time",
    "unstable": "whether the plant is stable",
}
"""Flags of a fit, and the quantities that are then not determined."""

PREDICTED = {"no_delay_resolved": "a dead time to predict over"}
"""The same for quantities that only a predictor needs."""


def check_sign(system: Any, purpose: str) -> None:
    """Refuse to design for a model whose sign of the gain is not determined by its record.

    This is so if the gain is flagged and its interval contains zero or is not known.

    Raises
    ------
    UnsuitableSystemError
    """
    for flag in _flags(system):
        if flag.code == GAIN_OPEN and not sign_is_told(system.fit.gain_interval):
            raise UnsuitableSystemError(
                f"{purpose} needs the sign of the gain, which the record of the model "
                f"{system.name!r} does not determine: {flag}. If the gain is known from elsewhere, "
                "scale a model of known dynamics (design.ProcessModel, delayed_ss)"
            )


def warn_unresolved(system: Any, *, predicts: bool = False) -> None:
    """Warn about quantities that the record behind a model does not determine.

    With `predicts` also about a dead time that may be zero, on which a predictor depends.

    The warning is attributed to the caller's line, so that it is shown once for a design in several
    steps.
    """
    for flag in _flags(system):
        quantity = (QUANTITIES | (PREDICTED if predicts else {})).get(flag.code)
        if flag.code == GAIN_OPEN and not sign_is_told(system.fit.gain_interval):
            quantity = "the gain and its sign"
        if quantity is not None and not (flag.code == "not_settled" and _gain_is_known(system.fit)):
            warn_caller(
                f"the record of the model {system.name!r} does not determine {quantity}: {flag}",
                UnresolvedWarning,
            )


def _flags(system: Any) -> tuple[Flag, ...]:
    fitted = isinstance(system, DelayedStateSpace) and system.fit is not None
    return system.fit.flags if fitted else ()


def _gain_is_known(fit: ModelFit) -> bool:
    """Whether the interval of a gain is narrow although the record ends early."""
    gain, interval = fit.gain, fit.gain_interval
    return gain is not None and interval is not None and is_firm(gain, interval)
