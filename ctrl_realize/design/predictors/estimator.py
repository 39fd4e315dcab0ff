"""Kalman filter of a core with dead time."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._wording import in_numbers
from ...delayed import DelayedStateSpace
from ...delayed.chains import augment
from ...errors import DelayRangeError
from ...numerics.arrays import ComplexArray, FloatArray, locked, read_only
from ...numerics.blas_threads import single_threaded
from ...results import Result
from ..resolved import warn_unresolved
from ..siso import delayed_system
from .riccati import has_states, riccati, weight_matrix

MOST_APART = 2000
"""Largest difference of output delays in samples; the solver then takes 500 MB."""


@dataclass(frozen=True, eq=False, repr=False)
class KalmanPredictor(Result):
    """Stationary Kalman filter of a core with dead time.

    ``x[k+1] = A x[k] + B u[k-d] + gain (y[k] - C x[k] - D u[k-d])``. Past inputs are known, so the
    input delay needs no gain: that of the whole system is ``[gain; 0]``.

    If outputs are delayed, x is the core's state followed by the outputs within their delays,
    ``y*[k-1] ... y*[k-q]`` of each, and A, B, C, D are those of core and output delays: the filter
    predicts the present state from measurements that are `q` samples old.

    Attributes
    ----------
    gain : ndarray, shape (n + q, p)
        q is the sum of the output delays.
    covariance : ndarray, shape (n, n)
        Of the one-sample-ahead prediction error of the core's state.
    poles : ndarray, shape (n + q,)
        Of the estimator, eigenvalues of A - gain C.
    dt : float

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[0.9]], [[1.0]], [[1.0]], [[0.0]], 0.1), 3)
    >>> found = cr.design.kalman_predictor(plant, 1.0, 1.0)
    >>> print(found.gain.round(4), found.covariance.round(4), found.poles.real.round(4))
    [[0.5377]] [[1.4839]] [0.3623]
    """

    gain: FloatArray
    covariance: FloatArray
    poles: ComplexArray
    dt: float

    _heading = "Kalman predictor"

    def _rows(self) -> list[tuple[str, str]]:
        largest = float(np.abs(self.poles).max(initial=0.0))
        return [("gain", in_numbers(self.gain)), ("slowest pole", f"|z| = {largest:.4g}")]

    def __repr__(self) -> str:
        return f"<KalmanPredictor order {self.gain.shape[0]}>"


@single_threaded
def kalman_predictor(system: DelayedStateSpace, QN: ArrayLike, RN: ArrayLike) -> KalmanPredictor:
    """Compute the stationary Kalman filter of a system with dead time.

    Equal to `control.dlqe` of the augmented system with process noise on the core's states only, at
    the cost of a Riccati equation of the core: the common output delay is a prediction.

    Parameters
    ----------
    system : DelayedStateSpace
        The delays may differ between channels. Different output delays enlarge the Riccati equation
        by their differences.
    QN : array_like, shape (n, n)
        Covariance of the process noise on the core's states. For noise at the input use ``B @ B.T``
        of the core.
    RN : array_like, shape (p, p) or number
        Covariance of the measurement noise.

    Returns
    -------
    KalmanPredictor

    Raises
    ------
    UnsuitableSystemError
        A core that is not observable with these covariances, or one without states.
    DelayRangeError
        Output delays that differ by more than 2000 samples.
    DataError, OptionError
        Covariances of the wrong shape, or not symmetric.

    Notes
    -----
    The stationary filter of the core [1]_; prediction of its state over the output delay is
    optimal, since there are no measurements of the samples between.

    References
    ----------
    .. [1] B. D. O. Anderson and J. B. Moore, Optimal Filtering, Prentice Hall 1979, chapter 4
       (Time-invariant filters).

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    >>> print(cr.design.kalman_predictor(cr.delayed_ss(core, 3), 1.0, 1.0).gain.round(4))
    [[0.5377]]
    """
    plant = delayed_system(system, "kalman_predictor", siso=False)
    warn_unresolved(plant, predicts=True)
    core = plant.delay_free
    has_states(core, "kalman_predictor")
    weight = weight_matrix(QN, core.nstates, "QN", "core state(s)")
    price = weight_matrix(RN, core.noutputs, "RN", "output(s)")
    common = min(plant.output_delays)
    own = tuple(q - common for q in plant.output_delays)
    if sum(own) > MOST_APART:
        raise DelayRangeError(
            f"the delays of the outputs differ by {sum(own)} samples together, the limit is "
            f"{MOST_APART}. Use a longer sample time, or use one output"
        )
    A, _, C, _ = augment(ct.ssdata(core), (0,) * core.ninputs, own)
    noise = np.zeros_like(A)
    noise[: core.nstates, : core.nstates] = weight
    gain, cost, poles = riccati(ct.dlqr, A.T, C.T, noise, price, "QN and RN")
    gain, cost = _late(core, plant.output_delays, common, (A, gain.T, cost, noise))
    poles = np.append(poles, np.zeros(common * core.noutputs))
    n = core.nstates
    return KalmanPredictor(read_only(gain), read_only(cost[:n, :n]), locked(poles), float(plant.dt))


def _late(
    core: ct.StateSpace, delays: tuple[int, ...], common: int, found: tuple[FloatArray, ...]
) -> tuple[FloatArray, FloatArray]:
    """Extend the filter to outputs that are all delayed by `common` samples.

    The estimated past state is predicted by A to the present; the samples within an output delay
    are the outputs of the states between.
    """
    A, gain, cost, noise = found
    n, C = core.nstates, np.asarray(core.C, dtype=np.float64)
    between = [gain]
    for _ in range(common):
        between.append(A @ between[-1])
        cost = A @ cost @ A.T + noise
    rows = [between[-1][:n]]
    at = n
    for i, q in enumerate(delays):
        # y*[k+1-j] for j = 1 ... common, then the states of the smaller filter for its own delays.
        rows += [C[[i]] @ between[common - j][:n] for j in range(1, common + 1)]
        rows.append(gain[at : at + q - common])
        at += q - common
    return np.vstack(rows), cost
