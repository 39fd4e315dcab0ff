"""How many poles of systems closed through delays are unstable, by the argument principle.

Poles are not computed for it [1]_. A system falls into the parts that are in a loop with one
another, and its characteristic function into theirs, so that each part is followed on its own. In
continuous time it is followed up to where the gain of its loops is small: there is no turn beyond,
as in the small-gain theorem [2]_, and what is left of the phase follows from eigenvalues.

References
----------
.. [1] K. J. Astrom and R. M. Murray, Feedback Systems, 2nd ed., Princeton University Press 2021,
   section 10.3.
.. [2] S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005,
   section 4.9.2 (the small-gain theorem).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..loops.crossings import encircled, follow, frequency_grid
from .characteristic import loops
from .dominant import between_delays, dominant_discrete_poles
from .form import DelayForm
from .response import CHUNK, characteristic_matrices
from .spectrum import rightmost_poles

NEAR_ONE = 0.3
"""Distance from 1 at which a characteristic function cannot turn about 0 any more."""

SMALL_GAIN = 0.9
"""Gain of all loops together from which on down nothing turns about 0."""

BOUND_STEPS = 20
"""Steps of the power iteration that bounds a gain."""

FEATURES = 6
"""Dominant poles around which frequencies are gathered."""

FEW = 12
"""Delays of a loop up to which its dominant poles are computed for that. They only save refinements
for a loop that is followed with 16 points a turn of all its delays, and of 50 delays they take 20
times as long as all the rest."""


def characteristic(
    form: DelayForm, points: ComplexArray, *, discrete: bool, settles: bool = True
) -> ComplexArray:
    """Evaluate the characteristic function over a polynomial of its degree with stable roots only.

    Its zeros are the poles of the system; it has no poles on or outside the border of stability.
    With `settles` it goes to 1 at high frequency also where loops consist of delays and gains only.
    """
    rate = _rate(form)
    out = np.empty(points.size, dtype=np.complex128)
    for start in range(0, points.size, CHUNK):
        part = points[start : start + CHUNK]
        P = characteristic_matrices(form, part, discrete=discrete)
        P[:, : form.states] /= (part if discrete else part + rate)[:, None, None]
        values = np.linalg.det(P)
        if settles and not discrete and form.delays:
            # What is left at high frequency: 1 for a system of retarded type. Without zeros to the
            # right of the axis where the gain of the direct terms is below 1.
            lines = P[:, form.states :, form.states :]
            values = values / np.linalg.det(lines)
        out[start : start + CHUNK] = values
    return out


def _rate(form: DelayForm) -> float:
    """Fastest rate in rad/s, where the roots of the polynomial are."""
    total = sum(form.delays)
    return float(np.abs(np.linalg.eigvals(form.A)).max(initial=1 / total if total else 0.0)) or 1.0


def settled_frequency(form: DelayForm, low: float) -> float:
    """Find the frequency in rad/s from which on a continuous function stays near 1."""
    top = low
    for _ in range(80):
        points = np.asarray(1j * top * np.geomspace(1, 1e4, 60), dtype=np.complex128)
        values = characteristic(form, points, discrete=False)
        if np.all(np.abs(values - 1) < NEAR_ONE):
            return top
        top *= 2
    return top


def in_s_plane(points: ComplexArray, dt: float) -> ComplexArray:
    """Map poles or zeros to the s-plane; those at z = 0 are left out."""
    if not dt:
        return points
    # Far inside the circle there are no sharp features that the uniform part of a grid would miss.
    return np.asarray(np.log(points[np.abs(points) > 0.05]) / dt, dtype=np.complex128)


def features(form: DelayForm, dt: float, *, few: bool = True) -> tuple[ComplexArray, float]:
    """Poles in the s-plane where the response changes quickly, and the sum of the delays in s.

    `dt` is 0 for continuous time. Without `few` those of the core only.
    """
    poles = np.linalg.eigvals(form.A).astype(np.complex128)
    if few:
        slow = dominant_discrete_poles(form, FEATURES) if dt else rightmost_poles(form, FEATURES)
        poles = np.concatenate([poles, slow])
    return in_s_plane(poles, dt), float(sum(form.delays)) * (dt or 1.0)


def grid(form: DelayForm, dt: float, *, few: bool = True) -> FloatArray:
    """Frequencies in rad/s at which no turn of the response is missed."""
    return grid_about(*features(form, dt, few=few), dt, partial(settled_frequency, form))


def grid_about(
    places: ComplexArray, dead_time: float, dt: float, settled: Callable[[float], float]
) -> FloatArray:
    """Frequencies in rad/s from far below all `places` up to Nyquist's.

    In continuous time the last one is what `settled` makes of the fastest place.
    """
    sizes = np.abs(places)
    top = np.pi / dt if dt else settled(sizes.max(initial=1 / dead_time if dead_time else 1.0))
    low = 1e-3 * min(float(sizes[sizes > 0].min(initial=top)), 1 / dead_time if dead_time else top)
    return frequency_grid(low, top, places, dead_time)


def unstable_count(form: DelayForm, dt: float) -> tuple[int, bool]:
    """Count the poles outside the stable region by the argument principle.

    Parameters
    ----------
    form : DelayForm
    dt : float
        Sample time in s, 0 for continuous time.

    Returns
    -------
    count : int
    marginal : bool
        A pole is so close to the border that its side cannot be determined.
    """
    found = [_count(part, dt) for part in loops(form)]
    return sum(count for count, _ in found), any(marginal for _, marginal in found)


def _count(part: DelayForm, dt: float) -> tuple[int, bool]:
    omega, rest = grid(part, dt, few=len(part.delays) <= FEW), 0.0
    low_gain = None if dt or not part.delays else _low_gain_from(part, omega)
    if low_gain is not None:
        omega = np.append(omega[omega < low_gain], low_gain)
        rest = _rest(part, low_gain)

    def curve(at: FloatArray) -> ComplexArray:
        x = np.asarray(np.exp(1j * at * dt) if dt else 1j * at, dtype=np.complex128)
        return characteristic(part, x, discrete=bool(dt), settles=low_gain is None)

    _, values = follow(curve, omega)
    return encircled(values, rest)


def _low_gain_from(part: DelayForm, omega: FloatArray) -> float | None:
    """Frequency above which the gain of all loops together is small; None if there is none.

    The spectral radius of the sizes is at most ``max_i (G v)_i / v_i`` for any positive v
    (Collatz and Wielandt), whatever the delays are.
    """
    places = np.linalg.eigvals(part.A).astype(np.complex128)
    coarse = frequency_grid(float(omega[0]), float(omega[-1]), places, 0.0)
    gains = np.abs(between_delays(part, np.asarray(1j * coarse, dtype=np.complex128)))
    gains = np.where(np.isfinite(gains), gains, np.inf)
    v = np.ones(gains.shape[:2])
    bound = np.full(coarse.size, np.inf)
    with np.errstate(invalid="ignore", over="ignore"):
        for _ in range(BOUND_STEPS):
            ahead = np.einsum("kij,kj->ki", gains, v)
            bound = np.fmin(bound, (ahead / v).max(axis=1))
            v = ahead + 1e-3 * ahead.max(axis=1, keepdims=True) + 1e-300
            v = v / v.max(axis=1, keepdims=True)
    (large,) = np.nonzero(~(bound < SMALL_GAIN))
    if large.size == 0:
        return float(coarse[0])
    return float(coarse[large[-1] + 1]) if large[-1] + 1 < coarse.size else None


def _rest(part: DelayForm, omega: float) -> float:
    """Turn of the characteristic function in rad from a frequency of small gain to infinity."""
    at = np.array([omega])
    late = np.exp(-1j * omega * np.asarray(part.delays))
    loops_at = np.linalg.eigvals(late[:, None] * between_delays(part, 1j * at)[0])
    poles = np.linalg.eigvals(part.A)
    rate = _rate(part)
    # each factor goes to the positive real axis on the shorter way: 1 - g with |g| < 1, and
    # j w - p, seen from the imaginary axis, along a line beside it
    turned = np.angle(1 - loops_at).sum() + np.angle(omega + 1j * poles).sum()
    return float(-turned + poles.size * np.angle(omega - 1j * rate))
