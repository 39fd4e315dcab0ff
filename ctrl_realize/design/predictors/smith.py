"""Smith predictors without hidden modes."""

from __future__ import annotations

from typing import Any, overload

import control as ct
import numpy as np

from ..._checks import positive
from ...delayed import DelayedStateSpace, DelaySystem
from ...errors import UnsuitableSystemError
from ...numerics.arrays import FloatArray
from ...numerics.state_space import responses
from ...numerics.state_space.balancing import Part, split_modes
from ..resolved import check_sign, warn_unresolved
from ..siso import delayed_system, same_rate
from .checked import CheckedController
from .continuous_smith import STABILIZE, continuous_smith_predictor, more_robust
from .predictor_filter import Filter, predictor_filter, removed_part

ON_CIRCLE = 1e-9


class SmithPredictor(CheckedController):
    """Smith predictor, made by `smith_predictor`.

    Attributes
    ----------
    model : DelayedStateSpace
        Plant model inside the predictor.
    primary : DelayedStateSpace
        Controller of the delay-free core.
    filter_time : float or None
        Time constant of the prediction-error filter in s.
    check : LoopCheck or None
        Check of the closed loop with the plant.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([2.0, -1.8], [1, -1], 0.01))
    >>> predictor.model.delay, predictor.check.stable
    (10, True)
    """

    primary: DelayedStateSpace
    filter_time: float | None


@overload
def smith_predictor(
    system: DelaySystem, controller: Any, *, filter_time: float | None = None, name: str = "smith"
) -> DelaySystem: ...


@overload
def smith_predictor(
    system: ct.StateSpace, controller: Any, *, filter_time: float | None = None, name: str = "smith"
) -> SmithPredictor: ...


def smith_predictor(
    system: Any, controller: Any, *, filter_time: float | None = None, name: str = "smith"
) -> SmithPredictor | DelaySystem:
    """Make a Smith predictor for a controller designed for the delay-free core.

    The result C_s is used like any controller, ``loop = system * C_s`` with negative feedback.
    Without a filter the closed loop from set-point to output is that of core and controller alone,
    delayed by z^-d. It has nC + n + d states and no hidden mode (the difference of two separate
    models has n more states, which are uncontrollable poles of the core).

    Parameters
    ----------
    system : DelayedStateSpace or DelaySystem
        The plant, one input and one output, stable or with one integrator. A continuous
        `DelaySystem` must be stable, with its dead time at input or output.
    controller : control.StateSpace, control.TransferFunction or float
        Controller designed for the plant without dead time, of the same time base.
    filter_time : float, optional
        Time constant in s of the filter on the prediction error. It makes the loop robust to a
        wrong dead time or gain, and slows down load rejection; the set-point response is then
        shaped by a prefilter. Half the dead time is a usual initial choice. An integrator of a
        discrete plant is removed from the predictor.
    name : str, optional

    Returns
    -------
    SmithPredictor or DelaySystem
        A `control.StateSpace` from error to plant input. Its `check` is a `LoopCheck` of the
        closed loop with `system` itself. For a continuous plant a `DelaySystem`, whose internal
        delay is the dead time.

    Raises
    ------
    UnsuitableSystemError
        An unstable core, whose modes would be hidden and grow inside the predictor. An integrating
        core without `filter_time`, for the same reason. An improper or multi-channel system, or
        one with delays in a loop. A controller that makes the loop with `system` itself unstable.
    OptionError
        A filter time that is not positive.

    Warns
    -----
    ModelWarning
        Ms is larger than 2 on the model itself, or at an end of the intervals of dead time and gain
        from the identification; or the loop is unstable somewhere within them.

    Notes
    -----
    The structure is Smith's [1]_; the filter on the prediction error, and how it removes an
    integrator from the predictor, are those of the filtered Smith predictor [2]_, [3]_, [4]_. The
    prediction is computed as ``y0[k] = sum_i g_i u[k-i] + C A^d x[k-d]``, from the past inputs and
    the state of the delayed model.

    References
    ----------
    .. [1] O. J. M. Smith, Closer control of loops with dead time, Chem. Eng. Progress 53 (1957)
       217-219.
    .. [2] J. E. Normey-Rico, C. Bordons and E. F. Camacho, Improving the robustness of dead-time
       compensating PI controllers, Control Eng. Practice 5 (1997) 801-810,
       doi:10.1016/S0967-0661(97)00064-6.
    .. [3] J. E. Normey-Rico and E. F. Camacho, Unified approach for robust dead-time compensator
       design, J. Process Control 19 (2009) 38-47, doi:10.1016/j.jprocont.2008.02.003.
    .. [4] J. E. Normey-Rico and E. F. Camacho, Control of Dead-time Processes, Springer 2007,
       doi:10.1007/978-1-84628-829-6.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> pi = ct.tf([2.0, -1.8], [1, -1], 0.01)
    >>> predictor = cr.design.smith_predictor(plant, pi)
    >>> predictor.nstates                       # 1 + 1 + 10
    12
    >>> cr.design.margins(plant, predictor)
    <Margins stable: gain 2.387, phase 64.42 deg, modulus 0.5772, delay 162.2 ms>

    In continuous time:

    >>> plant = ct.tf([1], [0.08, 1]) * cr.delay(0.1)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([0.16, 2.0], [0.08, 0]))
    >>> predictor
    <DelaySystem 'smith': e -> u, order 2, internal delay 0.1 s, continuous>
    >>> cr.design.margins(plant, predictor).stable
    True
    """
    if isinstance(system, DelaySystem) and not system.dt:
        return continuous_smith_predictor(system, controller, filter_time, name)
    plant = delayed_system(system, "a Smith predictor")
    check_sign(plant, "a Smith predictor")
    warn_unresolved(plant, predicts=True)
    primary = same_rate(controller, plant.dt, "a Smith predictor")
    core, d = plant.delay_free, int(plant.delay)
    poles = np.asarray(core.poles())
    _refuse_unstable(poles)
    integrating = bool(np.any(np.abs(poles - 1) < ON_CIRCLE))
    seconds = None if filter_time is None else positive(filter_time, "filter_time", "time in s")
    if integrating and seconds is None:
        raise UnsuitableSystemError(
            "the core integrates: in a plain Smith predictor the integrator is an "
            "uncontrollable mode that drifts, and a load disturbance leaves a steady-state "
            "error. Give filter_time, for instance half the dead time "
            f"({0.5 * d * plant.dt:.3g} s)"
        )
    A, B, C = (np.asarray(M) for M in (core.A, core.B, core.C))
    removed, kept = split_modes(A, B, C, lambda z: integrating and abs(z - 1) < 2 * ON_CIRCLE)
    filter_ = _filter(seconds, plant, integrating=integrating)
    *parts, pulses = _assemble(plant, primary, removed, kept, filter_)

    design = {
        "model": plant,
        "primary": DelayedStateSpace(primary, 0, name=primary.name),
        "filter_time": seconds,
    }
    dt, output = float(plant.dt), plant.input_labels[0]
    made = SmithPredictor(*parts, dt, name=name, outputs=output, pulses=pulses, design=design)
    advice = more_robust(filter_time, float(plant.dead_time))
    return made.verified("the Smith predictor", STABILIZE, advice)


