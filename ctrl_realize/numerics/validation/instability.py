"""Test for an unstable plant, from a record made in closed loop.

All fitted structures are stable, and describe an unstable plant in a closed loop as well as they
can. One-step prediction is different: for an output ``y = (B u + C e) / A`` the regression on its
own past and that of the input tends to ``A/C`` and ``B/C`` with a stable C [1]_, so that an
unstable pole remains a zero of the polynomial of past outputs.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, sections
   3.2 and 4.2; in closed loop 13.4.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from ..arrays import FloatArray, unit_columns
from ..constants import LEAST_FREEDOM

OWN_PAST = 30
"""Past outputs. Of six records of a loop about a plant with a pole at +1/s to +2/s (`unstable` in
`benchmarks.worlds`) t was -13 or less with 30, -5 with 75, -2.5 with 150 and -1.4 with 10."""
_PREDICTED = 1e-6
"""Part of an output that is left where its past tells it: without noise nothing is significant."""
_RANK = 1e-10  # of the largest singular value: rounding


def unstable_chance(output: FloatArray, drive: FloatArray, past: int) -> float:
    """P-value of the regression on past outputs, for a stable plant.

    The polynomial ``A(q) = 1 + a_1 q^-1 + ...`` of past outputs is positive at ``q = 1`` if all its
    zeros are inside the unit circle, and negative if one real zero is outside. This is a t-test of
    a sum of coefficients: for an autoregression alone it is the right-tailed test of Dickey and
    Fuller for explosive behaviour (Phillips, Wu and Yu, Int. Econ. Rev. 52 (2011) 201-226), whose
    quantiles for a pole at 1 are smaller than Student's. Pairs of unstable poles are not detected.

    Parameters
    ----------
    output : ndarray, shape (N,)
    drive : ndarray, shape (N,) or (m, N)
    past : int
        Number of past inputs in the regression, which should exceed the dead time.

    Returns
    -------
    float
        Lower tail of Student's distribution; 1 if the record is too short or has no noise.
    """
    before = max(OWN_PAST, past)
    rows = output.size - before
    inputs = np.atleast_2d(drive)
    if rows < OWN_PAST + past * len(inputs) + 2 + LEAST_FREEDOM:
        return 1.0
    here = np.arange(before, before + rows)
    own = [output[here - i] for i in range(1, OWN_PAST + 1)]
    earlier = [one[here - i] for one in inputs for i in range(1, past + 1)]
    everything = np.stack([*own, *earlier, np.ones(rows), here / rows], axis=1)
    columns, size = unit_columns(everything)
    target = output[here]
    # The triangle has the same right singular vectors, and far fewer rows.
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, target]), mode="r"))
    left, singular, right = np.linalg.svd(triangle[:-1, :-1])
    rank = int(np.count_nonzero(singular > _RANK * singular[0]))
    inside, outside = np.split(left.T @ triangle[:-1, -1], [rank])
    singular, right = singular[:rank], right[:rank]
    freedom = rows - rank
    spread = float(np.hypot(triangle[-1, -1], np.linalg.norm(outside)) / np.sqrt(freedom))
    if spread <= _PREDICTED * float(output.std()):
        return 1.0
    asked = np.zeros(columns.shape[1])
    asked[:OWN_PAST] = -1 / size[:OWN_PAST]
    along = (right @ asked) / singular
    at_one = 1 + float(along @ inside)
    return float(stdtr(freedom, at_one / (spread * float(np.linalg.norm(along)))))
