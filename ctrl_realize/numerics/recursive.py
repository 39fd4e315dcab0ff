"""Least squares with forgetting for a whole range of delays, sample by sample.

The regressors phi[k] come from the input alone, so those of delay d are the same numbers d samples
later: ``R_d[k] = sum lambda^(k-i) phi[i-d] phi[i-d]^T = R_0[k-d]``. One Gram matrix and its past
serve all candidates, and a candidate costs one scaled vector sum a sample. Nothing is solved
until somebody asks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import FloatArray


@dataclass(frozen=True, eq=False)
class BankSolution:
    """Least squares of every candidate over the forgetting window.

    ``theta`` (D, q) minimizes ``misfit`` (D,) = weighted squares of the residual plus those of
    the distance to the prior; `offset` (D,) is the constant of y; ``inverse`` (D, q, q) the
    inverse of the normal matrix, so that the covariance is noise variance times it; `power` is
    the weighted sum of squares of y about its mean, `weight` the sum of the weights.
    """

    theta: FloatArray
    misfit: FloatArray
    offset: FloatArray
    inverse: FloatArray
    power: float
    weight: float


class DelayBank:
    """Exponentially weighted sums for regressors behind every delay low...high.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n,), (q, n), (q,)
        System from the input to the q regressors, at rest before the first sample.
    low, high : int
        Candidate delays, in samples.
    forgetting : float
        Factor lambda by which a sample's weight falls from one sample to the next.
    """

    def __init__(
        self,
        A: FloatArray,
        B: FloatArray,
        C: FloatArray,
        D: FloatArray,
        low: int,
        high: int,
        forgetting: float,
    ) -> None:
        q, n = C.shape
        self.low, self.high, self.forgetting = low, high, forgetting
        # One product a sample gives the next state and the regressors.
        self._step = np.block([[A, B[:, None]], [C, D[:, None]]])
        self._state = np.zeros(n + 1)
        self._n = n
        depth = high + 1
        self._depth = depth
        self._slot = 0
        # Written twice, so that the last `depth` rows always lie side by side.
        self._phi = np.zeros((2 * depth, q))
        self._gram = np.zeros((2 * depth, q, q))
        self._sums = np.zeros((2 * depth, q))
        self._cross = np.zeros((high - low + 1, q))
        self._last_gram = np.zeros((q, q))
        self._last_sums = np.zeros(q)
        self.weight = self.weight_squared = self._total = self._power = 0.0

    def update(self, u: float, y: float) -> None:
        """Take in one sample; the cost does not depend on how many came before."""
        keep, depth = self.forgetting, self._depth
        self._state[-1] = u
        out = self._step @ self._state
        self._state[: self._n] = out[: self._n]
        phi = out[self._n :]
        self._last_gram = keep * self._last_gram + phi[:, None] * phi
        self._last_sums = keep * self._last_sums + phi
        slot = self._slot
        for ring, value in (
            (self._phi, phi),
            (self._gram, self._last_gram),
            (self._sums, self._last_sums),
        ):
            ring[slot] = ring[slot + depth] = value
        self._slot = (slot + 1) % depth
        self._cross *= keep
        self._cross += y * self._past(self._phi, slot)
        self.weight = keep * self.weight + 1.0
        self.weight_squared = keep**2 * self.weight_squared + 1.0
        self._total = keep * self._total + y
        self._power = keep * self._power + y * y

    def _past(self, ring: FloatArray, slot: int) -> FloatArray:
        """Rows of low...high samples ago, in this order."""
        newest = slot + self._depth
        # Rows newest-high ... newest-low, turned around.
        return ring[newest - self.high : newest - self.low + 1][::-1]

    def predict(self, delay: int, theta: FloatArray) -> float:
        """Return the response of one candidate to the input so far, without the offset."""
        slot = (self._slot - 1) % self._depth
        return float(self._phi[slot + self._depth - delay] @ theta)

    def solve(self, prior: FloatArray, precision: FloatArray) -> BankSolution:
        """Solve for every candidate, with ``(theta - prior)^T diag(precision) (theta - prior)``
        added to the weighted squares.
        """
        slot = (self._slot - 1) % self._depth
        sums = self._past(self._sums, slot)
        gram = self._past(self._gram, slot) - sums[:, :, None] * sums[:, None, :] / self.weight
        cross = self._cross - sums * (self._total / self.weight)
        power = max(self._power - self._total**2 / self.weight, 0.0)
        # An input that never moved leaves zeros; the floor is far below any information.
        floor = 1e-13 * float(np.einsum("dii->di", gram).max(initial=0.0)) or 1.0
        precision = np.maximum(precision, floor)
        matrix = gram + np.diag(precision)
        inverse = np.linalg.inv(matrix)
        right = cross + precision * prior
        theta = np.einsum("dij,dj->di", inverse, right)
        misfit = power + prior @ (precision * prior) - np.einsum("di,di->d", theta, right)
        offset = (self._total - np.einsum("di,di->d", sums, theta)) / self.weight
        least: FloatArray = np.maximum(misfit, 0.0)
        return BankSolution(
            theta, least, offset, np.asarray(inverse, np.float64), power, self.weight
        )


def pole_directions(poles: FloatArray, dt: float) -> list[tuple[str, complex, complex]]:
    """Name the ways in which stable poles can move: (what, pole, change of the pole per unit).

    A real pole has its ``"speed"`` (relative change of its time constant's inverse); a pair has
    ``"speed"`` and ``"damping"`` (change of the damping ratio), stated for the member with
    positive imaginary part. Poles at 1, at 0 and on the negative axis have no such direction.
    """
    found: list[tuple[str, complex, complex]] = []
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
    A: FloatArray,
    B: FloatArray,
    C: FloatArray,
    D: float,
    directions: list[tuple[str, complex, complex]],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Build the system from u to the core's output w and to its change along each direction.

    Moving a pole p of the factored transfer function by dp, gain at frequency 0 kept, multiplies
    it by ``1 + dp / (z - p) - dp / (1 - p)``; a pair moves together.

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
