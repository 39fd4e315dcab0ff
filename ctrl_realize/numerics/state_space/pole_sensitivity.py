"""Small changes of a model: directions of pole moves, their effects, and the moved model.

Our own: the derivatives are those of the logarithm of the factored transfer function, ``d log 1/(z
- p) = dp / (z - p)``, with constant gain at z = 1.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray
from .responses import markov

Core = tuple[FloatArray, FloatArray, FloatArray, float]
"""A (n, n), B (n,), C (n,) and D of a discrete system of one channel."""
Direction = tuple[str, complex, complex]
"""Kind of move (``"speed"`` or ``"damping"``), the pole, and its derivative w.r.t. the move."""
FAITHFUL = 1e-6
"""Largest error of the factored form, relative to the largest Markov parameter."""
ON_CIRCLE = 1e-9
"""A moved pole so close to the unit circle has no damping."""


def pole_directions(poles: FloatArray | ComplexArray, dt: float) -> list[Direction]:
    """List the directions in which stable poles can move: (kind, pole, derivative of the pole).

    A real pole has a ``"speed"`` (relative change of the inverse of its time constant); a pair has
    ``"speed"`` and ``"damping"`` (change of the damping ratio), given for the pole with positive
    imaginary part. Poles at 1, at 0 and on the negative axis have no such direction.
    """
    found: list[Direction] = []
    for p in np.asarray(poles, dtype=np.complex128):
        if abs(p) < 1e-6 or abs(p - 1) < 1e-9 or p.imag < -1e-12:
            continue
        if abs(p.imag) <= 1e-12:
            if p.real > 0:
                found.append(("speed", complex(p.real), complex(p.real * np.log(p.real))))
            continue
        s = np.log(p) / dt
        w, zeta = abs(s), -s.real / abs(s)
        found.append(("speed", complex(p), complex(p * s * dt)))
        if abs(zeta) < 1:
            slope = -w - 1j * w * zeta / np.sqrt(1 - zeta**2)
            found.append(("damping", complex(p), complex(p * slope * dt)))
    return found


def sensitivity_system(
    A: FloatArray, B: FloatArray, C: FloatArray, D: float, directions: list[Direction]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Build the system from u to the core's output w and to its derivative in each direction.

    Moving a pole p of the factored transfer function by dp with constant gain at frequency 0
    multiplies it by ``1 + dp / (z - p) - dp / (1 - p)``; a pair moves together.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n,), (n,), and float
        Core.
    directions : list
        From `pole_directions`.

    Returns
    -------
    A, B, C, D : ndarray, shapes (N, N), (N,), (q, N), (q,)
        q = 1 + number of directions.
    """
    n = A.shape[0]
    blocks = [2 if p.imag else 1 for _, p, _ in directions]
    size = n + sum(blocks)
    big, inward = np.zeros((size, size)), np.zeros(size)
    out, direct = np.zeros((1 + len(directions), size)), np.zeros(1 + len(directions))
    big[:n, :n], inward[:n] = A, B
    out[0, :n], direct[0] = C, D
    at = n
    for row, ((_, p, dp), width) in enumerate(zip(directions, blocks, strict=True), start=1):
        own = slice(at, at + width)
        big[own, own] = [[p.real, -p.imag], [p.imag, p.real]] if width == 2 else [[p.real]]
        big[at, :n] = C
        inward[at] = D
        both = float(width)  # the conjugate pole adds the conjugate
        out[row, own] = both * np.array([dp.real, -dp.imag])[:width]
        level = -both * (dp / (1 - p)).real
        out[row, :n] += level * C
        direct[row] = level * D
        at += width
    return big, inward, out, direct


