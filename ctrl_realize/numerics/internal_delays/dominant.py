"""Dominant poles of long discrete loops.

A loop with a long delay has nearly all of its poles next to the unit circle, about evenly spaced:
Newton's method from points on the circle, and from points beside it where z^d is as large as the
loop's gain, finds those of largest magnitude. The argument principle [1]_ tells whether these are
all; if not, as for several long delays, all poles are computed. The starts are our own.

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
from .characteristic import discrete_poles, each_loop, newton_polished, newton_steps
from .form import DelayForm

ALL = 400
"""Number of poles up to which all are found together in a few hundredths of a second."""

MULTIPLE = 1e-7
"""Relative distance below which two roots count as one, possibly a multiple one."""

RESIDUAL = 1e-10
"""Relative Newton step below which a point counts as a pole."""


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
    return largest(each_loop(form, lambda part: _of_loop(part, count)), count)


def largest(poles: ComplexArray, count: int) -> ComplexArray:
    """Sort poles by size and take the first ones; one more where a pair would be split."""
    # rounded, so that the two of a pair stay together
    sizes, real = np.round(np.abs(poles), 12), np.round(poles.real, 10)
    order = np.lexsort((-poles.imag, -real, -sizes))
    return with_whole_pairs(poles[order], count)


def with_whole_pairs(poles: ComplexArray, count: int) -> ComplexArray:
    """Take the first poles; one more where a pair would be split."""
    if 0 < count < poles.size and poles[count - 1].imag > 1e-9 * abs(poles[count - 1]):
        count += 1
    return poles[:count]


def _of_loop(part: DelayForm, count: int) -> ComplexArray:
    total = part.states + int(sum(part.delays))
    single = len(part.delays) < 2 or not np.any(part.D)
    if total <= ALL or not part.delays or (single and not part.states):
        return discrete_poles(part)
    # The upper half; the system is real.
    circle = np.exp(1j * np.pi * np.arange(total + 1) / total)
    own = np.linalg.eigvals(part.A).astype(np.complex128)
    gain = np.clip(_loop_gain(part, circle), 1e-3, 1e3)
    moved = circle * gain ** (1 / max(part.delays))
    starts = np.concatenate([circle, moved])
    step = newton_steps(part, starts, discrete=True)
    ahead = starts - step
    # A step longer than the spacing of the poles leads to another start's pole.
    near = np.isfinite(step) & (np.abs(step) < np.maximum(20 / total, 1e-3))
    ahead, kept = ahead[near], 8 * count + 40
    ahead = ahead[np.argsort(-np.abs(ahead))][:kept]
    # poles of the core as they are, and with the loop closed by delays of 0: poles that the delays
    # hardly move, as those of a Smith predictor's loop
    slow = np.concatenate([own, _without_delays(part)])
    slow = np.asarray(slow[slow.imag >= 0] * (1 + 1e-6) + 1e-9, dtype=np.complex128)
    roots, last = newton_polished(part, ahead, discrete=True)
    still, moves = newton_polished(part, slow, discrete=True, steps=30)
    # A double root, of a plant and its model, is found to the root of the rounding error.
    stays = (moves < RESIDUAL) | ((moves < MULTIPLE) & (np.abs(still - slow) < 100 * MULTIPLE))
    found = np.concatenate([still[stays], roots[last < RESIDUAL]])
    roots = with_pairs(apart(found, MULTIPLE))
    return roots if _complete(part, roots, count) else discrete_poles(part)


def _complete(part: DelayForm, roots: ComplexArray, count: int) -> bool:
    """Whether as many roots were found outside of a circle as there are by the argument principle.

    The circle is laid through the widest gap next to the roots that are wanted: further on single
    roots may be missing.
    """
    sizes = np.sort(np.abs(roots))[::-1]
    if sizes.size <= count + 1:
        return False
    tail = sizes[count : count + 8]
    at = int(np.argmax(tail[:-1] - tail[1:]))
    radius = float(tail[at] + tail[at + 1]) / 2
    return int(np.sum(sizes > radius)) == count_outside(part, radius)


def count_outside(part: DelayForm, radius: float) -> int:
    """Count the poles of a discrete system outside a circle by the argument principle."""
    d = np.array(part.delays)
    outside = int(np.sum(np.abs(np.linalg.eigvals(part.A)) > radius))

    def curve(angle: FloatArray) -> ComplexArray:
        M = between_delays(part, radius * np.exp(1j * angle))
        # I - z^-d M, for a radius below 1 times its power d: positive, so it turns alike
        late = np.exp(-1j * np.outer(angle, d)) * min(1.0, 1 / radius) ** d
        held = min(1.0, radius) ** d
        loop = np.eye(d.size) * held - late[:, :, None] * M
        return np.asarray(loop[:, 0, 0] if d.size == 1 else np.linalg.det(loop))

    grid = np.linspace(0, np.pi, 2 * int(d.sum()) + 400)
    _, values = follow(curve, grid)
    return outside - round(half_turns(values))


def _without_delays(part: DelayForm) -> ComplexArray:
    """Poles of a loop if its delays were 0; none where that loop has no solution."""
    loop = np.eye(len(part.delays)) - part.D
    if np.linalg.cond(loop) > 1e12:
        return np.zeros(0, dtype=np.complex128)
    A = part.A + part.B @ np.linalg.solve(loop, part.C)
    return np.asarray(np.linalg.eigvals(A), dtype=np.complex128)


def between_delays(part: DelayForm, points: ComplexArray) -> ComplexArray:
    """Response of the core between the delays at points (K,), shape (K, q, q)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        core = frequency_response(schur_form(part.A, part.B), part.B, part.C, part.D, points)
    return np.asarray(np.moveaxis(core, -1, 0))


def _loop_gain(part: DelayForm, points: ComplexArray) -> FloatArray:
    """Spectral radius of the core between the delays, at points where the delays have size 1."""
    core = np.nan_to_num(between_delays(part, points), nan=1e3, posinf=1e3, neginf=1e3)
    return np.asarray(np.abs(np.linalg.eigvals(core)).max(axis=1))


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
