"""What python-control makes of a chain when it asks for polynomials, and a warning of it."""

from __future__ import annotations

import sys

from ..errors import ModelWarning, warn_caller

HARMLESS = 20
"""Registers whose polynomial is still exact to 1e-6 of the response.

The error grows a hundredfold for ten registers more. On five plants, alone and with a PI
controller, the largest was 1e-6 at 20, 2e-5 at 30, 7e-3 at 37 and 40 at 50.
"""

ASKS = "_convert_to_transfer_function"
"""The one function of python-control 0.10.2 through which systems become polynomials.

It reads ``A, B, C, D`` and asks the system nothing, so all that a system can know is who reads.
"""


def warn_of_a_transfer_function(registers: int) -> None:
    """Warn when python-control reads a long chain for its polynomial; called where A is read.

    Parameters
    ----------
    registers : int
        States of the chains.
    """
    if registers <= HARMLESS:
        return
    # Who reads the property that calls this function.
    if sys._getframe(2).f_code.co_name != ASKS:
        return
    warn_caller(
        f"python-control forms polynomials with {registers} delay registers here; from about "
        "50 on these are numerically meaningless, and so are the results. Instead of "
        "ct.margin(sys) and ct.stability_margins(sys) use cr.design.margins(sys), instead of "
        "ct.tf(sys) use sys.to_tf(), and with a transfer function sys * tf, sys + tf, "
        "ct.ss(tf) * sys and ct.feedback(ct.ss(tf), sys)",
        ModelWarning,
    )
