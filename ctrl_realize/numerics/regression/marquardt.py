"""Damped least squares of one start: steps of Levenberg and Marquardt until nothing is gained.

What is minimised, and how a step is kept within bounds, is the caller's; here is when a step is
taken and how the damping follows [1]_, [2]_. Many starts of one separable problem
at once are moved by `engine.descend`.

References
----------
.. [1] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
.. [2] K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems, 2nd
   ed., Technical University of Denmark 2004, section 3.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from ..arrays import FloatArray


class Point(Protocol):
    """Parameters with whatever belongs to them."""

    @property
    def cost(self) -> float:
        """What is minimised."""


P = TypeVar("P", bound=Point)


@dataclass(frozen=True)
class Damping:
    """Damping of the first step, how it changes, and when a search is given up.

    It is multiplied by `rise` after a step that gains nothing and divided by `fall` after one that
    does; `tries` steps in turn that gain nothing are the last ones.
    """

    first: float = 1e-3
    rise: float = 5.0
    fall: float = 5.0
    least: float = 1e-12
    tries: int = 8


def descend(
    start: P,
    linearised: Callable[[P], Callable[[float], P]],
    finished: Callable[[float, P], bool],
    damping: Damping,
    most: int,
) -> tuple[P, int]:
    """Follow a start downhill.

    Parameters
    ----------
    start : Point
    linearised : callable
        What lies a step from a point, as a function of the damping.
    finished : callable
        Whether a step that gained so much, and led to this point, is the last one.
    damping : Damping
    most : int
        Steps at most.

    Returns
    -------
    point : Point
        The lowest one met.
    steps : int
        How many led to it.
    """
    here, value = start, damping.first
    for step in range(most):
        ahead = linearised(here)
        for _ in range(damping.tries):
            there = ahead(value)
            if there.cost < here.cost:
                break
            value *= damping.rise
        else:
            return here, step
        gain, here = here.cost - there.cost, there
        value = max(value / damping.fall, damping.least)
        if finished(gain, here):
            return here, step + 1
    return here, most


def damped_step(gram: FloatArray, slope: FloatArray, damping: float) -> FloatArray:
    """Solve (J'J + damping diag(J'J)) step = slope, with columns of one size; shape (n,).

    A direction that nothing depends on is not moved.
    """
    size = np.sqrt(np.diag(gram))
    size = np.where(size > 0, size, 1.0)
    scaled = gram / np.outer(size, size)
    scaled[np.diag_indices_from(scaled)] += damping
    return np.asarray(np.linalg.solve(scaled, slope / size) / size)
