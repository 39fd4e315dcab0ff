"""Riccati equations of a core, with checked weights."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import numbers
from ...errors import DataError, OptionError, UnsuitableSystemError
from ...numerics.arrays import ComplexArray, FloatArray

_ROUNDING = 1e-9  # of the largest eigenvalue, up to which a negative one counts as zero


def weight_matrix(
    given: ArrayLike, size: int, name: str, of: str, *, definite: bool = False
) -> FloatArray:
    """Return a symmetric weight or covariance of the required size, semidefinite or definite."""
    weight = np.atleast_2d(numbers(given, name))
    if weight.shape != (size, size):
        raise DataError(
            f"{name} has shape {weight.shape}; expected {size} by {size}, one row for each of "
            f"the {size} {of}"
        )
    if not np.all(np.isfinite(weight)):
        raise DataError(f"{name} has non-finite entries")
    if not np.allclose(weight, weight.T, rtol=1e-9, atol=0):
        raise OptionError(f"{name} is not symmetric")
    least, largest = np.linalg.eigvalsh(weight)[[0, -1]]
    rounding = _ROUNDING * abs(largest)
    if least < -rounding or (definite and least <= rounding):
        raise OptionError(
            f"{name} has an eigenvalue of {least:.3g}; expected "
            + ("all of them above 0" if definite else "none below 0")
        )
    return weight


def has_states(core: ct.StateSpace, purpose: str) -> None:
    """Refuse a static core, which has no states to control or estimate."""
    if core.nstates == 0:
        raise UnsuitableSystemError(
            f"{purpose} needs a core with states; this plant is a static gain with dead time. "
            "Use design.pid(rule='optimal'), or design.smith_predictor with an integral "
            "controller"
        )


def riccati(
    solver: Any, A: FloatArray, B: FloatArray, Q: FloatArray, R: FloatArray, weights: str
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Solve by `control.dlqr`, for gain, cost matrix and closed-loop poles.

    Raises
    ------
    UnsuitableSystemError
        There is no stabilizing solution.
    """
    try:
        gain, cost, poles = solver(A, B, Q, R)
    # Slycot, if installed, has its own errors, all of them ArithmeticErrors.
    except (ArithmeticError, ct.ControlArgument, ValueError) as error:
        raise UnsuitableSystemError(
            "the Riccati equation of the core has no stabilizing solution for these "
            f"{weights} ({error}); an unstable or integrating mode may be uncontrollable, "
            "unobservable or unweighted"
        ) from error
    K, P = (np.atleast_2d(np.asarray(M, dtype=np.float64)) for M in (gain, cost))
    return K, P, np.asarray(poles, dtype=np.complex128)
