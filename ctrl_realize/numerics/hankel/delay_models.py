"""Kung's realization after one delay, or after every delay of a range.

Glue between the Hankel matrix of shifted Markov parameters, the solver that
fits its size, and the state-space formulas.

References
----------
.. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of valve
   dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 2.1.
.. [2] S. Y. Kung, A new identification and model reduction algorithm via singular value
   decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray, IntArray
from .iae import integrated_absolute_error
from .kung import realize_block, realize_symmetric, tail_bound
from .lanczos import leading_eigenpairs
from .matrix import hankel_norm_squared
from .svd import leading_triplets

COMPLETE_SIZE = 200
"""Shorter side of a Hankel matrix up to which one realization computes all singular values."""

SCAN_TOL = 3e-10
"""Residual of the wanted pairs in a delay scan. Poles near the unit circle magnify it over a
thousand samples: for 12 noisy records, 101 delays and 8 orders the IAE is then within a tenth of
the stated accuracy (1e-11 of the data plus 1e-9 of the IAE)."""

GROUP_BYTES = 64e6
"""Memory for the eigenvectors of the delays that are computed together."""


@dataclass(frozen=True, eq=False)
class DelayModels:
    """State-space models without their delays, one for each candidate delay.

    Attributes
    ----------
    A, B, C : ndarray, shapes (D, k, k), (D, k, m), (D, p, k)
        The leading j states are the model of order j.
    singular_values : ndarray, shape (D, k)
        Zero beyond the numerical rank.
    following : ndarray, shape (D,)
        Estimate of singular value k + 1.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    singular_values: FloatArray
    following: FloatArray


@dataclass(frozen=True, eq=False)
class OneModel:
    """State-space model after one delay.

    Attributes
    ----------
    A, B, C : ndarray, shapes (k, k), (k, m), (p, k)
    singular_values : ndarray
        All of them if `complete`, otherwise the leading k.
    following : float
        Singular value k + 1, or an estimate of it.
    rest_bound : float
        Upper bound of twice the sum of the singular values beyond k.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    singular_values: FloatArray
    following: float
    rest_bound: float


def hankel_size(samples: int, *, padded: bool) -> int:
    """Return the number of block rows for `samples` parameters after the feedthrough.

    The paper's square matrix has floor(samples / 2): its shifted version
    then just uses all samples. The zero-padded one has as many as samples.
    """
    return samples if padded else samples // 2


def realize_at(
    markov: FloatArray, delay: int, samples: int, order: int, *, padded: bool, tol: float = 1e-12
) -> OneModel:
    """Realize the Markov parameters after one delay.

    Parameters
    ----------
    markov : ndarray, shape (p, m, N), N > delay + samples
    delay, samples, order : int
        Parameters ``delay + 1 ... delay + samples`` are used.
    padded : bool
        Zero-padded Hankel matrix instead of the square one.
    tol : float
        Residual relative to the smallest wanted singular value.
    """
    p, m, _ = markov.shape
    size = hankel_size(samples, padded=padded)
    h = markov[:, :, delay + 1 : delay + 1 + samples]
    known = h if padded else h[:, :, : 2 * size - 1]
    if p == m == 1 and size > COMPLETE_SIZE:
        one = np.array([delay])
        models = realize_at_delays(markov, one, samples, order, padded=padded, tol=tol)
        A, B, C, values = models.A[0], models.B[0], models.C[0], models.singular_values[0]
        following = float(models.following[0])
    else:
        found = leading_triplets(known, size, size, order, tol=tol)
        last = None if padded else h[:, :, size : 2 * size].transpose(0, 2, 1).reshape(p, -1)
        A, B, C = realize_block(found.U, found.values, found.V, (p, m), last)
        values, following = found.values, float(found.others[0]) if found.others.size else 0.0
        if found.complete:
            values = np.concatenate([values, found.others])
            return OneModel(A, B, C, values, following, 2.0 * float(found.others.sum()))
    bound = tail_bound(hankel_norm_squared(known, size, size), values, size * min(p, m))
    return OneModel(A, B, C, values, following, bound)


def realize_at_delays(
    markov: FloatArray,
    delays: IntArray,
    samples: int,
    order: int,
    *,
    padded: bool,
    tol: float = SCAN_TOL,
) -> DelayModels:
    """Realize the Markov parameters after each of several delays.

    Parameters
    ----------
    markov : ndarray, shape (p, m, N), N > delays.max() + samples
    delays : ndarray of int, shape (D,)
    samples, order, padded, tol
        See `realize_at`.
    """
    p, m, _ = markov.shape
    if p == m == 1:
        return _single_channel(markov[0, 0], delays, samples, order, padded, tol)
    models = [realize_at(markov, int(d), samples, order, padded=padded, tol=tol) for d in delays]
    A, B, C = (np.stack([getattr(model, letter) for model in models]) for letter in "ABC")
    values = np.stack([model.singular_values[:order] for model in models])
    return DelayModels(A, B, C, values, np.array([model.following for model in models]))


def _single_channel(
    markov: FloatArray, delays: IntArray, samples: int, order: int, padded: bool, tol: float
) -> DelayModels:
    size = hankel_size(samples, padded=padded)
    windows = np.lib.stride_tricks.sliding_window_view(markov, samples)
    found = []
    group = max(1, int(GROUP_BYTES // (8 * size * order)))
    for start in range(0, delays.size, group):
        h = windows[delays[start : start + group] + 1]
        pairs = leading_eigenpairs(h if padded else h[:, : 2 * size - 1], size, order, tol=tol)
        last = None if padded else h[:, size : 2 * size]
        A, B, C = realize_symmetric(pairs.values, pairs.vectors, last)
        found.append((A, B[:, :, None], C[:, None], np.abs(pairs.values), pairs.following))
    return DelayModels(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def iae_of_models(
    markov: FloatArray, delays: IntArray, models: DelayModels, order: int, feedthrough: FloatArray
) -> FloatArray:
    """Integrated absolute error of all models of one order, over all channels.

    Parameters
    ----------
    markov : ndarray, shape (p, m, W)
        The window: all of it, the same for every delay.
    delays : ndarray of int, shape (D,)
    models : DelayModels
    order : int
        Number of leading states that are used.
    feedthrough : ndarray, shape (D, p, m)

    Returns
    -------
    ndarray, shape (D,)
    """
    A = models.A[:, :order, :order]
    total = np.zeros(delays.size)
    for i in range(markov.shape[0]):
        for j in range(markov.shape[1]):
            channel = A, models.B[:, :order, j], models.C[:, i, :order], feedthrough[:, i, j]
            total += integrated_absolute_error(markov[i, j], delays, channel)
    return total
