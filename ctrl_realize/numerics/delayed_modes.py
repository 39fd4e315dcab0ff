"""Responses of first-order modes to a delayed, held input, and their derivatives.

The response of a rational transfer function with distinct poles ``p_j`` to an input that moves
by ``d_l`` at ``t_l`` and holds in between is a sum of

    H(t)   = sum_l d_l                                   (the static part)
    E_j(t) = sum_l d_l exp(p_j (t - t_l - tau))

over the moves that have arrived, t > t_l + tau. Derivatives need dE_j/dp_j in addition:

    T_j(t) = sum_l d_l (t - t_l - tau) exp(p_j (t - t_l - tau)).

`MoveTrain` evaluates them at any times for a few moves (steps, ramps), many delays and pole
sets at once; `SampledInput` does it for a long measured signal, by recursion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from scipy.signal import lfilter

from .arrays import ComplexArray, FloatArray

Modes: TypeAlias = tuple[FloatArray, ComplexArray, ComplexArray]
"""H (B, m), E (B, m, J) and T (B, m, J)."""


class HeldInput(Protocol):
    """An input that is constant between its moves."""

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T for delays (B,) and poles (B, J)."""
        ...


@dataclass(frozen=True, eq=False)
class MoveTrain:
    """A few moves of the input, and the times at which the response is wanted.

    Attributes
    ----------
    times : ndarray, shape (m,)
        In s.
    spread : ndarray, shape (m,)
        The response is averaged over ``times - spread`` and ``times + spread``. With
        ``spread = dt sqrt((w^2 - 1) / 12)`` that is the mean over w samples, exact for cubics.
    moves, sizes : ndarray, shape (L,)
        When, and by how much, the input moves.
    """

    times: FloatArray
    spread: FloatArray
    moves: FloatArray
    sizes: FloatArray

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T at the times; see `HeldInput`."""
        wide = np.flatnonzero(self.spread)
        nodes = np.concatenate([self.times - self.spread, (self.times + self.spread)[wide]])
        static = np.zeros((tau.size, nodes.size))
        mode = np.zeros((tau.size, nodes.size, poles.shape[1]), dtype=np.complex128)
        slope = np.zeros_like(mode)
        # Real exponentials cost a third of complex ones.
        rates = poles if np.any(poles.imag) else poles.real
        for move, size in zip(self.moves, self.sizes, strict=True):
            elapsed = nodes - move - tau[:, None]
            arrived = size * (elapsed > 0)
            elapsed = np.maximum(elapsed, 0.0)[:, :, None]
            part = np.exp(elapsed * rates[:, None, :]) * arrived[:, :, None]
            static += arrived
            mode += part
            slope += elapsed * part
        m = self.times.size
        for values in (static, mode, slope):
            values[:, wide] = 0.5 * (values[:, wide] + values[:, m:])
        return static[:, :m], mode[:, :m], slope[:, :m]


@dataclass(frozen=True, eq=False)
class SampledInput:
    """A sampled, held input (N,), rest level removed; the response is wanted at each sample."""

    signal: FloatArray
    dt: float

    def modes(self, tau: FloatArray, poles: ComplexArray) -> Modes:
        """Evaluate H, E and T at every sample; see `HeldInput`."""
        n = self.signal.size
        moves = np.diff(self.signal, prepend=0.0)
        static = np.zeros((tau.size, n))
        mode = np.zeros((tau.size, n, poles.shape[1]), dtype=np.complex128)
        slope = np.zeros_like(mode)
        for b in range(tau.size):
            # A move at sample l is first seen at the first sample after l + tau/dt.
            whole = int(np.ceil(tau[b] / self.dt - 1e-9))
            if whole >= n:
                continue
            rest = max(whole * self.dt - tau[b], 0.0)
            static[b, whole:] = self.signal[: n - whole]
            for j, pole in enumerate(poles[b]):
                z = np.exp(pole * self.dt)
                sums = lfilter([1.0], [1.0, -z], moves[: n - whole].astype(np.complex128))
                # d(z^k)/dp = k dt z^k: a second pass of the same recursion.
                weighted = lfilter([0.0, z * self.dt], [1.0, -z], sums)
                gain = np.exp(pole * rest)
                mode[b, whole:, j] = gain * sums
                slope[b, whole:, j] = gain * (weighted + rest * sums)
        return static, mode, slope
