"""Refuse, or warn of, a model whose record does not resolve what a design needs."""

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
"""Flags of a fit, and what is not resolved where they are raised."""

PREDICTED = {"no_delay_resolved": "a dead time to predict over"}
"""The same, of what only a predictor relies on."""


def check_sign(system: Any, purpose: str) -> None:
    """Refuse to design for a model the sign of whose gain its record does not tell.

    That is so where the gain is flagged, and its interval reaches over zero or is not known.

    Raises
    ------
    UnsuitableSystemError
    """
    for flag in _flags(system):
        if flag.code == GAIN_OPEN and not _sign_is_known(system.fit):
            raise UnsuitableSystemError(
                f"{purpose} needs the sign of the gain, which the record of {_name(system)} "
                f"does not determine: {flag}. If the gain is known from elsewhere, scale a "
                "model of known dynamics (design.ProcessModel, delayed_ss)"
            )


def warn_unresolved(system: Any, *, predicts: bool = False) -> None:
    """Warn of what the record behind a model does not resolve.

    With `predicts` also of a dead time that may be none: a predictor relies on it.

    The warning belongs to the line that called the package, so that it is shown once for a
    design in several steps.
    """
    for flag in _flags(system):
        quantity = (QUANTITIES | (PREDICTED if predicts else {})).get(flag.code)
        if flag.code == GAIN_OPEN and not _sign_is_known(system.fit):
            quantity = "the gain and its sign"
        if quantity is not None and not (flag.code == "not_settled" and _gain_is_known(system.fit)):
            warn_caller(
                f"the record of {_name(system)} does not determine {quantity}: {flag}",
                UnresolvedWarning,
            )


def _flags(system: Any) -> tuple[Flag, ...]:
    fitted = isinstance(system, DelayedStateSpace) and system.fit is not None
    return system.fit.flags if fitted else ()


def _name(system: Any) -> str:
    return f"the model {system.name!r}"


def _sign_is_known(fit: ModelFit) -> bool:
    return sign_is_told(fit.gain_interval)


def _gain_is_known(fit: ModelFit) -> bool:
    """Whether the interval of a gain is narrow, though the record ends early."""
    gain, interval = fit.gain, fit.gain_interval
    return gain is not None and interval is not None and is_firm(gain, interval)
