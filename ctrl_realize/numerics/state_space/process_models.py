"""Step responses of process models, and Skogestad's half rule.

References
----------
.. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J. Process
   Control 13 (2003) 291-309, sections 2 (half rule) and 5 (rules T1 to T3),
   doi:10.1016/S0959-1524(02)00062-8.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray

_SHORT_LEAD = 1e-3
"""Share of all times together up to which a lead counts as none. The zeros of a sampled model far
beyond its lags are rounding, and rule T2 would take them for its gain."""

_ITERATIONS = 20
"""How often the rules for leads are repeated at most."""


def process_step(
    time: FloatArray, lag: float, second_lag: float, dead_time: float, *, integrating: bool
) -> FloatArray:
    """Unit-gain step response of exp(-theta s) / ((T1 s + 1)(T2 s + 1)), or of that over s.

    Parameters
    ----------
    time : ndarray, shape (N,)
        In s.
    lag, second_lag, dead_time : float
        T1 >= T2 >= 0 and theta, in s.
    integrating : bool

    Returns
    -------
    ndarray, shape (N,)
    """
    t = np.maximum(time - dead_time, 0.0)
    big, small = max(lag, second_lag), min(lag, second_lag)
    if big == 0:
        return t if integrating else np.where(time >= dead_time, 1.0, 0.0)
    slow = np.exp(-t / big)
    if small < 1e-9 * big:
        rest = slow
        area = big * (1 - slow)
    elif big - small < 1e-6 * big:
        mean = (big + small) / 2
        slow = np.exp(-t / mean)
        rest = (1 + t / mean) * slow
        area = 2 * mean * (1 - slow) - t * slow
    else:
        fast = np.exp(-t / small)
        rest = (big * slow - small * fast) / (big - small)
        area = (big**2 * (1 - slow) - small**2 * (1 - fast)) / (big - small)
    return np.asarray(t - area if integrating else 1 - rest, dtype=np.float64)


def half_rule(
    lags: FloatArray,
    leads: FloatArray,
    inverse: FloatArray,
    dead_time: float,
    order: int,
    *,
    integrating: bool = False,
) -> tuple[float, FloatArray, float]:
    """Reduce prod(T s + 1) / prod(tau s + 1) exp(-theta s) to `order` lags and a dead time.

    Leads are cancelled first with neighbouring lags (rules T1-T3). Then half of the largest
    neglected lag is added to the smallest kept one and half to the dead time, which also takes all
    further lags and all inverse-response time constants [1]_. The rules for leads compare with the
    final dead time, so they are repeated until it stays as it is.

    Parameters
    ----------
    lags : ndarray, shape (n,)
        tau > 0 in s, without an integrator.
    leads : ndarray
        T > 0 in s of zeros in the left half plane.
    inverse : ndarray
        T > 0 in s of zeros in the right half plane, 1 - T s.
    dead_time : float
        theta in s.
    order : int
        Number of lags to keep, without an integrator.
    integrating : bool, optional
        An integrator is treated as an infinite lag.

    Returns
    -------
    factor : float
        Factor of the gain (rules T1-T3).
    lags : ndarray, shape (order,)
        Largest first; zeros if there are fewer.
    dead_time : float

    References
    ----------
    .. [1] S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J.
       Process Control 13 (2003) 291-309, sections 2 and 5.
    """
    given = theta = dead_time + float(inverse.sum())
    leads = leads[leads > _SHORT_LEAD * (given + float(lags.sum()))]
    for _ in range(_ITERATIONS):
        before = theta
        factor, rest = _cancel_leads(sorted(lags, reverse=True), sorted(leads, reverse=True), theta)
        kept = rest[:order] + [0.0] * (order - len(rest))
        theta, neglected = given, rest[order:]
        if neglected:
            if order > 0:
                kept[-1] += neglected[0] / 2
            # With order 0 the other half is added to the integrator, an infinite lag, without
            # effect.
            half = neglected[0] / 2 if order > 0 or integrating else neglected[0]
            theta += half + float(np.sum(neglected[1:]))
        if theta == before:
            break
    return factor, np.array(kept), theta


def _cancel_leads(lags: list[float], leads: list[float], theta: float) -> tuple[float, list[float]]:
    factor, rest = 1.0, [float(tau) for tau in lags]
    for T in leads:
        if not rest:
            break
        slower = [tau for tau in rest if tau >= T]
        tau = min(slower) if slower else max(rest)
        rest.remove(tau)
        if tau < T:  # rules T1, T1a, T1b
            factor *= T / tau if tau >= theta else max(1.0, T / theta)
        elif theta * 5 <= T:  # rule T2
            factor *= T / tau
        else:  # rule T3
            near = min(tau, max(5 * theta, T))
            factor *= near / tau
            rest.append(near - T)
    return factor, sorted((tau for tau in rest if tau > 0), reverse=True)
