r"""Long records condensed to one row for each excited direction of the input.

For an output that depends on the L samples of the input before it, y = Phi g + e with white e, all
information about g is contained in the sums R = Phi^T Phi and r = Phi^T y: up to a constant

    |y - Phi g(theta)|^2 = |z - F g(theta)|^2,   R = F^T F,   z = F^-T r.

So a model of any structure can be fitted to at most L rows instead of millions of samples, without
loss. The autoregressive prewhitening filter is applied to input and output alike, which does not
change g. The past before a record only affects its first L samples, which are left out. A separate
level for every 2^17 samples removes slow drifts.

The sums are a sufficient statistic [1]_, their factor the triangle of a QR factorisation [2]_.
Outliers are downweighted as in [3]_ with the constant of [4]_.

References
----------
.. [1] S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice Hall
   1993, chapter 5 (sufficient statistics).
.. [2] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section 5.3
   (The full-rank least squares problem).
.. [3] P. J. Huber and E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, section 7.8,
   doi:10.1002/9780470434697.
.. [4] P. W. Holland and R. E. Welsch, Robust regression using iteratively reweighted least-squares,
   Comm. Statist. A 6 (1977) 813-827, doi:10.1080/03610927708827533.
.. [5] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   13.4 (A direct approach).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh
from scipy.signal import fftconvolve, lfilter

from ...arrays import ComplexArray, FloatArray
from ...constants import SMALLEST
from ...engine.responses import HeldInput, Modes, SampledInput
from ...engine.window_fit import clipped
from ...regression.normal_equations import NormalEquations, normal_equations
from ...signals.excitation import lively_start

MOST_LAGS = 1000
"""Longest response, in samples, that is condensed: time grows with its square."""
PER_LAG = 20
"""Least number of samples for each lag: as for the noise in `noise_model`."""
_PIECE = 2**17  # samples that have a level of their own, and bound the memory
_EXCITED = 1e-10  # of the strongest direction of the input; rounding is 1e-15 of it
_RIDGE = 1e-8  # of the mean square of the input: what it does not excite stays small
_OWN_PAST = (0, 1, 2, 3, 4, 6, 8, 12, 16, 25)  # samples of an output that may tell its noise
_TURNS = 5  # of Huber's steps at most, the first from least squares


@dataclass(frozen=True, eq=False)
class CondensedInput(HeldInput):
    """Factor (m, L) of the sums of products of an input at the lags 1 ... L."""

    factor: FloatArray
    dt: float

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T for a unit pulse, times the factor; see `HeldInput`."""
        pulse = np.zeros(1 + self.factor.shape[1])
        pulse[0] = 1.0
        static, mode, slope = (
            # One product of a wide matrix is several times as fast as many of narrow ones.
            np.swapaxes(np.tensordot(self.factor, each[:, 1:], axes=(1, 1)), 0, 1)
            for each in SampledInput(pulse, self.dt).modes(tau, poles)
        )
        return static, mode, slope


@dataclass(frozen=True, eq=False)
class Condensed:
    """Information of long records about a pulse response of L samples.

    Attributes
    ----------
    data : ndarray, shape (m,)
        z, with white noise of standard deviation `noise`.
    drive : CondensedInput
    noise : float
    samples : int
        Number of condensed samples.
    noise_lags : int
        Order of the autoregressive prewhitening filter.
    """

    data: FloatArray
    drive: CondensedInput
    noise: float
    samples: int
    noise_lags: int


def condensed(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    dt: float,
    lags: int,
    *,
    huber: bool,
) -> Condensed | None:
    """Condense records of one plant; None if they are too short, or not exciting.

    Parameters
    ----------
    outputs, inputs : sequence of ndarray
        One of each for every record.
    dt : float
        Sample time in s.
    lags : int
        Duration of the response in samples.
    huber : bool
        Downweight outliers of the residual of the free pulse response: one Newton step of Huber's
        loss (Huber and Ronchetti, Robust Statistics, 2nd ed., section 7.8).
    """
    if not 1 < lags <= MOST_LAGS or sum(y.size for y in outputs) < PER_LAG * lags:
        return None
    # A held input acts on the next sample at the earliest. At lag 0 there is but the controller of
    # a loop: u = K (r - y) would explain the noise.
    outputs, inputs = [y[1:] for y in outputs], [u[:-1] for u in inputs]
    whiten = _noise(outputs, inputs, lags, huber=huber)
    sums: NormalEquations | None = None
    for y, u in _pieces(outputs, inputs, lags + whiten.size - 1):
        white_y = lfilter(whiten, [1.0], y)[whiten.size - 1 :]
        white_u = lfilter(whiten, [1.0], u)[whiten.size - 1 :]
        if huber:
            # A pulse response from another part would hold at the frequencies of that part only.
            pulse = _free_pulse(white_y, white_u, lags, turns=_TURNS)
            white_y[lags - 1 :] += _pulled_in(_left(white_y, white_u, pulse))
        part = normal_equations(white_u[None], white_y[None], lags)
        sums = part if sums is None else sums + part
    if sums is None:
        return None
    power, axes = eigh(sums.gram)
    excited = power > _EXCITED * power[-1]
    root = np.sqrt(power[excited])
    factor = root[:, None] * axes[:, excited].T
    data = (axes[:, excited].T @ sums.cross[:, 0]) / root
    freedom = sums.freedom - data.size
    left = float(sums.power[0, 0] - data @ data)
    if freedom < data.size or left <= 0:
        return None
    drive = CondensedInput(factor, dt)
    noise = float(np.sqrt(left / freedom))
    return Condensed(data, drive, noise, sums.rows, whiten.size - 1)


