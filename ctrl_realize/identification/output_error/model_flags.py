"""Flags from the poles, zeros and competing structures of a fit."""

from __future__ import annotations

import numpy as np

from ..._wording import in_time, interval_in_time
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.engine.poles import lag_sum
from ...numerics.engine.static_gain import INTEGRATOR, StaticGain
from ...numerics.output_error.result import OutputErrorEstimate
from ...results import Flag
from .words import sign_is_told

# Thresholds for flags alone are a matter of presentation.
_GAINS_APART = 0.2  # relative difference of gain or total delay between structures
AS_GOOD = 4.0  # insignificant difference of the criterion: chi-square, one degree of freedom, 95 %
_CANCELLED = 0.05  # distance of a pole from a zero that cancels it, relative to its frequency

SETTLED = 3.0
"""Time constants after which a lag counts as settled: 95 % of its step response."""


def slow_modes(fit: OutputErrorEstimate, length: float) -> Flag | None:
    """Report that a record of `length` s ends before the slowest mode has decayed."""
    slowest = float(np.abs(fit.poles).min()) * length
    if slowest < INTEGRATOR:
        return Flag(
            "integrating",
            "the output keeps rising with a constant slope: one pole is taken as an "
            "integrator, and the total delay is that of the other lags",
        )
    seen = max(length - fit.dead_time, 0.0)
    unseen = _not_died_away(fit.poles, seen)
    if not unseen.size:
        return None
    constants = seen * float(np.min(-unseen.real))
    pair = (
        " of a pole pair of which less than one period was recorded" if np.any(unseen.imag) else ""
    )
    return Flag(
        "not_settled",
        f"the record ends {constants:.2g} of the slowest time constant{pair} after the onset "
        "of the response: gain, total delay and slowest time constant are extrapolated",
    )


def unresolved_gain(fit: OutputErrorEstimate, length: float) -> Flag | None:
    """Report that gain or total delay are not determined: structures differ, or the sign is open.

    The sign is determined if the interval of the gain does not contain zero (`sign_is_told`).
    """
    if fit.static is not None and not sign_is_told(fit.gain_ends):
        return Flag("gain_not_resolved", _no_sign(fit, fit.static, length))
    kept = [line for line in fit.structures if line.delta_bic <= AS_GOOD]
    gain, total = _gain_and_total(fit)
    gains = np.array([gain, *(line.gain for line in kept)])
    totals = np.array([total, *(line.total_delay for line in kept)])
    if fit.robust or not (_apart(gains) or _apart(totals)):
        return None
    return Flag(
        "gain_not_resolved",
        f"structures that the data cannot rule out have gains of {gains.min():.3g} to "
        f"{gains.max():.3g} and total delays of "
        f"{interval_in_time(totals.min(), totals.max())}: neither is well determined; use a "
        "longer record, or one with smaller disturbances",
    )


def _no_sign(fit: OutputErrorEstimate, static: StaticGain, length: float) -> str:
    low, high = fit.gain_ends
    if fit.load is not None and fit.load.early:
        why = "a load moved the output soon after the step, and may have any part of the response"
    elif static.resolved:
        why = f"its 95 % interval is {low:.3g} to {high:.3g}"
    else:
        why = (
            "longer time constants than its slowest one "
            f"({in_time(float(1 / np.abs(fit.poles).min()))} in a record of {in_time(length)}) are "
            f"not ruled out: the standard error of the gain is {static.gain_std:.3g}"
        )
    return (
        "the record determines neither the gain nor its sign: the gain of the model is "
        f"{static.gain:.4g}, but {why}. Use a longer record, or a larger input"
    )


def _gain_and_total(fit: OutputErrorEstimate) -> tuple[float, float]:
    own = float(np.real(fit.numerator[0] / np.prod(-fit.poles)))
    return own, fit.dead_time + lag_sum(fit.poles, fit.numerator)


def _apart(values: FloatArray) -> bool:
    """Whether values differ from the first by more than is usual between structures."""
    return bool(np.any(np.abs(values - values[0]) > _GAINS_APART * np.abs(values[0])))


def _not_died_away(poles: ComplexArray, seen: float) -> ComplexArray:
    """Poles whose part of the response has not decayed at the end of the record.

    The decay is exp(re(p) t), whatever |p| is. An oscillatory pair shows its mean, and thus the
    gain, after a period; if it was observed for less, the record only contains its rise.
    """
    slow = -poles.real * seen < SETTLED
    return poles[slow & (np.abs(poles.imag) * seen < 2 * np.pi)]


def cancelled_pair(fit: OutputErrorEstimate) -> Flag | None:
    """Report a pair of poles that is nearly cancelled by zeros."""
    zeros = np.roots(fit.numerator[::-1])
    for pole in fit.poles[fit.poles.imag > 0]:
        if np.any(np.abs(zeros - pole) < _CANCELLED * abs(pole)):
            return Flag(
                "cancelled_pair",
                f"zeros nearly cancel a pair of poles at {abs(pole) / (2 * np.pi):.3g} Hz: "
                "the output oscillates there independently of the input, and two poles "
                "of the model describe it; dead time and lags may be wrong: remove this "
                "oscillation from the output first",
            )
    return None
