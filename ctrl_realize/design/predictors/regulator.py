"""Optimal state feedback for plants with input delay, by the Riccati equation of the core.

An input acts on the core d samples later. The state at that time is known: ``x[k+d] = A^d x[k] +
sum_i A^(i-1) B u[k-i]``. Feedback of this prediction with the gain of the core alone is optimal for
the whole system, including the delay. If the inputs have different delays the optimum is still a
state feedback from the core and the past inputs, see `numerics.delayed_regulator`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._wording import in_numbers, in_time
from ...delayed import DelayedStateSpace
from ...errors import DelayRangeError, OptionError, UnsuitableSystemError
from ...numerics.arrays import ComplexArray, FloatArray, locked, read_only
from ...numerics.blas_threads import single_threaded
from ...numerics.state_space import responses
from ...numerics.state_space.delayed_lqr import line_gain
from ...results import Result
from ..delay_line import DelayLineController
from ..loops.loop_check import LoopCheck, refuse_poles, verified
from ..resolved import check_sign, warn_unresolved
from ..siso import delayed_system
from .riccati import has_states, riccati, weight_matrix

MOST_MEMORY = 2e9
"""Upper limit of the memory for inputs with different delays, in bytes."""
TOO_LONG = (
    "An unstable core cannot be predicted over such a long dead time in double precision; "
    "use a longer sample time, or a shorter dead time"
)


@dataclass(frozen=True, eq=False, repr=False)
class PredictorLQR(Result):
    """State feedback ``u = -gain @ x`` from the states of the system, delay line included.

    With one delay d for all inputs: ``gain = [core_gain A^d, ...]`` on the core's states, and
    ``core_gain A^(i-1) B`` on the input of i samples ago, together ``core_gain`` times the
    predicted state. With different delays the faster inputs take into account what the slower ones
    will do; after the longest delay the core moves as ``A - B core_gain`` in any case.

    Attributes
    ----------
    gain : ndarray, shape (m, n + sum of delays)
        For the states of the `DelayedStateSpace`, in its order.
    core_gain : ndarray, shape (m, n)
        For the core's state without the delay.
    poles : ndarray
        Closed-loop poles: those of the core with `core_gain`; those of the delays are at 0.
    cost : ndarray, shape (n, n)
        Solution P of the core's Riccati equation: the cost from the state predicted for the end of
        the longest delay on.
    delay : int, or tuple of int where the inputs differ
        In samples.
    dt : float
    check : LoopCheck or None
        Of the loop with this gain, broken at the plant's input, with measured states, for the
        system itself and over its interval of dead times. None for several inputs, for which only
        the `poles` are computed.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[0.9]], [[1.0]], [[1.0]], [[0.0]], 0.1), 3)
    >>> found = cr.design.predictor_lqr(plant, 1.0, 1.0)
    >>> print(found.core_gain.round(4), found.gain.round(4), found.poles.real.round(4))
    [[0.5377]] [[0.392  0.5377 0.4839 0.4355]] [0.3623]
    """

    gain: FloatArray
    core_gain: FloatArray
    poles: ComplexArray
    cost: FloatArray
    delay: int | tuple[int, ...]
    dt: float
    check: LoopCheck | None = None

    @property
    def time_unit(self) -> str:
        """Unit in which cards write times."""
        return "s" if self.check is None else self.check.time_unit

    _heading = "LQR through the dead time"

    def _rows(self) -> list[tuple[str, str]]:
        largest = float(np.abs(self.poles).max(initial=0.0))
        delays = (self.delay,) if isinstance(self.delay, int) else self.delay
        samples = ", ".join(str(d) for d in delays)
        times = ", ".join(in_time(d * self.dt, 4) for d in delays)
        return [
            ("delay", f"{samples} samples ({times})"),
            ("gain on the core", in_numbers(self.core_gain)),
            ("slowest closed-loop pole", f"|z| = {largest:.4g}"),
            *(self.check._rows() if self.check is not None else []),
        ]

    def _notes(self) -> list[str]:
        return [str(flag) for flag in self.check.flags] if self.check is not None else []

    def __repr__(self) -> str:
        n = self.core_gain.shape[1]
        return f"<PredictorLQR order {n}, delay {self.delay}, gain {self.gain.shape}>"


@single_threaded
def predictor_lqr(system: DelayedStateSpace, Q: ArrayLike, R: ArrayLike) -> PredictorLQR:
    """Compute the linear-quadratic regulator of a system with dead time.

    Equal to `control.dlqr` of the augmented system with Q on the core's states, at the cost of the
    core's Riccati equation: milliseconds at any delay.

    Parameters
    ----------
    system : DelayedStateSpace
        The delays may differ between inputs; output delays have no effect here.
    Q : array_like, shape (n, n)
        Weight on the core's states, positive semidefinite. For a weight on the output use
        ``C.T @ C`` of the core.
    R : array_like, shape (m, m) or number
        Weight on the inputs, positive definite. It must not couple inputs with different delays.

    Returns
    -------
    PredictorLQR

    Raises
    ------
    UnsuitableSystemError
        A core that cannot be stabilized with these weights, or one without states; a core so
        unstable that it cannot be predicted over the dead time in double precision.
    DelayRangeError
        Different input delays, so long that the recursion does not fit into memory.
    DataError
        Weights of the wrong shape.
    OptionError
        Weights that are not symmetric, or an R that couples inputs of different delays.

    Warns
    -----
    ModelWarning
        Ms is larger than 2 on the model itself, or at an end of the intervals of dead time and gain
        of the system; or the loop is unstable somewhere within them.

    Notes
    -----
    Different delays take one step of a Riccati recursion of the core's size for each sample between
    the shortest and the longest, the regulator for multiple input delays [1]_.

    References
    ----------
    .. [1] H. Zhang, G. Duan and L. Xie, Linear quadratic regulation for linear time-varying systems
       with multiple input delays, Automatica 42 (2006) 1465-1476,
       doi:10.1016/j.automatica.2006.04.007.
    .. [2] Z. Artstein, Linear systems with delayed controls: a reduction, IEEE Trans. Automat.
       Control 27 (1982) 869-879, doi:10.1109/TAC.1982.1103023.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    >>> found = cr.design.predictor_lqr(cr.delayed_ss(core, 3), 1.0, 1.0)
    >>> print(found.gain.round(4))
    [[0.392  0.5377 0.4839 0.4355]]

    A heater that acts at once beside one that acts four samples later:

    >>> both = cr.delayed_ss(ct.ss([[0.9]], [[0.1, 1.0]], [[1.0]], 0, 0.1), [0, 4])
    >>> cr.design.predictor_lqr(both, 1.0, np.eye(2))
    <PredictorLQR order 1, delay (0, 4), gain (2, 5)>
    """
    plant = delayed_system(system, "predictor_lqr", siso=False)
    found = regulator(plant, Q, R)
    if plant.ninputs > 1:
        refuse_poles(found.poles, "the regulator", TOO_LONG)
        return found
    more_robust = "Try 10 * R: slower and more robust"
    loop = _state_loop(plant, found)
    check = verified(*loop, "the regulator", TOO_LONG, more_robust, models=False)
    return replace(found, check=check)


def regulator(plant: DelayedStateSpace, Q: ArrayLike, R: ArrayLike) -> PredictorLQR:
    """Compute the gain, see `predictor_lqr`, without a check of the loop."""
    check_sign(plant, "predictor_lqr")
    warn_unresolved(plant, predicts=True)
    delays = tuple(plant.input_delays)
    core = plant.delay_free
    has_states(core, "predictor_lqr")
    A, B = np.asarray(core.A, dtype=np.float64), np.asarray(core.B, dtype=np.float64)
    weight = weight_matrix(Q, core.nstates, "Q", "core state(s)")
    price = weight_matrix(R, core.ninputs, "R", "input(s)", definite=True)
    _check_coupling(price, delays)
    _check_forgetting_time(core.nstates + sum(delays), delays)
    gain, cost, poles = riccati(ct.dlqr, A, B, weight, price, "Q and R")
    shared = len(set(delays)) == 1
    with np.errstate(over="ignore", invalid="ignore"):
        if shared:
            lines = _predicted(A, B, gain, delays[0])
        else:
            lines = line_gain(A, B, (weight, price), (gain, cost), delays)
    if not np.all(np.isfinite(lines)):
        raise UnsuitableSystemError(
            f"the core is unstable and overflows within the delay of {max(delays)} samples: "
            "no controller can stabilize it over such a long dead time"
        )
    # Samples within an output delay have left the core and cannot be changed by any input.
    passed = np.zeros((gain.shape[0], sum(plant.output_delays)))
    return PredictorLQR(
        gain=read_only(np.hstack([lines, passed])),
        core_gain=read_only(gain),
        poles=locked(poles),
        cost=read_only(cost),
        delay=delays[0] if shared else delays,
        dt=float(plant.dt),
    )


def _state_loop(
    plant: DelayedStateSpace, found: PredictorLQR
) -> tuple[DelayedStateSpace, DelayLineController]:
    """Loop of one input: the core's states, weighted by the gain, and the delay line."""
    core, d, dt = plant.delay_free, plant.input_delays[0], float(plant.dt)
    n = core.nstates
    on_state, line = found.gain[:, :n], found.gain[:, n : n + d]
    A, B = np.asarray(core.A, dtype=np.float64), np.asarray(core.B, dtype=np.float64)
    seen = ct.StateSpace(A, B, on_state, 0, dt, remove_useless_states=False)
    nothing = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    controller = DelayLineController(
        *nothing, np.zeros((0, d)), -line, dt, name="lqr", pulses=(A, B, -found.core_gain)
    )
    return DelayedStateSpace(seen, d, fit=plant.fit, time_unit=plant.time_unit), controller