def _noise(
    outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], lags: int, *, huber: bool
) -> FloatArray:
    """Autoregressive noise model, leading 1 included, of the longest record where its input moves.

    The output is regressed on the input and its own past at once, of which the length is chosen by
    BIC: in a loop a pulse response alone explains noise, as far as the input answers it [5]_.
    """
    longest = int(np.argmax([y.size for y in outputs]))
    y, u = outputs[longest], inputs[longest]
    count = min(y.size, _PIECE)
    start = lively_start(u[None], count)
    y, u = (x[start : start + count] - np.mean(x[start : start + count]) for x in (y, u))
    pulled, orders = y, [own for own in _OWN_PAST if own <= lags]
    for _ in range(_TURNS if huber else 1):
        sums = normal_equations(np.stack([u[1:], pulled[:-1]]), pulled[None, 1:], lags)
        fits = {own: _regressed(sums.take(range(lags + own)), lags) for own in orders}
        value = {
            own: sums.rows * np.log(fit[1]) + own * np.log(sums.rows) for own, fit in fits.items()
        }
        orders = [min(orders, key=value.__getitem__)]
        found = fits[orders[0]][0]
        whiten = np.append(1.0, -found[lags:])
        pulled, white = y.copy(), lfilter(whiten, [1.0], y)[lags:]
        pulled[lags:] += _pulled_in(white - fftconvolve(u[1:], found[:lags], "valid"))
    return whiten


def _regressed(sums: NormalEquations, lags: int) -> tuple[FloatArray, float]:
    """Coefficients by least squares, of so many lags of the input first, and the squares left."""
    # Directions that the input does not excite stay small; where it rests all are.
    ridge = np.full(len(sums.gram), SMALLEST)
    ridge[:lags] = max(_RIDGE * float(np.trace(sums.gram[:lags, :lags])) / lags, SMALLEST)
    found = np.linalg.solve(sums.gram + np.diag(ridge), sums.cross[:, 0])
    left = float(sums.power[0, 0] - sums.cross[:, 0] @ found)
    return np.asarray(found, dtype=np.float64), max(left, SMALLEST)


def _left(y: FloatArray, u: FloatArray, pulse: FloatArray) -> FloatArray:
    """What a pulse response leaves of an output, from its last lag on."""
    return np.asarray(y[pulse.size - 1 :] - fftconvolve(u, pulse, "valid"))


def _free_pulse(y: FloatArray, u: FloatArray, lags: int, turns: int) -> FloatArray:
    """Free pulse response by least squares, and Huber's steps from the second turn on."""
    pulled = y
    for turn in range(turns):
        pulse, _ = _regressed(normal_equations(u[None], pulled[None], lags), lags)
        if turn + 1 < turns:
            pulled = y.copy()
            pulled[lags - 1 :] += _pulled_in(_left(y, u, pulse))
    return pulse


def _pieces(
    outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], past: int
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Segments of all records, each with the past that its first row needs."""
    for y, u in zip(outputs, inputs, strict=True):
        if y.size <= 2 * past:
            continue
        rows = y.size - past + 1
        count = -(-rows // _PIECE)
        bounds = np.linspace(0, rows, count + 1).astype(int).tolist()
        for first, last in pairwise(bounds):
            yield y[first : last + past - 1], u[first : last + past - 1]


def _pulled_in(error: FloatArray) -> FloatArray:
    """Change of an output for which its least-squares fit is that of Huber's loss."""
    centred = error - np.median(error)
    return np.asarray(clipped(centred, 0.0) - centred)
