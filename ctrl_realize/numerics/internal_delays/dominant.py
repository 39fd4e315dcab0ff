"""Dominant poles of long discrete loops, and how many poles are unstable.

A loop with a long delay has nearly all of its poles next to the unit circle, about evenly spaced:
Newton's method from points on the circle, and from points beside it where z^d is as large as the
loop's gain, finds those of largest size. How many lie
outside follows from the argument principle alone, without any pole [1]_; the starts are our own.

References
----------
.. [1] K. J. Astrom and R. M. Murray, Feedback Systems, 2nd ed., Princeton University Press 2021,
   section 10.3.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..loops.crossings import follow, half_turns
from ..state_space.responses import frequency_response, schur_form
from .characteristic import DENSE, discrete_poles, loops, newton_polished, newton_steps
from .form import DelayForm
from .response import CHUNK, characteristic_matrices

ALL = 400
"""Number of poles up to which all are found together in a few hundredths of a second."""

RESIDUAL = 1e-10
"""Relative Newton step below which a point counts as a pole."""


NEAR_ONE = 0.3
"""Distance from 1 at which a characteristic function cannot turn about 0 any more."""


def dominant_discrete_poles(form: DelayForm, count: int) -> ComplexArray:
    """Find the poles of largest size of a discrete system.

    Parameters
    ----------
    form : DelayForm
        Delays in whole samples.
    count : int

    Returns
    -------
    ndarray, shape (count,) or less
        Falling in size; a pair is never split.
    """
    found = [np.zeros(0, dtype=np.complex128)]
    for part in loops(form):
        total = part.states + int(sum(part.delays))
        short = (
            total <= max(ALL, DENSE) or not part.delays or (not np.any(part.D) and not part.states)
        )
        found.append(discrete_poles(part) if short else _largest(part, total, count))
    return largest(np.concatenate(found), count)


def largest(poles: ComplexArray, count: int) -> ComplexArray:
    """Sort poles by size and take the first ones; one more where a pair would be split."""
    order = np.lexsort((-poles.imag, -poles.real, -np.round(np.abs(poles), 12)))
    poles = poles[order]
    if 0 < count < poles.size and poles[count - 1].imag > 1e-9 * abs(poles[count - 1]):
        count += 1
    return poles[:count]


def _largest(part: DelayForm, total: int, count: int) -> ComplexArray:
    # The upper half; the system is real.
    circle = np.exp(1j * np.pi * np.arange(total + 1) / total)
    own = np.linalg.eigvals(part.A).astype(np.complex128)
    gain = np.clip(_loop_gain(part, circle), 1e-3, 1e3)
    moved = circle * gain ** (1 / max(part.delays))
    starts = np.concatenate([circle, moved, own[own.imag >= 0] * (1 + 1e-6) + 1e-9])
    step = newton_steps(part, starts, discrete=True)
    ahead = starts - step
    # A step longer than the spacing of the poles leads to another start's pole.
    near = np.isfinite(step) & (np.abs(step) < np.maximum(20 / total, 1e-3))
    ahead, kept = ahead[near], 8 * count + 40
    ahead = ahead[np.argsort(-np.abs(ahead))][:kept]
    roots, last = newton_polished(part, ahead, discrete=True)
    roots = roots[last < RESIDUAL]
    return with_pairs(apart(roots))


def _loop_gain(part: DelayForm, points: ComplexArray) -> FloatArray:
    """Spectral radius of the core between the delays, at points where the delays have size 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        core = frequency_response(schur_form(part.A), part.B, part.C, part.D, points)
    if core.shape[0] == 1:
        gain = np.abs(core[0, 0])
    else:
        matrices = np.nan_to_num(np.moveaxis(core, -1, 0), nan=1e3, posinf=1e3, neginf=1e3)
        gain = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
    return np.asarray(np.nan_to_num(gain, nan=1e3), dtype=np.float64)


def apart(roots: ComplexArray, rtol: float = 1e-9) -> ComplexArray:
    """Drop roots that were found twice."""
    kept: list[complex] = []
    for root in roots[np.lexsort((roots.imag, roots.real))]:
        if all(abs(root - other) > rtol * (1 + abs(root)) for other in kept):
            kept.append(complex(root))
    return np.array(kept, dtype=np.complex128)


def with_pairs(roots: ComplexArray) -> ComplexArray:
    """Complete conjugate pairs of roots of a real function, each once."""
    real = np.abs(roots.imag) < 1e-9 * np.maximum(np.abs(roots), 1e-3)
    upper = apart(np.abs(roots.imag[~real]) * 1j + roots.real[~real])
    return np.concatenate([roots[real].real.astype(np.complex128), upper, upper.conj()])


def characteristic(form: DelayForm, points: ComplexArray, *, discrete: bool) -> ComplexArray:
    """Evaluate the characteristic function over a polynomial of its degree with stable roots only.

    Its zeros are the poles of the system; it has no poles on or outside the border of stability.
    """
    rate = float(np.abs(np.linalg.eigvals(form.A)).max(initial=0.0)) or 1.0
    out = np.empty(points.size, dtype=np.complex128)
    for start in range(0, points.size, CHUNK):
        part = points[start : start + CHUNK]
        P = characteristic_matrices(form, part, discrete=discrete)
        P[:, : form.states] /= (part if discrete else part + rate)[:, None, None]
        values = np.linalg.det(P)
        if not discrete and form.delays:
            # What is left at high frequency: 1 for a system of retarded type. Without zeros to the
            # right of the axis where the gain of the direct terms is below 1.
            lines = P[:, form.states :, form.states :]
            values = values / np.linalg.det(lines)
        out[start : start + CHUNK] = values
    return out


def settled_frequency(form: DelayForm, low: float) -> float:
    """Find the frequency in rad/s from which on a continuous function stays near 1."""
    top = low
    for _ in range(80):
        omega = top * np.geomspace(1, 1e4, 60)
        points = np.asarray(1j * omega, dtype=np.complex128)
        values = characteristic(form, points, discrete=False)
        if np.all(np.abs(values - 1) < NEAR_ONE):
            return top
        top *= 2
    return top


def unstable_count(form: DelayForm, grid: FloatArray, *, dt: float) -> tuple[int, bool]:
    """Count the poles outside the stable region by the argument principle.

    Parameters
    ----------
    form : DelayForm
    grid : ndarray, shape (K,)
        Rising frequencies in rad/s from near 0 to where nothing turns any more (the Nyquist
        frequency).
    dt : float
        Sample time in s, 0 for continuous time.

    Returns
    -------
    count : int
    marginal : bool
        A pole is so close to the border that no side can be told.
    """

    def curve(omega: FloatArray) -> ComplexArray:
        x = np.exp(1j * omega * dt) if dt else 1j * omega
        return characteristic(form, np.asarray(x, dtype=np.complex128), discrete=bool(dt))

    _, values = follow(curve, grid)
    if np.any(values == 0) or not np.isfinite(values).all():
        return 0, True
    steps = np.abs(np.angle(values[1:] / values[:-1]))
    turned = half_turns(values)
    start = abs(float(np.sin(np.angle(values[0]))))
    marginal = bool(np.any(steps > 2.0) or abs(turned - round(turned)) > 0.1 or start > 0.5)
    return max(0, -round(turned)), marginal
