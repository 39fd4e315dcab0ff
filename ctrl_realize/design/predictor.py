"""Optimal state feedback through a dead time, without the big Riccati equation.

An input sent now acts d samples later on the core. What the core's state will be then is known:
``x[k+d] = A^d x[k] + sum_i A^(i-1) B u[k-i]``. Feeding back that prediction with the gain of the
core alone is the optimum of the whole system, chain included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..delayed import DelayedStateSpace
from ..errors import DataError, OptionError, UnsuitableSystemError
from ..numerics import state_space
from ..numerics.arrays import ComplexArray, FloatArray, read_only
from ..results import Result
from .delay_line import DelayLineController
from .siso import delayed_system


@dataclass(frozen=True, eq=False, repr=False)
class PredictorLQR(Result):
    """State feedback ``u = -gain @ x`` on the states of the system, chain included.

    ``gain = [core_gain A^d, ...]`` on the core's states, and ``core_gain A^(i-1) B`` on the input
    that was sent i samples ago: together ``core_gain`` times the predicted state.

    Attributes
    ----------
    gain : ndarray, shape (m, n + m d)
        On the states of the `DelayedStateSpace`, in its order.
    core_gain : ndarray, shape (m, n)
        On the core's state as if there were no delay.
    poles : ndarray
        Closed-loop poles: those of the core with `core_gain`; the m d of the chain are at 0.
    cost : ndarray, shape (n, n)
        Solution P of the core's Riccati equation: the cost from the predicted state on.
    delay : int
        In samples.
    dt : float
    """

    gain: FloatArray
    core_gain: FloatArray
    poles: ComplexArray
    cost: FloatArray
    delay: int
    dt: float

    def _title(self) -> str:
        return "LQR through the dead time"

    def _rows(self) -> list[tuple[str, str]]:
        largest = float(np.abs(self.poles).max(initial=0.0))
        return [
            ("delay", f"{self.delay} samples ({self.delay * self.dt:.4g} s)"),
            ("gain on the core", np.array2string(self.core_gain, precision=4)),
            ("slowest closed-loop pole", f"|z| = {largest:.6g}"),
        ]

    def __repr__(self) -> str:
        n = self.core_gain.shape[1]
        return f"<PredictorLQR order {n}, delay {self.delay}, gain {self.gain.shape}>"


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
            ("gain", np.array2string(self.gain.T, precision=4)),
            ("slowest pole", f"|z| = {largest:.6g}"),
        ]

    def __repr__(self) -> str:
        return f"<KalmanPredictor order {self.gain.shape[0]}>"


def predictor_lqr(system: DelayedStateSpace, Q: ArrayLike, R: ArrayLike) -> PredictorLQR:
    """Linear-quadratic regulator of a system with dead time.

    Equal to `control.dlqr` of the augmented system with Q on the core's states, at the price of
    the core's Riccati equation: milliseconds at any delay.

    Parameters
    ----------
    system : DelayedStateSpace
        Delays at the inputs, the same for all.
    Q : array_like, shape (n, n)
        Weight on the core's states, positive semidefinite. For a weight on the output use
        ``C.T @ C`` of the core.
    R : array_like, shape (m, m) or number
        Weight on the inputs, positive definite.

    Returns
    -------
    PredictorLQR

    Raises
    ------
    UnsuitableSystemError
        Delays that differ between inputs, or stand at outputs; a core that these weights cannot
        stabilize.
    DataError
        Weights of the wrong shape.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    >>> found = cr.design.predictor_lqr(cr.delayed_ss(core, 3), 1.0, 1.0)
    >>> print(found.gain.round(4))
    [[0.392  0.5377 0.4839 0.4355]]
    """
    plant = delayed_system(system, "predictor_lqr", siso=False)
    d = _input_delay(plant)
    core = plant.delay_free
    n, m = core.nstates, core.ninputs
    weight = _weight(Q, n, "Q", "core state(s)")
    price = _weight(R, m, "R", "input(s)")
    gain, cost, poles = _riccati(
        ct.dlqr, np.asarray(core.A), np.asarray(core.B), weight, price, "Q and R"
    )
    return PredictorLQR(
        gain=read_only(_line_gain(core, gain, d)),
        core_gain=read_only(gain),
        poles=_locked(poles),
        cost=read_only(cost),
        delay=d,
        dt=float(plant.dt),
    )


def _line_gain(core: ct.StateSpace, gain: FloatArray, d: int) -> FloatArray:
    """Gain on [core; chain of input 1; chain of input 2; ...], newest input first in each."""
    A, B = np.asarray(core.A, dtype=np.float64), np.asarray(core.B, dtype=np.float64)
    m = B.shape[1]
    # K A^(i-1) B are the Markov parameters of (A, B, K).
    pulses = state_space.markov(A, B, gain, np.zeros((gain.shape[0], m)), d + 1)[:, :, 1:]
    ahead = gain @ np.linalg.matrix_power(A, d)
    return np.hstack([ahead, *(pulses[:, j, :] for j in range(m))])


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
    weight = _weight(QN, core.nstates, "QN", "core state(s)")
    price = _weight(RN, core.noutputs, "RN", "output(s)")
    A, C = np.asarray(core.A), np.asarray(core.C)
    gain, cost, poles = _riccati(ct.dlqr, A.T, C.T, weight, price, "QN and RN")
    return KalmanPredictor(read_only(gain.T), read_only(cost), _locked(poles), float(plant.dt))


def lqg(
    system: DelayedStateSpace,
    Q: ArrayLike,
    R: ArrayLike,
    QN: ArrayLike,
    RN: ArrayLike,
    *,
    name: str = "lqg",
) -> DelayLineController:
    """Output feedback: Kalman predictor, prediction over the dead time, state feedback.

    Works for unstable and integrating cores too, where a Smith predictor cannot. Its states are
    those of the core and of the delay line. It has no integral action: for that, put an integrator
    before the plant first and after the controller then.

    Parameters
    ----------
    system : DelayedStateSpace
        One input, one output.
    Q, R
        As for `predictor_lqr`.
    QN, RN
        As for `kalman_predictor`.
    name : str, optional

    Returns
    -------
    DelayLineController
        A `control.StateSpace` from error to plant input, for negative feedback:
        ``margins(system, lqg(...))``. ``.regulator`` and ``.estimator`` are its parts.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[1.02]], [[1.0]], [[0.1]], [[0.0]], 0.01), 10)
    >>> controller = cr.design.lqg(plant, 1.0, 1.0, 1.0, 1.0)
    >>> cr.design.margins(plant, controller).stable
    True
    """
    plant = delayed_system(system, "lqg")
    regulator = predictor_lqr(plant, Q, R)
    estimator = kalman_predictor(plant, QN, RN)
    core, d = plant.delay_free, regulator.delay
    n = core.nstates
    A, B, C, D = (np.asarray(M, dtype=np.float64) for M in (core.A, core.B, core.C, core.D))
    K, L = regulator.gain, estimator.gain
    if d == 0:
        # u[k] is formed from the state alone, and acts at once.
        closed = A - L @ C - (B - L @ D) @ K
        line: tuple[FloatArray, FloatArray] = np.zeros((n, 0)), np.zeros((1, 0))
    else:
        closed = A - L @ C
        into = np.zeros((n, d))
        into[:, -1] = (B - L @ D)[:, 0]
        line = into, -K[:, n:]
    # Negative feedback: the controller sees e = -y.
    return DelayLineController(
        closed,
        -L,
        -K[:, :n],
        np.zeros((1, 1)),
        *line,
        float(plant.dt),
        name=name,
        inputs="e",
        outputs=plant.input_labels[0],
        notes={"model": plant, "regulator": regulator, "estimator": estimator},
    )


def _input_delay(plant: DelayedStateSpace) -> int:
    if any(plant.output_delays) or len(set(plant.input_delays)) != 1:
        raise UnsuitableSystemError(
            f"the delays are {plant.input_delays} at the inputs and {plant.output_delays} at the "
            "outputs; needed is one delay that all inputs share. Use control.dlqr on the "
            "augmented system"
        )
    return plant.input_delays[0]


def _weight(given: ArrayLike, size: int, name: str, of: str) -> FloatArray:
    weight = np.atleast_2d(np.asarray(given, dtype=np.float64))
    if weight.shape != (size, size):
        raise DataError(f"{name} has shape {weight.shape}; there are {size} {of}")
    if not np.all(np.isfinite(weight)):
        raise DataError(f"{name} has non-finite entries")
    if not np.allclose(weight, weight.T, rtol=1e-9, atol=0):
        raise OptionError(f"{name} is not symmetric")
    return weight


def _riccati(
    solver: Any, A: FloatArray, B: FloatArray, Q: FloatArray, R: FloatArray, weights: str
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    try:
        gain, cost, poles = solver(A, B, Q, R)
    # Slycot, where it is there, has errors of its own, all of them ArithmeticErrors.
    except (ArithmeticError, ct.ControlArgument, ValueError) as error:
        raise UnsuitableSystemError(
            f"the Riccati equation of the core has no stabilizing solution for these {weights} "
            f"({error}); an unstable or integrating mode may be out of reach or without weight"
        ) from error
    return (
        np.atleast_2d(np.asarray(gain, dtype=np.float64)),
        np.atleast_2d(np.asarray(cost, dtype=np.float64)),
        np.asarray(poles, dtype=np.complex128),
    )


def _locked(values: ComplexArray) -> ComplexArray:
    kept = np.array(values, dtype=np.complex128)
    kept.flags.writeable = False
    return kept
