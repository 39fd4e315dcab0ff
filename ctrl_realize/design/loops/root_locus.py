"""Root locus of systems with dead time."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from ..._checks import integer, numbers
from ...delayed import DelayedStateSpace
from ...errors import DataError
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.blas_threads import single_threaded
from ..siso import with_dead_time
from .margins import margins

POINTS = 80
"""Default number of gains."""

SPAN = 1e-2, 3.0
"""Default range of gains, as multiples of the gain at the stability boundary."""

FEW_STATES = 2000
"""States up to which the zeros of a discrete loop are computed in seconds."""


@single_threaded
def root_locus(system: Any, gains: ArrayLike | None = None, *, count: int = 10) -> ct.PoleZeroData:
    """Compute the dominant closed-loop poles for a range of gains.

    Those of ``ct.feedback(k * system)``, exact at any dead time. `control.root_locus` finds the
    roots of polynomials, which are inexact and slow with the polynomial of a delay line, and do not
    exist for a dead time in continuous time.

    Parameters
    ----------
    system : DelayedStateSpace or DelaySystem
        Open loop with one input and one output, discrete or continuous; also a system without
        delay.
    gains : array_like, shape (K,), optional
        Increasing, not 0. Default: 80 values up to three times the gain margin.
    count : int, optional
        Number of poles: the right-most ones in continuous time, those of largest magnitude in
        discrete time.

    Returns
    -------
    control.PoleZeroData
        With ``gains`` and ``loci``, shape (K, count), each column a branch; ``.plot()`` draws it.
        ``poles`` are the dominant ones of `system`; the zeros of a discrete loop with more than
        2000 states are left out.

    Raises
    ------
    UnsuitableSystemError
        Several channels, or a system that is not linear or not proper.
    DataError
        Gains that do not increase, or contain 0.

    Notes
    -----
    See `DelaySystem.dominant_poles` for the method. A branch is followed from the largest gain to
    the smallest, to the nearest of the dominant poles; where more than `count` branches are of
    similar size it may jump.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=1.0, dt=0.001)
    >>> locus = cr.design.root_locus(plant, [0.5, 1.0, 1.1])
    >>> print(np.abs(locus.loci).max(axis=1).round(4))
    [0.9993 1.     1.0001]
    """
    wanted = integer(count, "count", 1)
    loop = with_dead_time(system, "a root locus")
    values = _gains(loop) if gains is None else _given(gains)
    few = min(wanted + 2 + wanted // 2, loop.nstates) if loop.dt else wanted + 2 + wanted // 2
    found = [ct.feedback(float(k) * loop).dominant_poles(max(few, 1)) for k in values]
    width = min(wanted, *(poles.size for poles in found))
    short = not loop.dt or isinstance(loop, DelayedStateSpace) or loop.nstates <= FEW_STATES
    return ct.PoleZeroData(
        loop.dominant_poles(wanted),
        loop.zeros() if short else np.zeros(0, dtype=np.complex128),
        values,
        _branches(found, width),
        dt=loop.dt,
        sysname=loop.name,
        sys=loop,
        sort_loci=False,
    )


def _given(gains: ArrayLike) -> FloatArray:
    values = np.atleast_1d(numbers(gains, "gains"))
    if values.ndim != 1 or values.size == 0 or np.any(np.diff(values) <= 0) or np.any(values == 0):
        raise DataError("gains must increase and must not contain 0")
    return values


def _gains(loop: Any) -> FloatArray:
    margin = margins(loop)
    boundary = margin.gain_margin
    if not margin.stable and margin.gain_margins.size:
        # an unstable plant may be stable between the first two
        boundary = float(np.sort(margin.gain_margins)[:2][-1])
    if not 0 < boundary < np.inf:
        # a loop that stays stable: its gain at frequencies of its poles
        omega, values = margin.response
        slow = omega <= 2 * np.abs(loop.features()[0]).max(initial=0.0)
        size = np.abs(values)[slow & np.isfinite(values) & (values != 0)]
        boundary = 10 / float(np.median(size)) if size.size else 1.0
    return np.geomspace(SPAN[0] * boundary, SPAN[1] * boundary, POINTS)


def _branches(found: list[ComplexArray], width: int) -> ComplexArray:
    """Order poles so that columns are continuous, from the last row to the first."""
    loci = np.empty((len(found), width), dtype=np.complex128)
    loci[-1] = found[-1][:width]
    for row in range(len(found) - 2, -1, -1):
        distance = np.abs(loci[row + 1][:, None] - found[row][None, :])
        branch, pole = linear_sum_assignment(distance)
        loci[row, branch] = found[row][pole]
    return loci
