"""Test of constant gain and dead time within a record, based on the residual of a model.

The residual is regressed on the derivatives of the model w.r.t. gain and dead time, for groups of
samples: of one time, one level, one direction. If one model holds for all of them the groups differ
only by noise. (Lagrange multiplier test against changing parameters: Godfrey, Misspecification
Tests in Econometrics, Cambridge 1988, chapter 4; with a transition variable: Terasvirta, J. Am.
Stat. Ass. 89 (1994) 208-218.)

References
----------
.. [1] L. G. Godfrey, Misspecification Tests in Econometrics, Cambridge University Press 1988,
   chapter 4.
.. [2] T. Terasvirta, Specification, estimation, and evaluation of smooth transition autoregressive
   models, J. Amer. Statist. Assoc. 89 (1994) 208-218, doi:10.1080/01621459.1994.10476462.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.special import fdtrc

from ..arrays import FloatArray, IntArray, unit_columns
from ..constants import LEAST_FREEDOM
from ..signals.correlation import autoregression

_MOST_LAGS = 20
"""Of the autoregression that makes the residual white; BIC takes fewer."""
_LEAST_SHARE = 0.05
"""Part of the motion that a group must have for its dead time to be asked for."""


@dataclass(frozen=True, eq=False)
class ParameterChange:
    """Shift and scale of the response of each group relative to the common model.

    ``shifts`` (g,) in samples and ``gains`` (g,) relative to the common gain are those of least
    squares; `errors`, `gain_errors` and `chance`, the p-value of such differences for a constant
    plant, are those of generalised least squares. These estimate no large shift: its residual is
    taken for colour, and in a simulated record 1.3 samples remained of 6.
    """

    shifts: FloatArray
    errors: FloatArray
    gains: FloatArray
    gain_errors: FloatArray
    chance: float


def parameter_change(
    residual: FloatArray, fitted: FloatArray, groups: IntArray, rows: IntArray | None = None
) -> ParameterChange | None:
    """Test whether gain and dead time are the same in all groups of samples.

    Parameters
    ----------
    residual, fitted : ndarray, shape (N,)
        Residual and response of the model.
    groups : ndarray of int, shape (N,)
        Group number of each sample, 0 ... g - 1.
    rows : ndarray of int, shape (N,), optional
        Numbers of these samples, if others are missing.

    Returns
    -------
    ParameterChange
        None if fewer than two groups move enough, or there are too few samples.
    """
    # derivatives with respect to the delay in samples and the relative gain
    slope = -(np.gradient(fitted) if rows is None else np.gradient(fitted, rows))
    size = fitted - np.mean(fitted)
    energy = np.bincount(groups, slope**2)
    used = np.flatnonzero(energy > _LEAST_SHARE * energy.sum())
    if used.size < 2 or not np.any(residual):
        return None
    members = [(groups == g).astype(np.float64) for g in used]
    blocks = [np.stack([m, m * slope, m * size], axis=1) for m in members]
    plain = np.concatenate(blocks, axis=1)
    columns, target, used_up = whitened(plain, residual)
    common = sum(columns[:, 3 * i : 3 * i + 3] for i in range(used.size))
    freedom = target.size - columns.shape[1] - used_up
    if freedom < LEAST_FREEDOM:
        return None
    scaled, scale = unit_columns(columns)
    solution, _, rank, _ = np.linalg.lstsq(scaled, target, rcond=1e-9)
    if rank < columns.shape[1]:
        return None
    left = target - columns @ (solution / scale)
    alone = target - common @ np.linalg.lstsq(common, target, rcond=None)[0]
    variance = float(left @ left) / freedom
    if variance <= 0:
        return None
    ratio = (float(alone @ alone) - float(left @ left)) / (3 * (used.size - 1)) / variance
    # of the columns, not of their products, whose inverse may have a negative diagonal
    _, singular, turned = np.linalg.svd(scaled, full_matrices=False)
    spread = np.sum((turned / singular[:, None]) ** 2, axis=0) / scale**2
    errors = np.sqrt(variance * spread)
    found = np.linalg.lstsq(plain / scale, residual, rcond=1e-9)[0] / scale
    chance = float(fdtrc(3 * (used.size - 1), freedom, max(ratio, 0.0)))
    return ParameterChange(found[1::3], errors[1::3], found[2::3], errors[2::3], chance)


def whitened(columns: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray, int]:
    """Columns and residual after the prewhitening filter, and the residual's size."""
    whitener = np.concatenate([[1.0], -autoregression(residual, _MOST_LAGS)])
    both = np.column_stack([columns, residual])
    white = lfilter(whitener, [1.0], both, axis=0)[whitener.size - 1 :]
    return white[:, :-1], white[:, -1], whitener.size
