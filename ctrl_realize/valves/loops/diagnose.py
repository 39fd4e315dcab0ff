"""From operating data to the diagnosis of a loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._checks import one_of
from ...data import Record
from ...numerics.oscillation.cross_correlation import cross_correlation
from ...numerics.oscillation.cycles import (
    SHORTEST_PERIOD,
    crossings,
    find_cycles,
    smoothed,
    without_drift,
)
from ...numerics.oscillation.ellipse import fit_ellipse
from ...numerics.oscillation.half_cycles import HalfCycles, half_cycles
from ...numerics.oscillation.movements import movement_indices
from ...numerics.oscillation.stiction_fit import fit_stiction
from . import methods
from .data import loop_data
from .methods import LoopProcess
from .result import LoopDiagnosis
from .verdict import flags_of, judge, oscillates

_SMOOTHED = 0.1
"""Part of a period over which a signal is averaged before its half cycles are cut out."""


def diagnose_loop(
    loop: Record | Any,
    pv: Any = None,
    sp: Any = None,
    dt: float | None = None,
    *,
    process: LoopProcess = "self-regulating",
) -> LoopDiagnosis:
    """Tell from operating data whether the valve makes a control loop oscillate.

    Parameters
    ----------
    loop : Record, or array_like, shape (N,)
        Controller output OP as input and process value PV as output; or OP alone.
    pv : array_like, shape (N,), optional
        PV, if `loop` is OP.
    sp : array_like, shape (N,), or float, optional
        Set point; default: that of the record, otherwise constant.
    dt : float, optional
        Sample time in s, if `loop` is OP.
    process : {"self-regulating", "flow", "integrating"}
        What the process value is. ``"flow"``: PV follows the position of the valve nearly at once,
        as flows do, or is the position; ``"integrating"``: levels. Which methods apply, and to
        which signal, depends on it.

    Returns
    -------
    LoopDiagnosis

    Raises
    ------
    DataError
        Several channels, different lengths, or fewer than 24 samples without long gaps.
    OptionError
        Another process.

    Notes
    -----
    First the oscillation: the zeros of the autocorrelation function of PV are regular [1]_, it
    decays slowly [2]_, and the areas between the zeros of PV are alike [3]_. Then its cause: the
    cross-correlation of OP and PV is odd for stiction in a self-regulating loop [4]_; half cycles
    of OP, of PV in an integrating loop, are triangles rather than sines [5]_; those of PV are
    responses to a relay rather than sines [6]_; flows rest while OP moves [7]_; and a model of
    stiction before a linear process, fitted to OP and PV, has an S that is a large part of the
    swing of OP [8]_ [9]_. The verdict on the cause needs two of these methods that agree, and twice
    as many as contradict them.

    Up to three missing samples in a row are interpolated; longer gaps cut the record, and the
    longest part is judged. An external disturbance with edges, and a limit cycle by other
    nonlinearities, look like stiction to all of these.

    References
    ----------
    .. [1] N. F. Thornhill, B. Huang and H. Zhang, Detection of multiple oscillations in control
       loops, Journal of Process Control 13 (2003) 91-100.
    .. [2] T. Miao and D. E. Seborg, Automatic detection of excessively oscillatory feedback
       control loops, IEEE International Conference on Control Applications, 1999, 359-364.
    .. [3] T. Hägglund, A control-loop performance monitor, Control Engineering Practice 3 (1995)
       1543-1551.
    .. [4] A. Horch, A simple method for detection of stiction in control valves, Control
       Engineering Practice 7 (1999) 1221-1231.
    .. [5] Q. P. He, J. Wang, M. Pottmann and S. J. Qin, A curve fitting method for detecting valve
       stiction in oscillating control loops, Ind. Eng. Chem. Res. 46 (2007) 4549-4560,
       doi:10.1021/ie061219a.
    .. [6] M. Rossi and C. Scali, A comparison of techniques for automatic detection of stiction:
       simulation and application to industrial data, Journal of Process Control 15 (2005) 505-514.
    .. [7] Y. Yamashita, An automatic method for detection of valve stiction in process control
       loops, Control Engineering Practice 14 (2006) 503-510.
    .. [8] R. Srinivasan, R. Rengaswamy, S. Narasimhan and R. Miller, Control loop performance
       assessment. 2. Hammerstein model approach for stiction diagnosis, Ind. Eng. Chem. Res. 44
       (2005) 6719-6728.
    .. [9] M. Jelali, Estimation of valve stiction in control loops using separable least-squares
       and global search algorithms, Journal of Process Control 18 (2008) 632-642.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> sticking = cr.bench.valve_loop(cr.actuators.Stiction(5, 2), noise=0.1)
    >>> disturbed = cr.bench.valve_loop(noise=0.1, oscillation=(2.0, 60.0))
    >>> for loop in (sticking, disturbed):
    ...     print(cr.valves.diagnose_loop(loop.simulate(600.0, rng=1).record).verdict)
    stiction
    no stiction: tuning or external oscillation
    """
    kind = one_of(process, "process", ("self-regulating", "flow", "integrating"))
    data = loop_data(loop, pv, sp, dt)
    value = data.deviation
    cycles, seen = find_cycles(value), "PV"
    state = oscillates(cycles)
    if not state:  # noise may hide in PV what the controller has integrated
        of_output = find_cycles(data.op)
        if oscillates(of_output):
            cycles, seen, state = of_output, "OP", True
    note = "" if state is not False else "no oscillation"
    correlation = halves_op = halves_pv = moved = ellipse = fit = None
    if cycles is not None and state is not False:
        period = cycles.period
        output, deviation = without_drift(data.op, period), without_drift(value, period)
        ellipse = fit_ellipse(output, deviation, period)
        correlation = cross_correlation(output, deviation, period)
        if period >= SHORTEST_PERIOD:
            halves_op, halves_pv = _halves(output, period), _halves(deviation, period)
            moved = movement_indices(output, ellipse.sign * deviation, period)
            if state:
                fit = fit_stiction(data.op, value, period, ellipse.sign, kind == "integrating")
        else:
            note = "too few samples in a cycle"
    found = (
        *methods.oscillation_methods(cycles, seen),
        methods.horch(correlation, kind, note),
        methods.curve_fit(halves_op, halves_pv, kind, note),
        methods.relay_fit(halves_pv, note),
        methods.movements(moved, kind, note),
        methods.stiction_fit(fit, note),
    )
    flags = tuple(flags_of(data, cycles))
    verdict, reason = judge(state, data.op.size, found, flags)
    return LoopDiagnosis(
        verdict, reason, state, found, kind, data, cycles, correlation, halves_op, halves_pv,
        ellipse, fit, flags, (f"process: {kind}; process= states another",),
    )  # fmt: skip


def _halves(signal: np.ndarray, period: float) -> HalfCycles | None:
    clean = smoothed(signal, period, _SMOOTHED)
    return half_cycles(clean, crossings(clean), period)
