"""Output feedback through a dead time: filter, prediction, state feedback."""

from __future__ import annotations

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..delayed import DelayedStateSpace
from ..delayed.chains import augment
from ..numerics.arrays import FloatArray
from ..numerics.blas_threads import single_threaded
from .delay_line import DelayLineController
from .estimator import kalman_predictor
from .regulator import predictor_lqr
from .siso import delayed_system


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
    """Output feedback: Kalman predictor, prediction over the dead time, state feedback.

    Works for unstable and integrating cores too, where a Smith predictor cannot. Its states are
    those of the core and of the delay line. It has no integral action: for that, put an integrator
    before the plant first and after the controller then.

    Parameters
    ----------
    system : DelayedStateSpace
        Its delays may differ from channel to channel.
    Q, R
        As for `predictor_lqr`.
    QN, RN
        As for `kalman_predictor`.
    name : str, optional

    Returns
    -------
    control.StateSpace
        From error to plant input, for negative feedback: ``margins(system, lqg(...))``. For one
        input and output it is a `DelayLineController`, whose ``.regulator`` and ``.estimator``
        are its parts; for several a plain system.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[1.02]], [[1.0]], [[0.1]], [[0.0]], 0.01), 10)
    >>> controller = cr.design.lqg(plant, 1.0, 1.0, 1.0, 1.0)
    >>> cr.design.margins(plant, controller)
    <Margins stable: gain 2.323, phase 44.23 deg, modulus 0.5479, delay 0.138 s>
    """
    plant = delayed_system(system, "lqg", siso=False)
    regulator = predictor_lqr(plant, Q, R)
    estimator = kalman_predictor(plant, QN, RN)
    core = plant.delay_free
    matrices = np.asarray(core.A), np.asarray(core.B), np.asarray(core.C), np.asarray(core.D)
    A, B, C, D = augment(matrices, (0,) * core.ninputs, tuple(plant.output_delays))
    L = estimator.gain
    # Estimated core and line of own outputs, as the chains of the plant hold them.
    inner, into = A - L @ C, B - L @ D
    n, d = A.shape[0], sum(plant.input_delays)
    # What is on its way to an output counts among the states of the estimator, and for nothing.
    gain, passed = np.split(regulator.gain, [core.nstates + d], axis=1)
    K = np.hstack([gain[:, : core.nstates], passed, gain[:, core.nstates :]])
    if not plant.issiso():
        return _several_channels(plant, (inner, into, K, L), name)
    line = np.zeros((n, d))
    if d:
        line[:, -1:] = into
    else:
        # u[k] is formed from the state alone, and acts at once.
        inner = inner - into @ K
    # Negative feedback: the controller sees e = -y.
    return DelayLineController(
        inner,
        -L,
        -K[:, :n],
        np.zeros((1, 1)),
        line,
        -K[:, n:],
        float(plant.dt),
        name=name,
        inputs="e",
        outputs=plant.input_labels[0],
        notes={"model": plant, "regulator": regulator, "estimator": estimator},
    )


def _several_channels(
    plant: DelayedStateSpace, parts: tuple[FloatArray, ...], name: str
) -> ct.StateSpace:
    """Close the estimator's own lines by the gain; all channels in one plain system."""
    inner, into, K, L = parts
    n, m = into.shape
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
