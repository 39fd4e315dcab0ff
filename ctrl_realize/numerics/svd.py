"""Singular value decomposition that always ends."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from .arrays import FloatArray


def thin_svd(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return U, the singular values in falling order, and V transposed.

    LAPACK's divide and conquer (``gesdd``, as in NumPy) is quick, but on rare matrices ends
    without an answer: of random Hankel matrices with one value out of order about one in
    30 000. The older ``gesvd`` then does it.

    Examples
    --------
    >>> import numpy as np
    >>> thin_svd(np.array([[0.0, 2.0], [3.0, 0.0], [0.0, 0.0]]))[1]
    array([3., 2.])
    """
    try:
        U, values, Vt = np.linalg.svd(matrix, full_matrices=False)
    except np.linalg.LinAlgError:
        U, values, Vt = scipy.linalg.svd(matrix, full_matrices=False, lapack_driver="gesvd")
    return U, values, Vt
