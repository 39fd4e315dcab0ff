"""Kalman filter of a core behind its dead time."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..delayed import DelayedStateSpace
from ..errors import UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray, read_only
from ..results import Result
from ..wording import in_numbers
from .riccati import locked, riccati, weight_matrix
from .siso import delayed_system


@dataclass(frozen=True, eq=False, repr=False)
class KalmanPredictor(Result):
    """Steady Kalman filter of the core behind its dead time.

    ``x[k+1] = A x[k] + B u[k-d] + gain (y[k] - C x[k] - D u[k-d])``. The inputs on their way are
    known, so the chain needs no gain: the filter of the whole system is ``[gain; 0]``.

    Attributes
    ----------
    gain : ndarray, shape (n, p)
    covariance : ndarray, shape (n, n)
        Of the error of the state predicted one sample ahead.
    poles : ndarray, shape (n,)
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

    def _title(self) -> str:
        return "Kalman predictor"

    def _rows(self) -> list[tuple[str, str]]:
        largest = float(np.abs(self.poles).max(initial=0.0))
        return [
            ("gain", in_numbers(self.gain)),
            ("slowest pole", f"|z| = {largest:.4g}"),
        ]

    def __repr__(self) -> str:
        return f"<KalmanPredictor order {self.gain.shape[0]}>"


def kalman_predictor(system: DelayedStateSpace, QN: ArrayLike, RN: ArrayLike) -> KalmanPredictor:
    """Steady Kalman filter of a system with dead time at its inputs.

    Equal to `control.dlqe` of the augmented system with process noise on the core's states only.

    Parameters
    ----------
    system : DelayedStateSpace
        Delays at the inputs (they may differ), none at the outputs.
    QN : array_like, shape (n, n)
        Covariance of the process noise on the core's states. For noise that enters with the
        input use ``B @ B.T`` of the core.
    RN : array_like, shape (p, p) or number
        Covariance of the measurement noise.

    Returns
    -------
    KalmanPredictor

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    >>> print(cr.design.kalman_predictor(cr.delayed_ss(core, 3), 1.0, 1.0).gain.round(4))
    [[0.5377]]
    """
    plant = delayed_system(system, "kalman_predictor", siso=False)
    if any(plant.output_delays):
        raise UnsuitableSystemError(
            f"the outputs have delays {plant.output_delays}; a filter needs them at the inputs "
            "(for one input and output: delayed_ss(core, delay))"
        )
    core = plant.delay_free
    weight = weight_matrix(QN, core.nstates, "QN", "core state(s)")
    price = weight_matrix(RN, core.noutputs, "RN", "output(s)")
    A, C = np.asarray(core.A), np.asarray(core.C)
    gain, cost, poles = riccati(ct.dlqr, A.T, C.T, weight, price, "QN and RN")
    return KalmanPredictor(read_only(gain.T), read_only(cost), locked(poles), float(plant.dt))