def _refuse_unstable(poles: FloatArray) -> None:
    outside = poles[np.abs(poles) > 1 + ON_CIRCLE]
    if outside.size:
        raise UnsuitableSystemError(
            f"the core is unstable (pole at {complex(outside[0]):.6g}): the predictor "
            "contains a copy of the unstable mode that no measurement corrects, so any error "
            "grows. Use design.lqg, whose estimator corrects it"
        )
    on = poles[np.abs(np.abs(poles) - 1) <= ON_CIRCLE]
    if np.any(np.abs(on - 1) > ON_CIRCLE) or on.size > 1:
        raise UnsuitableSystemError(
            f"the core has {on.size} poles on the unit circle; at most one, at z = 1, can be "
            "removed from the predictor. Use design.lqg"
        )


def _filter(seconds: float | None, plant: DelayedStateSpace, *, integrating: bool) -> Filter:
    if seconds is None:
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0
    alpha = float(np.exp(-plant.dt / seconds))
    return predictor_filter(alpha, int(plant.delay), integrating=integrating)


def _assemble(
    plant: DelayedStateSpace, primary: ct.StateSpace, removed: Part, kept: Part, filter_: Filter
) -> tuple[Any, ...]:
    """Matrices of u = C v, v = F (e + y_d) - y_0, with states [x_c; x_d; x_F] and the line.

    Also the pulse response from which all but the last column of the delay line are computed.
    """
    core, d = plant.delay_free, int(plant.delay)
    Ac, Bc, Cc, Dc = ct.ssdata(primary)
    Ak, Bk, Ck = kept
    Af, Bf, Cf, Df = filter_
    nc, nk, nf = Ac.shape[0], Ak.shape[0], Af.shape[0]
    if d == 0:
        # Nothing to predict and, with F = 1, nothing to filter: the controller itself.
        return Ac, Bc, Cc, Dc, np.zeros((nc, 0)), np.zeros((1, 0)), None
    taps = responses.markov(core.A, core.B, core.C, core.D, d + 1)[0, 0]
    direct = float(core.D[0, 0])
    # Rows over [x_c, x_d, x_F], the line and e.
    n = nc + nk + nf
    of_c, of_d, of_F, line = slice(nc), slice(nc, nc + nk), slice(nc + nk, n), slice(n, n + d)
    into = np.zeros(n + d + 1)
    into[of_d] = (Df * Ck - Ck @ np.linalg.matrix_power(Ak, d))[0]
    into[of_F], into[line], into[-1] = Cf[0], -taps[1:], Df
    into[-2] += Df * direct
    # v still contains -g_0 u[k]: u (1 + Dc g_0) = Cc x_c + Dc (the rest of v)
    solve = 1 + Dc[0, 0] * taps[0]
    if abs(solve) < 1e-12:
        raise UnsuitableSystemError(
            "controller and feedthrough of the core make an algebraic loop of gain -1"
        )
    out = Dc[0, 0] * into / solve
    out[of_c] += Cc[0] / solve
    later = np.zeros((n, n + d + 1))
    later[of_c, of_c] = Ac
    later[of_c] += Bc * (into - taps[0] * out)
    later[of_d, of_d], later[of_d, -2] = Ak, Bk[:, 0]
    if nf:
        later[of_F, of_d], later[of_F, of_F], later[of_F, -1] = Bf @ Ck, Af, Bf[:, 0]
        later[of_F, -2] = Bf[:, 0] * direct + removed_part(filter_, removed)[:, 0]
    A, E, B = np.split(later, [n, n + d], axis=1)
    C, h, D = np.split(out[None, :], [n, n + d], axis=1)
    # The delay line contains -taps alone, through the controller's B and D.
    mix = -np.vstack([Bc, np.zeros((nk + nf, 1)), Dc]) / solve
    core_A, core_B, core_C = (np.asarray(M, np.float64) for M in (core.A, core.B, core.C))
    return A, B, C, D, E, h, (core_A, core_B, mix @ core_C)
