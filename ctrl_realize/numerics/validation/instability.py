"""Test whether a plant is unstable, on a record made while something else held it.

Every structure that is fitted is stable, and follows an unstable plant in a closed loop as well
as it can. One-step predictions know better: of an output ``y = (B u + C e) / A`` the regression on
its own past and that of the input tends to ``A/C`` and ``B/C`` with a stable C [1]_, so that
an unstable pole stays a zero of the polynomial of past outputs.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, sections
   3.2 and 4.2; in closed loop 13.4.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from ..arrays import FloatArray
from ..constants import LEAST_FREEDOM

OWN_PAST = 30
"""Past outputs. Of six records of a loop about a plant with a pole at +1/s to +2/s (`unstable` in
`benchmarks.worlds`) t was -13 or less with 30, -5 with 75, -2.5 with 150 and -1.4 with 10."""
_PREDICTED = 1e-6
"""Part of an output that is left where its past tells it: without noise nothing is significant."""
_RANK = 1e-10  # of the largest singular value: rounding


def unstable_chance(output: FloatArray, drive: FloatArray, past: int) -> float:
    """Chance that the output of a stable plant predicts itself as this one does.

    The polynomial ``A(q) = 1 + a_1 q^-1 + ...`` of past outputs is positive at ``q = 1`` if all
    its zeros are inside the unit circle, and negative if one real zero is outside. That is a t-test
    of a sum of coefficients: of an autoregression alone it is the right-tailed test of Dickey and
    Fuller for explosive behaviour (Phillips, Wu and Yu, Int. Econ. Rev. 52 (2011) 201-226), whose
    quantiles at a pole of 1 are less far out than Student's. Pairs of unstable poles are not told.

    Parameters
    ----------
    output : ndarray, shape (N,)
    drive : ndarray, shape (N,) or (m, N)
    past : int
        Past inputs in the regression, which should reach beyond the dead time.

    Returns
    -------
    float
        Lower tail of Student's distribution; 1 where the record is too short or has no noise.
    """
    before = max(OWN_PAST, past)
    rows = output.size - before
    inputs = np.atleast_2d(drive)
    if rows < OWN_PAST + past * len(inputs) + 2 + LEAST_FREEDOM:
        return 1.0
    here = np.arange(before, before + rows)
    own = [output[here - i] for i in range(1, OWN_PAST + 1)]
    earlier = [one[here - i] for one in inputs for i in range(1, past + 1)]
    columns = np.stack([*own, *earlier, np.ones(rows), here / rows], axis=1)
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    left, singular, right = np.linalg.svd(columns / size, full_matrices=False)
    rank = int(np.count_nonzero(singular > _RANK * singular[0]))
    left, singular, right = left[:, :rank], singular[:rank], right[:rank]
    target = output[here]
    inside = left.T @ target
    residual = target - left @ inside
    freedom = rows - rank
    spread = float(np.sqrt(residual @ residual / freedom))
    if spread <= _PREDICTED * float(output.std()):
        return 1.0
    asked = np.zeros(columns.shape[1])
    asked[:OWN_PAST] = -1 / size[:OWN_PAST]
    along = (right @ asked) / singular
    at_one = 1 + float(along @ inside)
    return float(stdtr(freedom, at_one / (spread * float(np.linalg.norm(along)))))
