"""From a sampled step response to the response to a unit pulse."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray


def backward_difference(step: FloatArray, before: float = 0.0) -> FloatArray:
    """Unit-pulse response of the plant behind its hold: G_k = S_k - S_(k-1).

    Exactly step-invariant: the sum of the result is the step response again, and there is no
    truncation error.

    Parameters
    ----------
    step : ndarray, shape (N,)
    before : float
        S_(-1).

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.differences import backward_difference
    >>> print(backward_difference(np.array([0.0, 1.0, 1.5])))
    [0.  1.  0.5]
    """
    return np.diff(step, prepend=before)


def central_difference(step: FloatArray) -> FloatArray:
    """Five-point derivative, error O(Ts^4), times the sample time.

    This is the paper's differentiation (section 3.2; it says "third order", but the stencil
    whose error is O(Ts^4) has order four). It samples the continuous impulse response, which
    is half a sample earlier than the step-invariant one, and it looks two samples ahead, so an
    edge shows up two samples early. The two samples at each end use the three-point and the
    one-sided stencils of order two.

    Parameters
    ----------
    step : ndarray, shape (N,), N >= 5

    Returns
    -------
    ndarray, shape (N,)
        Ts dS/dt: the change per sample.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.differences import central_difference
    >>> print(central_difference(np.arange(7.0) ** 4)[2:-2])
    [ 32. 108. 256.]
    """
    slope = np.gradient(step, edge_order=2)
    slope[2:-2] = (step[:-4] - 8 * step[1:-3] + 8 * step[3:-1] - step[4:]) / 12
    return slope