def _check_forgetting_time(states: int, delays: tuple[int, ...]) -> None:
    steps = max(delays) - min(delays)
    size = 8 * steps * states * len(delays)
    if size > MOST_MEMORY:
        raise DelayRangeError(
            f"the delays of the inputs differ by up to {steps} samples, and the regulator "
            f"would take {size / 1e9:.3g} GB, the limit is {MOST_MEMORY / 1e9:g} GB. Use a "
            "longer sample time, cr.design.to_discrete(core, dead_time, dt), or use one input"
        )


def _check_coupling(price: FloatArray, delays: tuple[int, ...]) -> None:
    apart = np.not_equal.outer(delays, delays)
    if np.any(price[apart]):
        i, j = (int(x) for x in np.argwhere(apart & (price != 0))[0])
        raise OptionError(
            f"R couples the inputs {i} and {j}, which have the delays {delays[i]} and "
            f"{delays[j]}: simultaneous inputs act at different times. Set R[{i}, {j}] to 0, "
            "or use control.dlqr on the augmented system"
        )


def _predicted(A: FloatArray, B: FloatArray, gain: FloatArray, d: int) -> FloatArray:
    """Gain times the state after the common delay d; newest input first in each line."""
    m = B.shape[1]
    # K A^(i-1) B are the Markov parameters of (A, B, K).
    pulses = responses.markov(A, B, gain, np.zeros((m, m)), d + 1)[:, :, 1:]
    ahead = gain @ np.linalg.matrix_power(A, d)
    return np.hstack([ahead, *(pulses[:, j, :] for j in range(m))])
