"""Starting values of a rational fit: vector fitting, phase slope, and sets of poles.

For low orders the poles are found by a linear problem at each dead time of a grid. Higher orders
extend lower ones by a pole or a resonance at a time, placed where it explains most of the residual:
over decades of frequency and for many resonances the linear problem alone leads to poor local
minima, especially with noise.

The linear problem is one step of vector fitting [1]_, which is that of [2]_ in partial fractions.
The start of the search for a dead time and the number of starts are our own rule.

References
----------
.. [1] B. Gustavsen and A. Semlyen, Rational approximation of frequency domain responses by vector
   fitting, IEEE Trans. Power Delivery 14 (1999) 1052-1061, doi:10.1109/61.772353.
.. [2] C. K. Sanathanan and J. Koerner, Transfer function synthesis as a ratio of two complex
   polynomials, IEEE Trans. Automat. Control 8 (1963) 56-58, doi:10.1109/TAC.1963.1105517.
"""

from __future__ import annotations

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.eliminate import eliminate
from ..engine.modal import parameters_from_poles
from ..engine.problem import Structure
from ..engine.structures import Candidate, parameter_bounds
from .frf_data import FRFData
from .phase import phase_roughness


def trial_poles(low: float, high: float, order: int, *, resonant: bool) -> ComplexArray:
    """Spread stable poles logarithmically over a band in rad/s."""
    if order == 1:
        return np.array([-np.sqrt(low * high)], dtype=np.complex128)
    if not resonant:
        return -np.geomspace(low, high, order).astype(np.complex128)
    centres = np.geomspace(low, high, order // 2 + order % 2)
    pairs = centres[order % 2 :]
    poles = np.ravel([(-0.05 + 1j) * pairs, (-0.05 - 1j) * pairs])
    return np.concatenate([poles, -centres[: order % 2].astype(np.complex128)])


def relocate_poles(
    s: ComplexArray, responses: ComplexArray, weight: FloatArray, poles: ComplexArray
) -> ComplexArray:
    """Move poles towards those of responses: one step of vector fitting, of each on its own.

    The linear problem ``N(s) - sigma(s) H(s) = H(s)`` is that of Sanathanan and Koerner, written
    in partial fractions (Gustavsen and Semlyen 1999); the zeros of ``1 + sigma`` are the new
    poles. Unstable ones are mirrored.

    Parameters
    ----------
    s : ndarray, shape (K,)
    responses : ndarray, shape (B, K)
    weight : ndarray, shape (K,)
    poles : ndarray, shape (B, n)
        Stable; conjugates are neighbours, an odd one comes first.

    Returns
    -------
    ndarray, shape (B, n)
        In the same order.
    """
    batch, n = poles.shape
    first = np.arange(n % 2, n, 2)
    p, q = poles[:, first], poles[:, first + 1]
    mean, root, size = (p + q).real / 2, ((p - q) ** 2).real / 4, np.abs(p)
    # (s - mean) and size, over (s - p) (s - q): real coefficients of both kinds of pairs.
    A, b = np.zeros((batch, n, n)), np.ones(n)
    A[:, first, first] = A[:, first + 1, first + 1] = mean
    A[:, first, first + 1], A[:, first + 1, first], b[first + 1] = root / size, size, 0.0
    fractions = np.empty((batch, s.size, n), dtype=np.complex128)
    from_mean = s[:, None] - mean[:, None]
    bottom = from_mean**2 - root[:, None]
    fractions[:, :, first], fractions[:, :, first + 1] = from_mean / bottom, size[:, None] / bottom
    if n % 2:
        A[:, 0, 0] = poles[:, 0].real
        fractions[:, :, 0] = 1 / (s - A[:, :1, 0])
    design = np.concatenate([fractions, -responses[:, :, None] * fractions], axis=2)
    columns = np.append(design, responses[:, :, None], axis=2) * weight[:, None]
    stacked = np.concatenate([columns.real, columns.imag], axis=1)
    scale = np.linalg.norm(stacked[:, :, :-1], axis=1)
    inverse = np.linalg.pinv(stacked[:, :, :-1] / scale[:, None], rcond=1e-12)
    sigma = ((inverse @ stacked[:, :, -1:])[:, :, 0] / scale)[:, n:]
    # New poles: eigenvalues of A - b c' (Gustavsen and Semlyen, appendix on zeros of sigma).
    moved = np.linalg.eigvals(A - b[:, None] * sigma[:, None]).astype(np.complex128)
    # Keep a distance from the axis: a pole on it would make the next problem singular.
    floor = 1e-4 * np.abs(moved) + 1e-12 * np.abs(s).max()
    return _in_pairs(-np.maximum(np.abs(moved.real), floor) + 1j * moved.imag)


def _in_pairs(poles: ComplexArray) -> ComplexArray:
    """Poles (B, n) in an order in which conjugates are neighbours, real ones first."""
    order = np.lexsort((poles.imag, np.abs(poles.imag), poles.real, poles.imag != 0), axis=1)
    return np.take_along_axis(poles, order, axis=1)


_RELOCATIONS = 8  # time; of 220 starts for a valve and a motor 165 had converged before
_MAX_STARTS, _MAX_DELAYS, _MAX_TRIED = 4, 64, 4000
"""Minima over the dead time that are refined, dead times for which poles are sought, and dead times
whose remaining phase is computed: time. They cost a fit, a linear problem and a sum each."""
_PER_TURN = 4  # dead times in a turn of the phase at the top: two for every minimum of the misfit
_POINTS_BELOW = 8  # points in the lowest band: an order of 3 and a dead time need 7 coefficients
_DAMPINGS = (0.01, 0.1, 0.6)  # of an added pair, a decade apart: the fit moves it
_GRID, _PEAKS = 16, 8
"""Frequencies at which poles are added: spread over the band, and peaks of the misfit. Time."""
_KEPT = 2  # extensions that are refined: time


def delay_grid(data: FRFData, order: int) -> FloatArray:
    """Spread candidate dead times, so closely that no minimum is missed.

    The misfit has a minimum about every half turn of the phase at the highest frequency. If the
    band is wide, a slow lag allows a dead time of hundreds of turns, over six decades of millions;
    but for a dead time that is wrong by many turns the remaining phase is more than poles and zeros
    can have, and such candidates are left out.
    """
    top = float(np.abs(data.s).max())
    count = max(int(np.ceil(_PER_TURN * data.max_dead_time * top / (2 * np.pi))), 6)
    if count < _MAX_DELAYS:
        return np.linspace(0.0, data.max_dead_time, count + 1)
    clear = data.clear
    omega, values = np.abs(data.s[clear]), data.response[clear]
    steps, gaps = np.angle(values[1:] / values[:-1]), np.diff(omega)
    allowed = np.pi * (2 * order + 2)
    # How far below the highest frequency the search with so many dead times starts.
    wanted = int(np.ceil(np.log2(max(count / _MAX_TRIED, 1.0))))
    octaves = min(wanted, int(np.log2(omega[-1] / _lowest_start(omega))))
    # In the lower part of the band few candidates cover all dead times; the remaining ones are
    # divided in two for every further octave.
    first = min(-(-count // 2**octaves), _MAX_TRIED)
    delays, spacing = np.linspace(0.0, data.max_dead_time, first + 1), data.max_dead_time / first
    for octave in range(octaves, 0, -1):
        below = np.count_nonzero(omega <= top / 2**octave) - 1
        left = phase_roughness(steps[:below], gaps[:below], delays)
        kept = _smoothest(delays, left, allowed, _MAX_TRIED // 2)
        spacing /= 2
        places = np.round(kept / spacing)
        places = np.unique(np.concatenate([places - 1, places, places + 1]))
        delays = np.clip(spacing * places, 0.0, data.max_dead_time)
    left = phase_roughness(steps, gaps, delays)
    return np.sort(_smoothest(delays, left, allowed, _MAX_DELAYS))


def longest_search(omega: FloatArray) -> float:
    """Return the longest dead time, in s, that candidates can cover for increasing frequencies."""
    return 2 * np.pi * _MAX_TRIED / (_PER_TURN * _lowest_start(omega))


def _lowest_start(omega: FloatArray) -> float:
    """Return the frequency up to which there are enough points to distinguish dead times."""
    return float(omega[min(_POINTS_BELOW, omega.size) - 1])


def _smoothest(delays: FloatArray, left: FloatArray, allowed: float, most: int) -> FloatArray:
    """Return the dead times with nearly the smallest remaining phase, the best first."""
    possible = np.flatnonzero(left <= left.min() + allowed)
    return np.asarray(delays[possible[np.argsort(left[possible], kind="stable")][:most]])


def starting_points(data: FRFData, order: int, delays: FloatArray) -> list[FloatArray]:
    """Find poles for each candidate dead time, and keep the candidates worth refining.

    For a fixed dead time the problem is linear except for a few pole relocations, which need no
    initial guess. The minima of the misfit over the grid of dead times come first, so the
    maximum-likelihood fit needs no initial guess either.
    """
    low, high = data.omega.min(), data.omega.max()
    turned = data.response * np.exp(np.multiply.outer(delays, data.s))
    kinds = []
    for resonant in (False, True)[: max(order, 1)]:
        trial = trial_poles(low, high, order, resonant=resonant)
        poles = _in_pairs(np.tile(trial, (delays.size, 1)))
        moving = np.arange(delays.size * min(order, 1))
        for _ in range(_RELOCATIONS):
            if not moving.size:
                break
            new = relocate_poles(data.s, turned[moving], data.weight, poles[moving])
            change = np.abs(np.sort(new, axis=1) - np.sort(poles[moving], axis=1)) / np.abs(new)
            poles[moving], moving = new, moving[change.max(axis=1) >= 1e-3]
        kinds.append(poles)
    found = [
        np.append(delay, parameters_from_poles(poles[k]))
        for k, delay in enumerate(delays)
        for poles in kinds
    ]
    starts, cost = _costs(data, order, found)
    # Two for each dead time, from lags and from resonances; one for a single pole.
    both = cost.reshape(delays.size, -1)
    curve = both.min(axis=1)
    chosen = starts.reshape(*both.shape, -1)[np.arange(delays.size), both.argmin(axis=1)]
    padded = np.concatenate([[np.inf], curve, [np.inf]])
    minima = np.flatnonzero((padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]))
    return [*chosen[minima[np.argsort(curve[minima])][:_MAX_STARTS]]]


def grown_starts(data: FRFData, smaller: Candidate, order: int) -> list[FloatArray]:
    """Add one or two poles to a fit where they remove most of its misfit.

    Parameters
    ----------
    data : FRFData
    smaller : Candidate
        With one or two poles fewer than `order`.
    order : int
    """
    omega = data.omega
    places = np.geomspace(omega.min(), omega.max(), _GRID)
    places = np.concatenate([places, _peaks(omega, data.misfit(smaller))])
    added: list[list[complex]]
    if order - smaller.structure.order == 1:
        added = [[-w] for w in places]
    else:
        turned = [w * complex(-z, np.sqrt(1 - z * z)) for w in places for z in _DAMPINGS]
        added = [[p, p.conjugate()] for p in turned]
    poles = data.poles_to_grow(smaller)
    trials = [
        np.append(smaller.dead_time, parameters_from_poles(np.append(poles, more)))
        for more in added
    ]
    starts, cost = _costs(data, order, trials)
    return [*starts[np.argsort(cost, kind="stable")[:_KEPT]]]


def _costs(data: FRFData, order: int, starts: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Starts (B, 1 + n) within bounds, and their misfit with a free numerator (B,)."""
    free = Structure(order, min(order, 1))
    bounds = parameter_bounds(free, data.scales)
    inside = np.clip(starts, bounds.low, bounds.high)
    return inside, eliminate(data.problem, free, inside).cost


def _peaks(omega: FloatArray, misfit: ComplexArray) -> FloatArray:
    """Return the frequencies around which most of the misfit remains."""
    power = np.abs(misfit) ** 2
    width = min(5, omega.size)
    smooth = np.convolve(power, np.ones(width), mode="same")
    rising = np.concatenate([[True], smooth[1:] >= smooth[:-1]])
    falling = np.concatenate([smooth[:-1] >= smooth[1:], [True]])
    tops = np.flatnonzero(rising & falling)
    return np.asarray(omega[tops[np.argsort(smooth[tops])[::-1][:_PEAKS]]])
