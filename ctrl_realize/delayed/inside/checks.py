"""Checks of cores and delays, and errors for matrices that do not exist."""

from __future__ import annotations

import sys
from typing import Any

import control as ct
import numpy as np

from ..._checks import check_type
from ...errors import DelayRangeError, UnsuitableSystemError
from ...numerics.internal_delays.form import DelayForm, without_zero_delays
from ..deferred import DeferredMatrices
from ..operands import plain, whole_samples
from ..operators import algebraic
from ..parts import MAX_DELAY, check_entries

TIMES = "sys.step_response(t), sys.impulse_response(t) and sys.forced_response(t, u)"
LOCUS = "Use cr.design.root_locus(sys), cr.design.margins(sys) and sys.step_response(t)"
FOUR = "Use cr.design.gang_of_four(P, C), and ct.bode_plot(..., plot_phase=False) of it"
MARGIN = "Use ct.margin(1 * P) or cr.design.margins(P)"
ADVICE = {
    "step_response": f"Use {TIMES}",
    "impulse_response": f"Use {TIMES}",
    "initial_response": f"Use {TIMES}",
    "forced_response": f"Use {TIMES}",
    "step_info": "Use sys.step_info(t)",
    "root_locus_map": LOCUS,
    "root_locus_plot": LOCUS,
    "sisotool": LOCUS,
    "gangof4_response": FOUR,
    "gangof4_plot": FOUR,
    "margin": MARGIN,
    "stability_margins": MARGIN,
    "disk_margins": "Use cr.design.margins(sys), whose modulus margin is the disk margin of S",
    "interconnect": "Use cr.interconnect, with the same arguments",
}
"""What to call instead, by the function of python-control that was called."""

ORDER = (
    "If a transfer function or plain system comes first, write P * C, P + C, ct.ss(C) * P, "
    "cr.DelaySystem(ct.ss(C)) instead of C, cr.interconnect, or (1 + L) ** -1 for "
    f"ct.feedback(1, L). For time responses use {TIMES}, for a rational approximation "
    "sys.pade(order), for a sampled model sys.to_discrete(dt)"
)


def not_rational(what: str) -> UnsuitableSystemError:
    """Make the error for a function of python-control that needs what a dead time does not have."""
    frame, name = sys._getframe(1), ""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith("control."):
            name = frame.f_code.co_name
        frame = frame.f_back  # type: ignore[assignment]
    asks = f"{name} of python-control" if name else "this"
    return UnsuitableSystemError(
        f"{asks} needs {what}, which do not exist for a dead time in continuous time. "
        f"{ADVICE.get(name, ORDER)}"
    )


def check_core(core: Any, delays: tuple[float, ...] = ()) -> float | None:
    """Return the time base of a core, 0.0 for continuous time.

    A gain without delays may have none, as in python-control, and then adopts that of others.

    Raises
    ------
    UnsuitableSystemError
    """
    expected = "a control.StateSpace (ct.ss converts)"
    check_type(core, ct.StateSpace, "core", expected, UnsuitableSystemError)
    if isinstance(core, DeferredMatrices):
        raise UnsuitableSystemError(
            f"core is a {type(core).__name__}, which already has delays; expected a plain "
            "control.StateSpace"
        )
    if core.dt is None and core.nstates == 0 and not delays:
        check_entries(core)
        return None
    if core.dt is None or core.dt is True:
        raise UnsuitableSystemError(
            f"the core's dt is {core.dt!r}; expected a sample time in s, or 0 for continuous time"
        )
    check_entries(core)
    return float(core.dt)


def check_delays(delays: tuple[float, ...], core: ct.StateSpace, dt: float | None) -> None:
    """Check delays: not negative, whole samples, and no more than the core has signals.

    Raises
    ------
    UnsuitableSystemError, DelayRangeError
    """
    if len(delays) > min(core.ninputs, core.noutputs):
        raise UnsuitableSystemError(
            f"{len(delays)} delays need as many inputs and outputs of the core, which has "
            f"{core.ninputs} inputs and {core.noutputs} outputs"
        )
    if any(delay < 0 for delay in delays):
        raise DelayRangeError(f"internal_delays={delays}; expected delays >= 0")
    if dt:
        whole_samples(delays, dt)
        if sum(delays) > MAX_DELAY:
            raise DelayRangeError(
                f"the delays are {delays} samples; at most {MAX_DELAY} are allowed. Use a longer "
                "sample time"
            )


def without_zeros(
    core: ct.StateSpace, delays: tuple[float, ...], dt: float
) -> tuple[ct.StateSpace, tuple[float, ...]]:
    """Close the channels whose delay is 0.

    Raises
    ------
    UnsuitableSystemError
        They close an algebraic loop.
    """
    try:
        form = without_zero_delays(DelayForm(core.A, core.B, core.C, core.D, delays))
    except np.linalg.LinAlgError:
        raise algebraic("its delays of 0 s") from None
    return plain(form, dt, core.state_labels), form.delays
