"""Known dynamics of a fit, given as a python-control system."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ...errors import UnsuitableSystemError
from ...numerics.separable.varpro import KnownFactor

_APART = 1e-3  # relative distance by which coincident poles are separated


def known_factor(known: Any) -> KnownFactor:
    """Convert a continuous, stable, proper system of one input and one output to a factor.

    Raises
    ------
    UnsuitableSystemError
        Anything else.
    """
    if known is None:
        return KnownFactor()
    if not isinstance(known, (ct.StateSpace, ct.TransferFunction)):
        raise UnsuitableSystemError(
            f"known is a {type(known).__name__}; expected a control.TransferFunction or StateSpace"
        )
    if not known.issiso() or not known.isctime():
        raise UnsuitableSystemError(
            f"known has {known.ninputs} inputs, {known.noutputs} outputs and dt={known.dt}; "
            "expected a continuous system with one of each (a sensor or a filter)"
        )
    zeros, poles, gain = _zeros_poles_gain(known)
    if zeros.size > poles.size:
        raise UnsuitableSystemError("known has more zeros than poles; expected a proper system")
    if poles.size and np.max(poles.real) >= 0:
        raise UnsuitableSystemError(
            f"known has a pole at {complex(poles[np.argmax(poles.real)]):.3g} rad/s; expected "
            "a stable system (count integrators to the plant)"
        )
    numerator = np.atleast_1d(np.real(np.poly(zeros))) * gain
    return KnownFactor(_apart(poles), numerator.astype(np.float64))


def _zeros_poles_gain(known: Any) -> tuple[Any, Any, float]:
    if isinstance(known, ct.TransferFunction):
        num, den = np.trim_zeros(known.num[0][0], "f"), known.den[0][0]
        if num.size == 0:
            raise UnsuitableSystemError("known is zero")
        return np.roots(num), np.roots(den).astype(np.complex128), float(num[0] / den[0])
    return _zeros_poles_gain(ct.ss2tf(known))


def _apart(poles: Any) -> Any:
    """Separate coincident poles, because partial fractions need distinct ones."""
    apart = np.array(poles, dtype=np.complex128)
    for j in range(1, apart.size):
        while np.any(np.abs(apart[:j] - apart[j]) < 0.5 * _APART * np.abs(apart[j])):
            apart[j] *= 1 + _APART
    return apart
