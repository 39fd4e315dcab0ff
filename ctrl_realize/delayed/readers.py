"""Warnings for functions of python-control that read the matrices, and what to call instead.

python-control reads ``A, B, C, D`` directly, so a system can only detect which function reads them.
The names are those of version 0.10.2.
"""

from __future__ import annotations

import sys

from .._facts import facts
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
_WORDS = facts("delayed/advice.toml")["readers"]


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
    if reader in JOINS:
        warn_of_lost_delays(states)
    elif reader in _WORDS and (reader != SIMULATES or states > SLOW):
        words = _WORDS[reader].format(registers=registers, states=states)
        if reader == POLYNOMIALS and registers >= MEANINGLESS:
            raise UnsuitableSystemError(words)
        warn_caller(words, ModelWarning)


def warn_of_lost_delays(states: int) -> None:
    """Warn that an interconnection has become a plain system."""
    warn_caller(_WORDS["lost_delays"].format(states=states), ModelWarning)


def warn_of_an_interconnection(registers: int, states: int) -> None:
    """Warn if `control.interconnect` asks for the states; called by ``_update_params``."""
    if registers > HARMLESS:
        # this system, those of the interconnection, and who asks
        parts, asks = sys._getframe(2).f_code, sys._getframe(3).f_code
        if (parts.co_name, asks.co_name) == ("_update_params", "linearize"):
            warn_of_lost_delays(states)
