"""Misfit of many models at once: integrated absolute error.

Model responses come from block powers: ``C A^(i + L j) B`` is the product of
``[C; C A; ...; C A^(L-1)]`` and ``[B, A^L B, ...]``, both built by doubling.
No eigenvectors are needed, so defective and unstable models are fine, and no
transfer function, whose coefficients lose all digits at order 10.

References
----------
.. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of valve
   dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 2.1, the delay of least
   integrated absolute error.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray, IntArray, Matrices, block_powers


def markov_stack(A: FloatArray, B: FloatArray, C: FloatArray, count: int) -> FloatArray:
    """Compute ``C B, C A B, ...`` for many models.

    Parameters
    ----------
    A, B, C : ndarray, shapes (D, k, k), (D, k), (D, k)
    count : int
        Number of parameters.

    Returns
    -------
    ndarray, shape (D, count)
        Not finite if an unstable model exceeds the range of floats.
    """
    models = len(B)
    block = 1 << max(0, int(np.ceil(0.5 * np.log2(max(count, 1)))))
    rows, power = block_powers(C[:, None], A, block)
    needed = -(-count // block)
    columns, _ = block_powers(B[:, None], power.transpose(0, 2, 1), needed)
    response: FloatArray = np.matmul(columns[:, :, 0], rows[:, :, 0].transpose(0, 2, 1))
    return response.reshape(models, -1)[:, :count]


def integrated_absolute_error(markov: FloatArray, delays: IntArray, models: Matrices) -> FloatArray:
    """Sum ``|G[k] - model[k]|`` over one fixed window for models with delays.

    Parameters
    ----------
    markov : ndarray, shape (W,)
        Markov parameters; the window is all of them, the same for every
        delay. (A window that starts at the delay would let a large delay
        skip the onset, where the misfit is.)
    delays : ndarray of int, shape (D,)
        Delay of each model in samples.
    models : tuple (A, B, C, D)
        Arrays of shapes (D, k, k), (D, k), (D, k), (D,).

    Returns
    -------
    ndarray, shape (D,)
        Infinite for models whose response exceeds the range of floats.
    """
    A, B, C, D = models
    window = markov.size
    with np.errstate(over="ignore", invalid="ignore"):
        difference = markov_stack(A, B, C, window - 1 - int(delays.min()))
        for row, delay in zip(difference, delays.tolist(), strict=True):
            row[: window - 1 - delay] -= markov[delay + 1 :]
            row[window - 1 - delay :] = 0.0  # a model with a long delay extends beyond the window
        np.abs(difference, out=difference)
        iae: FloatArray = difference.sum(axis=1)
    iae += np.concatenate([[0.0], np.cumsum(np.abs(markov))])[delays]
    iae += np.abs(markov[delays] - D)
    iae[~np.isfinite(iae)] = np.inf
    return iae
