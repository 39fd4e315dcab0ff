"""Response of modes to a long sampled input, as means over equal blocks of samples.

The mean of a response over a block is the response to the running mean of the input at the end of
the block. Between two ends a mode decays by z^K, K samples, and gains

    sum over j < K of z^j d(end - j),    z = exp(p dt),

where d is the change of that running mean. As a function of sqrt(j), z^j is smooth: it is replaced
by its interpolant at 16 Chebyshev points [1]_, so that sums over the samples are formed once, not
for every pole. It is off by 1e-14 for a time constant of a block, 1e-7 for a tenth of it, 4e-5 for
a thirtieth; up to 16 samples are not interpolated. With eight points a fast pole made the sum of
squares jump at samples so much that Newton's method failed. Dead times need not be whole blocks.

References
----------
.. [1] L. N. Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, chapters 4, 8,
   doi:10.1137/1.9781611975949.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.signal import lfilter

from ...arrays import ComplexArray, FloatArray
from ...engine.responses import TOGETHER, HeldInput, Modes

_NODES = 16
_MOST_KEPT = 2**23  # numbers of all sums that are kept, to limit the memory


@dataclass(frozen=True, eq=False)
class AveragedInput(HeldInput):
    """A sampled, held input (N,) without its baseline; the response is needed as means.

    Attributes
    ----------
    signal : ndarray, shape (N,)
    dt : float
        Sample time in s.
    every : int
        Samples in a block; a last part of one is left out.
    width : int
        Samples of every block, from its first one on, of which the mean is needed.
    """

    signal: FloatArray
    dt: float
    every: int
    width: int

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T for every block; see `HeldInput`."""
        count = self.signal.size // self.every
        rates = poles if poles.imag.any() else poles.real
        static = np.zeros((tau.size, count))
        mode = np.zeros((tau.size, count, poles.shape[1]), dtype=rates.dtype)
        slope = np.zeros_like(mode)
        since = self.dt * self._nodes[0]
        block = self.dt * self.every
        for b in range(tau.size):
            whole = int(np.ceil(tau[b] / self.dt - TOGETHER))
            late, shift = divmod(whole, self.every)
            if late >= count:
                continue
            rest = max(whole * self.dt - tau[b], 0.0)
            level, sums = self._sums(shift)
            static[b, late:] = level[: count - late]
            gained = np.exp(np.outer(since, rates[b]))
            inside = sums[: count - late] @ gained
            turned = sums[: count - late] @ (since[:, None] * gained)
            for j, pole in enumerate(rates[b]):
                decay = np.exp(pole * block)
                mode[b, late:, j] = total = lfilter([1.0], [1.0, -decay], inside[:, j])
                turned[1:, j] += block * decay * total[:-1]
                slope[b, late:, j] = lfilter([1.0], [1.0, -decay], turned[:, j])
            slope[b] += rest * mode[b]
            gain = np.exp(rates[b] * rest)
            mode[b] *= gain
            slope[b] *= gain
        return static, mode, slope

    @cached_property
    def _nodes(self) -> tuple[FloatArray, FloatArray]:
        """Samples before the end of a block, and the weight of each in its samples (K, nodes)."""
        samples = np.arange(self.every, dtype=np.float64)
        if self.every <= _NODES:
            return samples, np.eye(self.every)[::-1]
        roots = (1 - np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)) / 2
        part = np.sqrt(samples[::-1] / samples[-1])
        weights = BarycentricInterpolator(roots, np.eye(_NODES))(part)
        return samples[-1] * roots**2, np.asarray(weights)

    @cached_property
    def _running(self) -> FloatArray:
        """Mean of the last `width` samples of the input, which was 0 before."""
        if self.width == 1:
            return self.signal
        total = np.cumsum(self.signal)
        total[self.width :] -= total[: -self.width].copy()
        return total / self.width

    @cached_property
    def _kept(self) -> dict[int, tuple[FloatArray, FloatArray]]:
        return {}

    def _sums(self, shift: int) -> tuple[FloatArray, FloatArray]:
        """Running mean (M,) and sums of its changes (M, nodes), `shift` samples later."""
        if shift not in self._kept:
            count = self.signal.size // self.every
            before = np.zeros(self.every - self.width + shift + 1)
            late = np.concatenate([before, self._running])[: count * self.every + 1]
            moves = np.diff(late).reshape(count, self.every)
            while len(self._kept) * count * (_NODES + 1) > _MOST_KEPT:
                self._kept.pop(next(iter(self._kept)))
            level = late[self.every :: self.every].copy()
            self._kept[shift] = level, moves @ self._nodes[1]
        return self._kept[shift]
