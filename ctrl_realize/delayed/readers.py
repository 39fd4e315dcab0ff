"""Warnings for functions of python-control that read the matrices, and what to call instead.

python-control reads ``A, B, C, D`` directly, so a system can only detect which function reads them.
The names are those of version 0.10.2.
"""

from __future__ import annotations

import sys

from ..errors import ModelWarning, UnsuitableSystemError, warn_caller

HARMLESS = 20
"""Delay up to which the characteristic polynomial is accurate to 1e-6 of the response.

The error grows a hundredfold for ten more samples. On five plants, alone and with a PI controller,
the largest error was 1e-6 at 20, 2e-5 at 30, 7e-3 at 37 and 40 at 50.
"""

MEANINGLESS = 200
"""Delay from which on polynomials are refused: no digit is right from 50 on, and `control.margin`
of ``tf * sys`` then takes minutes or ends in an error of the eigenvalues."""

SLOW = 500
"""States up to which a simulation with dense matrices takes less than 0.1 ms a sample."""

POLYNOMIALS = "_convert_to_transfer_function"
JOINS = "feedback", "append", "lft"
SIMULATES = "forced_response"
ENDS = "_ideal_tfinal_and_dt"


def warn_of_the_reader(registers: int, states: int) -> None:
    """Warn if python-control does something slow or inexact with the matrices, or refuse it.

    To be called by the property that it reads.

    Parameters
    ----------
    registers : int
        Number of states that are delay registers.
    states : int

    Raises
    ------
    UnsuitableSystemError
        Polynomials with so many registers that they are certainly meaningless.
    """
    if registers <= HARMLESS:
        return
    # The frame that reads the property that calls this function.
    frame = sys._getframe(2)
    if not frame.f_globals.get("__name__", "").startswith("control."):
        return
    reader = frame.f_code.co_name
    if reader == POLYNOMIALS:
        words = (
            f"python-control forms polynomials with {registers} delay registers here; from about "
            "50 on these are numerically meaningless, and so are the results. Instead of a root "
            "locus use cr.design.root_locus(sys) or cr.design.margins(sys), instead of ct.tf(sys) "
            "use sys.to_tf() where the delay is not in a loop, and with a transfer function "
            "sys * tf, sys + tf, ct.ss(tf) * sys and "
            "ct.feedback(cr.DelaySystem(ct.ss(tf)), sys)"
        )
        if registers >= MEANINGLESS:
            raise UnsuitableSystemError(words)
        warn_caller(words, ModelWarning)
    elif reader == ENDS:
        warn_caller(
            f"python-control chooses the end of the response without the dead time of {registers} "
            "samples: it may end before it begins. Use sys.step_info() and sys.step_response(), "
            "or give the times",
            ModelWarning,
        )
    elif reader in JOINS:
        warn_of_lost_delays(states)
    elif reader == SIMULATES and states > SLOW:
        warn_caller(
            f"python-control multiplies matrices of {states} states at every sample here. "
            "sys.step_response, sys.impulse_response, sys.initial_response and "
            "sys.forced_response give the same without matrices, a thousand times faster; so does "
            "sys.step_info()",
            ModelWarning,
        )


def warn_of_lost_delays(states: int) -> None:
    """Warn that an interconnection has become a plain system."""
    warn_caller(
        f"python-control makes a plain system of {states} states and more here: it is correct, but "
        "its responses take the longer the more states it has. To keep the delays, put the "
        "delayed system first, use cr.DelaySystem(ct.ss(K)) instead of a controller K, "
        "(1 + L) ** -1 instead of ct.feedback(1, L), cr.interconnect instead of ct.interconnect, "
        "and cr.design.gang_of_four instead of ct.gangof4",
        ModelWarning,
    )


def warn_of_an_interconnection(registers: int, states: int) -> None:
    """Warn if `control.interconnect` asks for the states; called by ``_update_params``."""
    if registers > HARMLESS:
        # this system, those of the interconnection, and who asks
        parts, asks = sys._getframe(2).f_code, sys._getframe(3).f_code
        if (parts.co_name, asks.co_name) == ("_update_params", "linearize"):
            warn_of_lost_delays(states)
