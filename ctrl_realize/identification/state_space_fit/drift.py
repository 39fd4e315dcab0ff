"""Drifts of the outputs of records with moving inputs: whether there are any, and without them.

A drift is a further column beside the response to the last samples of the inputs, and has very
strong evidence if it lowers the criterion [1]_ so far.

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...data import Record
from ...numerics.arrays import FloatArray
from ...numerics.constants import SMALLEST, VERY_STRONG
from ...numerics.signals.noise import correlation_time

MEMORY, MOST_SAMPLES = 100, 20000
"""Samples of the inputs beside whose response a drift is looked for, and samples for that."""
PER_WEIGHT = 3
"""Least number of samples for each of those."""


def slopes_of(record: Record) -> FloatArray:
    """Drift (p,) of every output by sample, 0 where the evidence for one is not very strong.

    Beside a level and the response to the last `MEMORY` samples of the inputs, by least squares.
    """
    u, y = np.atleast_2d(record.input), np.atleast_2d(record.output)
    lags = min(MEMORY, u.shape[1] // (PER_WEIGHT * (1 + len(u))))
    found = np.zeros(len(y))
    if lags < 2:
        return found
    past = sliding_window_view(u[:, :MOST_SAMPLES], lags, axis=1)
    rows = np.hstack([*past, np.ones((past.shape[1], 1))])
    for a, late in enumerate(y[:, lags - 1 :][:, : len(rows)]):
        place = np.flatnonzero(np.isfinite(late))
        if place.size < 2 * rows.shape[1]:
            continue
        both = np.stack([place - 0.5 * (late.size - 1), late[place]], axis=1)
        weights, _, rank, _ = np.linalg.lstsq(rows[place], both, rcond=None)
        own, left = (both - rows[place] @ weights).T
        slope = float(own @ left) / max(float(own @ own), SMALLEST)
        rest = left - slope * own
        count = (rest.size - rank - 1) / correlation_time(rest)
        before, after = (max(float(one @ one), SMALLEST) for one in (left, rest))
        if count > 1 and count * np.log(before / after) - np.log(count) > VERY_STRONG:
            found[a] = slope
    return found


def without_drift(record: Record, slope: FloatArray) -> Record:
    """Record without the drift (p,) of its outputs by sample."""
    if not slope.any():
        return record
    away = np.outer(slope, np.arange(record.n_samples) - (record.n_samples - 1) / 2)
    output = record.output - away.reshape(np.shape(record.output))
    return record.__replace__(output=output, missing="keep" if record.n_missing else "refuse")
