"""Refuse, or warn of, a model whose record does not resolve what a design needs."""

from __future__ import annotations

from typing import Any

from ..delayed import DelayedStateSpace
from ..errors import UnresolvedWarning, UnsuitableSystemError, warn_caller
from ..identification.output_error.result import is_firm
from ..results import Flag, ModelFit

SIGN_UNKNOWN = "gain_not_resolved"

QUANTITIES = {
    SIGN_UNKNOWN: "the gain and its sign",
    "no_common_gain": "the gain",
    "not_settled": "the gain and the slowest time constant",
    "delay_at_bound": "the dead time",
}
"""Flags of a fit, and what is not resolved where they are raised."""


def check_sign(system: Any, purpose: str) -> None:
    """Refuse to design for a model the sign of whose gain is not known.

    Raises
    ------
    UnsuitableSystemError
    """
    for flag in _flags(system):
        if flag.code == SIGN_UNKNOWN:
            raise UnsuitableSystemError(
                f"{purpose} needs the sign of the gain, which the record of {_name(system)} "
                f"does not determine: {flag}. If the gain is known from elsewhere, scale a "
                "model of known dynamics (design.ProcessModel, delayed_ss)"
            )


def warn_unresolved(system: Any) -> None:
    """Warn of what the record behind a model does not resolve.

    The warning belongs to the line that called the package, so that it is shown once for a
    design in several steps.
    """
    for flag in _flags(system):
        quantity = QUANTITIES.get(flag.code)
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


def _gain_is_known(fit: ModelFit) -> bool:
    """Whether the interval of a gain is narrow, though the record ends early."""
    gain, interval = fit.gain, fit.gain_interval
    return gain is not None and interval is not None and is_firm(gain, interval)
