"""One step of generalised least squares from an output-error fit.

Output error weights all errors equally and is consistent for coloured noise, but not efficient: a
slow disturbance may shift a dead time by many of its standard errors. One Gauss-Newton step on data
prewhitened by the residual's autoregressive model is as efficient as maximum likelihood (one-step
estimator: Lehmann and Casella, Theory of Point Estimation, 2nd ed., section 6.4); if it differs
significantly from least squares, one of them is wrong (Hausman, Econometrica 46 (1978) 1251-1271).

References
----------
.. [1] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., Springer 1998, section
   6.4, doi:10.1007/b98854.
.. [2] J. A. Hausman, Specification tests in econometrics, Econometrica 46 (1978) 1251-1271,
   doi:10.2307/1913827.
.. [3] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
   section 2.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from ..arrays import ComplexArray, FloatArray, unit_columns
from ..constants import LEAST_FREEDOM
from ..state_space.responses import simulate
from ..state_space.sampling import sample_with_dead_time
from .parameter_change import whitened


@dataclass(frozen=True)
class WhiteStep:
    """Dead time (s), gain and total delay (s) after the step, with their standard errors."""

    dead_time: float
    dead_time_error: float
    gain: float
    gain_error: float
    total: float
    total_error: float


def white_step(
    measured: FloatArray,
    drive: FloatArray,
    dt: float,
    dead_time: float,
    poles: ComplexArray,
    numerator: FloatArray,
) -> WhiteStep | None:
    """Take one step from exp(-dead time s) b(s) / a(s) to the generalised least-squares model.

    Parameters
    ----------
    measured, drive : ndarray, shape (N,)
        Output, and the held input.
    dt, dead_time : float
        In s.
    poles : ndarray of complex, shape (n,)
        Roots of the monic a, none of them zero.
    numerator : ndarray
        b, lowest power first.

    Returns
    -------
    WhiteStep
        None if there are too few samples or no residual.
    """
    a = np.real(np.poly(poles))[:0:-1]
    n, m = a.size, numerator.size
    scale = float(np.abs(poles).max())
    states = _states(drive, a, dt, dead_time, first=float(drive[0]))
    time = np.linspace(0, 1, drive.size)
    own = np.column_stack([np.ones(time.size), time, _free(a, dt, drive.size)])
    response = states[:, :m] @ numerator
    # The effect of the input before the record on the first samples is a small free response.
    residual = measured - response
    residual = residual - own @ np.linalg.lstsq(own, residual, rcond=None)[0]
    if not np.any(residual):
        return None
    middle = np.append(0.5 * (response[1:] + response[:-1]), response[-1])
    by_pole = -_states(middle, a, dt, 0.0, first=float(response[0]))
    slope = -np.gradient(response) / dt
    columns, size = unit_columns(np.column_stack([slope, by_pole, states[:, :m], own]))
    white, target, used_up = whitened(columns, residual)
    freedom = target.size - white.shape[1] - used_up
    if freedom < LEAST_FREEDOM or scale * dt > np.pi:
        return None
    solution, _, rank, _ = np.linalg.lstsq(white, target, rcond=1e-10)
    if rank < white.shape[1]:
        return None
    left = target - white @ solution
    step = (solution / size)[: 1 + n + m]
    # Of the columns, not of their products, whose inverse may have a negative diagonal.
    root = (np.linalg.pinv(white) / size[:, None])[: 1 + n + m]
    gradients = _gradients(a, numerator)
    gain = numerator[0] / a[0]
    total = dead_time + (a[1] if n > 1 else 1.0) / a[0]
    total -= numerator[1] / numerator[0] if m > 1 else 0.0
    found = np.array([dead_time, gain, total]) + gradients @ step
    errors = np.linalg.norm(gradients @ root, axis=1) * np.sqrt(float(left @ left) / freedom)
    return WhiteStep(*np.stack([found, errors], axis=1).ravel().tolist())


def _gradients(a: FloatArray, b: FloatArray) -> FloatArray:
    """Derivatives of dead time, gain and total delay w.r.t. (dead time, a, b), (3, 1 + n + m)."""
    n, m = a.size, b.size
    out = np.zeros((3, 1 + n + m))
    out[0, 0] = out[2, 0] = 1.0
    out[1, 1], out[1, 1 + n] = -b[0] / a[0] ** 2, 1 / a[0]
    second = a[1] if n > 1 else 1.0
    out[2, 1] = -second / a[0] ** 2
    if n > 1:
        out[2, 2] = 1 / a[0]
    if m > 1:
        out[2, 1 + n], out[2, 2 + n] = b[1] / b[0] ** 2, -1 / b[0]
    return out


def _states(
    drive: FloatArray, a: FloatArray, dt: float, dead_time: float, *, first: float
) -> FloatArray:
    """Response of s^i / a(s), i = 0 ... n - 1, to a held and delayed input, shape (N, n).

    Steady state at the input `first`; a fraction of a sample as in Astrom and Wittenmark,
    Computer-Controlled Systems, 3rd ed., section 2.3.
    """
    n = a.size
    A = np.eye(n, k=1)
    A[-1] = -a
    Ad, Bd, Cd, Dd, delay = sample_with_dead_time(
        A, np.eye(n)[:, -1:], np.eye(n), np.zeros((n, 1)), dt, dead_time
    )
    # deviations from the steady state, which is that of the input and no slope
    late = np.concatenate([np.full(delay, first), drive])[: drive.size]
    x = simulate(Ad, Bd, Cd, Dd, late[None] - first).T
    x[:, 0] += first / a[0]
    return x


def _free(a: FloatArray, dt: float, count: int) -> FloatArray:
    """Free responses of 1 / a(s) from n initial states, shape (N, n)."""
    n = a.size
    system = np.eye(n, k=1)
    system[-1] = -a
    nothing = np.zeros((n, 1))
    turned = expm(system * dt).T
    out = simulate(turned, nothing, np.eye(n), nothing, np.zeros((1, count)), np.eye(n)[0]).T
    size = np.abs(out).max(axis=0)
    return np.asarray(out / np.where(size > 0, size, 1.0))