def moved_core(
    core: Core, zeros: ComplexArray, directions: list[Direction], moves: FloatArray, dt: float
) -> tuple[Core, list[Direction]] | None:
    """Move the poles of a core along their directions; zeros and gain at frequency 0 are kept.

    Parameters
    ----------
    core : (A, B, C, D)
    zeros : ndarray
        Finite zeros of the core.
    directions : list
        From `pole_directions`, of this core.
    moves : ndarray, shape (len(directions),)
        Logarithm of the speed ratio, or change of the damping ratio.
    dt : float
        Sample time in s.

    Returns
    -------
    core, directions
        The moved ones, directions in the same order; None if a sum of simple poles does not
        reproduce the core, or if a pole has moved to a place without a direction.
    """
    A, B, C, D = core
    poles = np.linalg.eigvals(A).astype(np.complex128)
    count = 4 * A.shape[0] + 50
    first = markov(A, B[:, None], C[None], np.array([[D]]), count)[0, 0]
    leading = first[poles.size - zeros.size]
    own = _modal(zeros, poles, leading)
    if own is None or not _alike(own, first):
        return None
    moved = poles.copy()
    fresh: list[Direction] = []
    for (what, pole, _), move in zip(directions, moves, strict=True):
        for k, near in enumerate(poles):
            if np.isclose(near, pole, rtol=1e-9, atol=0):
                moved[k] = _moved_pole(moved[k], what, float(move), dt)
            elif pole.imag and np.isclose(near, np.conj(pole), rtol=1e-9, atol=0):
                moved[k] = np.conj(_moved_pole(np.conj(moved[k]), what, float(move), dt))
    # A pole without direction may be on the unit circle: that of an integrator stays there.
    if np.abs(moved[moved != poles]).max(initial=0.0) >= 1 - ON_CIRCLE:
        return None
    for what, pole, _ in directions:
        at = moved[int(np.abs(poles - pole).argmin())]
        same = [found for found in pole_directions(np.array([at]), dt) if found[0] == what]
        if not same:
            # It has reached 0, or a pair the real axis.
            return None
        fresh.append(same[0])
    free = np.abs(1 - poles) > 1e-9
    gain = leading * np.prod((1 - moved[free]) / (1 - poles[free])).real
    made = _modal(zeros, moved, float(gain))
    return None if made is None else (made, fresh)


def _moved_pole(pole: complex, what: str, move: float, dt: float) -> complex:
    if pole in (0, 1):
        # a place without a direction for speed or damping
        return pole
    s = np.log(complex(pole)) / dt
    if what == "speed":
        # e^100 times as fast is the same as instantaneous
        return complex(np.exp(s * np.exp(min(move, 100.0)) * dt))
    w = abs(s)
    zeta = min(max(-s.real / w + move, 0.0), 0.999)
    return complex(np.exp(w * complex(-zeta, np.sqrt(1 - zeta**2)) * dt))


def _modal(zeros: ComplexArray, poles: ComplexArray, gain: float) -> Core | None:
    """Realize ``gain prod(z - zeros) / prod(z - poles)`` as a real sum of simple poles."""
    n = poles.size
    apart = poles[:, None] - poles[None] + np.eye(n)
    if zeros.size > n or np.abs(apart).min(initial=1.0) < 1e-9:
        return None
    residues = gain * np.prod(poles[:, None] - zeros[None], axis=1) / np.prod(apart, axis=1)
    upper = poles.imag >= -1e-12
    A, B, C = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    at = 0
    for p, r in zip(poles[upper], residues[upper], strict=True):
        if abs(p.imag) <= 1e-12:
            A[at, at], B[at], C[at] = p.real, 1.0, r.real
            at += 1
        else:
            A[at : at + 2, at : at + 2] = [[p.real, -p.imag], [p.imag, p.real]]
            B[at], C[at : at + 2] = 1.0, [2 * r.real, -2 * r.imag]
            at += 2
    return A, B, C, gain if zeros.size == n else 0.0


def _alike(core: Core, expected: FloatArray) -> bool:
    A, B, C, D = core
    found = markov(A, B[:, None], C[None], np.array([[D]]), expected.size)[0, 0]
    return bool(np.abs(found - expected).max() <= FAITHFUL * np.abs(expected).max())
