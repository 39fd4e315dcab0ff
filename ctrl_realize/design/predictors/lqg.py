"""Output feedback for plants with dead time: filter, prediction, state feedback."""

from __future__ import annotations

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ...delayed import DelayedStateSpace
from ...delayed.chains import augment
from ...delayed.deferred import MAX_STATES
from ...errors import DelayRangeError
from ...numerics.arrays import FloatArray
from ...numerics.blas_threads import single_threaded
from ..loops.loop_check import refuse_poles
from ..resolved import check_sign, warn_unresolved
from ..siso import delayed_system
from .checked import CheckedController
from .estimator import KalmanPredictor, kalman_predictor
from .regulator import TOO_LONG, PredictorLQR, regulator
from .riccati import has_states


class LQGController(CheckedController):
    """LQG controller of one input and one output, made by `lqg`.

    Attributes
    ----------
    model : DelayedStateSpace
        Plant model.
    regulator : PredictorLQR
    estimator : KalmanPredictor
    check : LoopCheck or None
        Check of the closed loop with the plant.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[1.02]], [[1.0]], [[0.1]], [[0.0]], 0.01), 10)
    >>> controller = cr.design.lqg(plant, 1.0, 1.0, 1.0, 1.0)
    >>> controller.model.delay, controller.check.stable
    (10, True)
    """

    regulator: PredictorLQR
    estimator: KalmanPredictor


@single_threaded
def lqg(
    system: DelayedStateSpace,
    Q: ArrayLike,
    R: ArrayLike,
    QN: ArrayLike,
    RN: ArrayLike,
    *,
    name: str = "lqg",
) -> ct.StateSpace:
    """Design an LQG controller: Kalman filter, prediction over the dead time, state feedback.

    Also for unstable and integrating cores, for which a Smith predictor is not possible. Its states
    are those of the core and of the delay line. It has no integral action: for that, add an
    integrator to the plant for the design, and then to the controller.

    Parameters
    ----------
    system : DelayedStateSpace
        The delays may differ between channels. For a continuous plant its sampled form,
        ``sys.to_discrete(dt)``, exact for a dead time at the input.
    Q, R
        As for `predictor_lqr`.
    QN, RN
        As for `kalman_predictor`.
    name : str, optional

    Returns
    -------
    control.StateSpace
        From error to plant input, for negative feedback: ``margins(system, lqg(...))``. For one
        input and output an `LQGController`, whose `check` is a `LoopCheck` of the closed loop
        with `system` itself, also over its interval of dead times; for several a plain system.

    Raises
    ------
    UnsuitableSystemError
        A core without states, weights that do not stabilize it, or an unstable core that cannot be
        predicted over the dead time.
    DelayRangeError
        Several channels with delays too long for dense matrices.

    Warns
    -----
    ModelWarning
        Ms is larger than 2 on the model itself, or at an end of the intervals of dead time and gain
        of the system; or the loop is unstable somewhere within them.

    Notes
    -----
    Separation of estimator and regulator [1]_; the regulator uses the state predicted over the
    input delays, as in the reduction of [2]_.

    References
    ----------
    .. [1] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
       chapter 11 (Optimal design methods).
    .. [2] Z. Artstein, Linear systems with delayed controls: a reduction, IEEE Trans. Automat.
       Control 27 (1982) 869-879, doi:10.1109/TAC.1982.1103023.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[1.02]], [[1.0]], [[0.1]], [[0.0]], 0.01), 10)
    >>> controller = cr.design.lqg(plant, 1.0, 1.0, 1.0, 1.0)
    >>> cr.design.margins(plant, controller)
    <Margins stable: gain 2.323, phase 44.23 deg, modulus 0.5479, delay 138 ms>
    """
    plant = delayed_system(system, "lqg", siso=False)
    check_sign(plant, "lqg")
    warn_unresolved(plant, predicts=True)
    core = plant.delay_free
    has_states(core, "lqg")
    law = regulator(plant, Q, R)
    estimator = kalman_predictor(plant, QN, RN)
    A, B, C, D = augment(ct.ssdata(core), (0,) * core.ninputs, tuple(plant.output_delays))
    L = estimator.gain
    # Estimated core and delay line, as in the augmented plant.
    inner, into = A - L @ C, B - L @ D
    n, d = A.shape[0], sum(plant.input_delays)
    # Samples within an output delay are states of the estimator, with zero weight.
    gain, passed = np.split(law.gain, [core.nstates + d], axis=1)
    K = np.hstack([gain[:, : core.nstates], passed, gain[:, core.nstates :]])
    if not plant.issiso():
        # Separation: the closed-loop poles are those of the regulator and of the estimator.
        poles = np.concatenate([law.poles, estimator.poles])
        refuse_poles(poles, "the controller", TOO_LONG)
        return _several_channels(plant, (inner, into, K, L), name)
    line = np.zeros((n, d))
    if d:
        line[:, -1:] = into
    else:
        # u[k] depends on the state alone, and acts at once.
        inner = inner - into @ K

    behind = np.vstack([np.zeros((n, core.nstates)), -law.core_gain])
    # Negative feedback: the controller sees e = -y.
    made = LQGController(
        *(inner, -L, -K[:, :n], np.zeros((1, 1)), line, -K[:, n:]),
        float(plant.dt),
        name=name,
        outputs=plant.input_labels[0],
        pulses=(np.asarray(core.A, np.float64), np.asarray(core.B, np.float64), behind),
        design={"model": plant, "regulator": law, "estimator": estimator},
    )
    more_robust = "Try 10 * R and 10 * RN: slower and more robust"
    return made.verified("the controller", TOO_LONG, more_robust)


def _several_channels(
    plant: DelayedStateSpace, parts: tuple[FloatArray, ...], name: str
) -> ct.StateSpace:
    """Close the estimator's delay lines by the gain; all channels in one plain system."""
    inner, into, K, L = parts
    n, m = into.shape
    if n + sum(plant.input_delays) > MAX_STATES:
        raise DelayRangeError(
            f"the controller of several channels has {n + sum(plant.input_delays)} states in "
            f"a dense matrix, the limit is {MAX_STATES}. Use a longer sample time, "
            "cr.design.to_discrete(core, dead_time, dt), or close one channel at a time"
        )
    free = inner, into, np.zeros((1, n)), np.zeros((1, m))
    A, B, _, _ = augment(free, plant.input_delays, (0,))
    errors = np.vstack([-L, np.zeros((A.shape[0] - n, L.shape[1]))])
    return ct.StateSpace(
        A - B @ K,
        errors,
        -K,
        np.zeros((m, L.shape[1])),
        float(plant.dt),
        name=name,
        inputs=[f"e_{label}" for label in plant.output_labels],
        outputs=list(plant.input_labels),
        remove_useless_states=False,
    )
