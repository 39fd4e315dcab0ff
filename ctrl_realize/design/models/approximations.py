"""Rational approximations of a dead time: Pade in continuous time, Thiran in discrete time."""

from __future__ import annotations

import math

import control as ct
import numpy as np

from ..._checks import integer, positive, real
from ...delayed import DelayedStateSpace
from ...errors import DelayRangeError
from ...numerics.arrays import FloatArray
from ...numerics.state_space.fractional_delay import pade_ladder, thiran_denominator
from ...numerics.state_space.sampling import split_dead_time

MAX_PADE_ORDER = 20
DEFAULT_ORDER = 3
"""Order of a Thiran filter, where the dead time is long enough."""


def pade_ss(dead_time: float, order: int = 5, *, name: str | None = None) -> ct.StateSpace:
    """Compute the Pade approximant of a dead time in state space, well-conditioned to order 20.

    All-pass with equal numerator and denominator degree, realized as a lossless ladder whose
    Gramians are the identity. (`control.pade` gives polynomial coefficients; for 29 ms and order 20
    the condition number of its A is 1e100, against 340 here, and step responses are nan.) For 29 ms
    order 5 is accurate to 1e-5 up to 13 Hz, order 10 up to 50 Hz. Do not sample it: z^-d is exact.

    Parameters
    ----------
    dead_time : float
        In s, > 0.
    order : int, optional
        1...20.
    name : str, optional

    Returns
    -------
    control.StateSpace
        Continuous.

    Notes
    -----
    The approximant is the diagonal one of [1]_. Like the realization of [2]_ the ladder is
    balanced: all Hankel singular values of an all-pass are 1.

    References
    ----------
    .. [1] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section
       9.3.1.
    .. [2] J. Lam, Balanced realization of Pade approximants of exp(-sT), IEEE Trans. Automat.
       Control 36 (1991) 1096-1100.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> delay = cr.design.pade_ss(0.0289, 5)
    >>> omega = 2 * np.pi * 13
    >>> print(f"{abs(delay(1j * omega) - np.exp(-1j * omega * 0.0289)):.1e}")
    1.1e-06
    """
    dead_time = positive(dead_time, "dead_time", "dead time in s")
    ladder = pade_ladder(dead_time, integer(order, "order", 1, MAX_PADE_ORDER))
    named = {} if name is None else {"name": name}
    return ct.StateSpace(*ladder, 0, inputs=["u"], outputs=["y"], **named)


def thiran(dead_time: float, dt: float, order: int | None = None) -> DelayedStateSpace:
    """Compute the Thiran all-pass for a dead time that is not a multiple of the sample time.

    Whole samples remain a delay; a Thiran filter of order N approximates the rest, N - 0.5...N +
    0.5 samples, with maximally flat group delay at frequency 0. It is meant for signals; for a
    plant with a zero-order hold `to_discrete` is exact.

    Parameters
    ----------
    dead_time, dt : float
        In s.
    order : int, optional
        N, 1...20. Default: 3, or less if the dead time is shorter than that. A whole number of
        samples needs no filter.

    Returns
    -------
    DelayedStateSpace

    Raises
    ------
    DelayRangeError
        More than zero but less than half a sample, or not more than N - 1 samples with a given N:
        no stable all-pass has that delay.

    Notes
    -----
    The coefficients are Thiran's [1]_, used for an all-pass [2]_.

    References
    ----------
    .. [1] J.-P. Thiran, Recursive digital filters with maximally flat group delay, IEEE Trans.
       Circuit Theory 18 (1971) 659-664, doi:10.1109/TCT.1971.1083363.
    .. [2] T. I. Laakso, V. Valimaki, M. Karjalainen and U. K. Laine, Splitting the unit delay, IEEE
       Signal Process. Mag. 13 (1996) 30-60, the section on all-pass filters, doi:10.1109/79.482137.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.design.thiran(0.0289, 0.001, order=2)
    <DelayedStateSpace: u -> y, order 2, z^-27 (0.027 s), dt = 0.001 s>
    """
    step = positive(dt, "dt", "sample time in s")
    dead_time = real(dead_time, "dead_time", "dead time in s, >= 0")
    given = None if order is None else integer(order, "order", 1, MAX_PADE_ORDER)
    if dead_time < 0:
        raise DelayRangeError(f"dead_time={dead_time:g} s; expected a value >= 0")
    samples, rest = split_dead_time(dead_time, step)
    if rest == 0.0:
        return DelayedStateSpace(ct.ss([], [], [], [[1.0]], step), samples)
    if samples + rest < 0.5:
        raise DelayRangeError(
            f"dead_time={dead_time:g} s is {samples + rest:.3g} samples; a filter needs half "
            "a sample"
        )
    total = samples + rest
    nearest = math.floor(total + 0.5)
    used = min(DEFAULT_ORDER, nearest) if given is None else given
    if total <= used - 1:
        raise DelayRangeError(
            f"order={used} with a dead time of {total:.4g} samples; a stable filter of that order "
            f"needs more than {used - 1} samples. Use order={math.ceil(total)} or less"
        )
    whole = max(0, nearest - used)
    den = thiran_denominator(total - whole, used)
    return DelayedStateSpace(_allpass(den, step), whole)


def _allpass(den: FloatArray, dt: float) -> ct.StateSpace:
    """Controller form of the all-pass with this denominator."""
    order = den.size - 1
    A = np.eye(order, k=-1)
    A[0] = -den[1:]
    B = np.zeros((order, 1))
    B[0] = 1.0
    num = den[::-1]
    C = (num[1:] - num[0] * den[1:])[None, :]
    return ct.StateSpace(A, B, C, [[num[0]]], dt, remove_useless_states=False)
