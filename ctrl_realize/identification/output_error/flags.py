"""Flags of an output-error fit: of its model, and of the record that was fitted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import (
    in_time,
    interval_in_time,
    plainly,
    rate_in_time,
    time_and_interval,
    time_within,
)
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.engine.poles import lag_sum
from ...numerics.engine.profile import profile_limits
from ...numerics.engine.static_gain import INTEGRATOR
from ...numerics.output_error.margins import CLOSE, DecisionKey
from ...numerics.output_error.result import OutputErrorEstimate, StructureFit
from ...numerics.output_error.step_data import StepData
from .sensor_flags import outliers
from .words import ESTIMATE_WORDS, is_firm, order_words, sign_is_told, structure_words

# Thresholds for flags alone are a matter of presentation.
_SAMPLES_BESIDE_NOTHING = 0.5  # a dead time below it counts as zero
_FAR_APART = 0.5  # width of an interval, in dead times, from which structures disagree
_GAINS_APART = 0.2  # relative difference of gain or total delay between structures
_AS_GOOD = 4.0  # insignificant difference of the criterion: chi-square, one degree of freedom, 95 %
_CANCELLED = 0.05  # distance of a pole from a zero that cancels it, relative to its frequency
_SETTLED = 3.0
"""Time constants after which a lag counts as settled: 95 % of its step response."""
_DECISIONS: dict[DecisionKey, str] = {
    "structure": "{} fits as well as the one chosen",
    "ruled_out": "{} is at the limit of what the data rule out",
    "adequate": "the residual is at the limit of what counts as noise",
    "likelihood": "the dead time is at the limit between the likelihood and several estimates",
}


def fit_flags(
    data: StepData, fit: OutputErrorEstimate, latest: float | None, start: float
) -> Iterator[Flag]:
    """List the flags of a fit of one (mean) step record whose first sample is at `start` s."""
    yield from model_flags(fit, data.dt, data.length, latest)
    yield from _record_flags(data, fit, start)


def sampled_flags(
    fit: OutputErrorEstimate, dt: float, length: float, latest: float | None
) -> Iterator[Flag]:
    """List the flags of a fit of a record whose input is not a step."""
    yield from model_flags(fit, dt, length, latest)
    if not fit.adequate:
        yield flagged("coloured_residual", samples=fit.residual.correlation)


def model_flags(
    fit: OutputErrorEstimate, dt: float, length: float, latest: float | None
) -> Iterator[Flag]:
    """List the flags that follow from the model itself.

    `length` is that of the record in s, `latest` the dead time up to which was to be sought.
    """
    extrapolated = [*_slow_modes(fit, length), *_unresolved_gain(fit, length)]
    firm = ""
    if not extrapolated and (fit.static is None or is_firm(fit.static.total, fit.total_ends)):
        firm = "; only the total delay is well determined"
    form, process = fit.process.form, structure_words(fit)
    if fit.better is not None:
        yield flagged(
            "apparent_dead_time",
            requested=process,
            dead_time=time_within(fit.dead_time, fit.low, fit.high),
            other=order_words(fit.better),
            other_dead_time=_dead_time_of(fit.better),
        )
    elif other := _contradicting(fit):
        yield flagged(
            "structure_not_certain",
            requested=process,
            other=order_words(other),
            dead_time=_dead_time_of(other),
        )
    if form and (bounds := [name for name in fit.process.at_bound if name in form.bounds]):
        yield flagged("parameter_at_bound", names=", ".join(bounds))
    reached = latest is not None and fit.latest >= latest * (1 - 1e-9)
    if reached and fit.high >= 0.98 * fit.latest:
        yield flagged("delay_at_bound", max_delay=fit.latest / dt)
    stated = form and (not form.dead_time or "dead_time" in form.fixed)
    if fit.low <= _SAMPLES_BESIDE_NOTHING * dt and not stated:
        yield flagged("no_delay_resolved", high=in_time(fit.high))
    if fit.distributed.unlimited:
        yield flagged("many_lags", firm=firm)
    yield from _dispersed_flow(fit)
    if fit.open_start:
        interval = interval_in_time(fit.low, fit.high, "and")
        yield flagged("onset_open", interval=interval, firm=firm)
    yield from extrapolated
    yield from _cancelled_pair(fit)
    yield from _disagreement(fit, dt, firm)
    zeros = right_zeros(fit)
    right = np.sort(zeros[zeros.imag == 0].real)
    # A response begins in the wrong direction if the number of its real zeros there is odd.
    if right.size % 2:
        yield flagged("inverse_response", zero=right[0])
    if fit.close:
        named = [(near.key, near.structure and order_words(near.structure)) for near in fit.close]
        said = "; ".join(_DECISIONS[key].format(structure) for key, structure in named)
        yield flagged("marginal_decision", decisions=said, close=CLOSE)


def _dead_time_of(line: StructureFit) -> str:
    assert line.interval is not None
    return time_and_interval(line.dead_time, *line.interval)


def _contradicting(fit: OutputErrorEstimate) -> StructureFit | None:
    """Structure that was not requested and fits as well, with another dead time."""
    for other in fit.others.not_ruled_out if fit.others is not None else ():
        if other.delta_bic <= _AS_GOOD and not fit.low <= other.dead_time <= fit.high:
            return other
    return None


def _dispersed_flow(fit: OutputErrorEstimate) -> Iterator[Flag]:
    """Report that axial dispersion explains the response better than lags."""
    flow = min(fit.distributed.flows, key=lambda flow: flow.delta_bic, default=None)
    if flow is None or (flow.delta_bic >= 0 and not fit.distributed.follows_flow):
        return
    yield flagged(
        "dispersed_flow.chosen" if fit.distributed.follows_flow else "dispersed_flow",
        mean=in_time(flow.mean),
        peclet=flow.peclet,
        behind=f" and a lag of {in_time(flow.lag)}" if flow.lag else "",
        dead_time=in_time(flow.dead_time),
    )


def _slow_modes(fit: OutputErrorEstimate, length: float) -> Iterator[Flag]:
    """Report that a record of `length` s ends before the slowest mode has decayed."""
    slowest = float(np.abs(fit.poles).min()) * length
    if slowest < INTEGRATOR:
        yield flagged("integrating")
        return
    seen = max(length - fit.dead_time, 0.0)
    unseen = _not_died_away(fit.poles, seen)
    if unseen.size:
        less = " of a pole pair of which less than one period was recorded"
        yield flagged(
            "not_settled",
            constants=seen * float(np.min(-unseen.real)),
            pair=less if np.any(unseen.imag) else "",
        )


def _not_died_away(poles: ComplexArray, seen: float) -> ComplexArray:
    """Poles whose part of the response has not decayed at the end of the record.

    The decay is exp(re(p) t), whatever |p| is. An oscillatory pair shows its mean, and thus the
    gain, after a period; if it was observed for less, the record only contains its rise.
    """
    slow = -poles.real * seen < _SETTLED
    return poles[slow & (np.abs(poles.imag) * seen < 2 * np.pi)]


def _unresolved_gain(fit: OutputErrorEstimate, length: float) -> Iterator[Flag]:
    """Report that gain or total delay are not determined: structures differ, or the sign is open.

    The sign is determined if the interval of the gain does not contain zero (`sign_is_told`).
    """
    if fit.static is not None and not sign_is_told(fit.gain_ends):
        gain, (low, high) = fit.static.gain, fit.gain_ends
        if fit.load is not None and fit.load.early:
            yield flagged("gain_not_resolved.load", gain=gain)
        elif fit.static.resolved:
            yield flagged("gain_not_resolved.sign", gain=gain, low=low, high=high)
        else:
            slowest = in_time(float(1 / np.abs(fit.poles).min()))
            error, whole = fit.static.gain_std, in_time(length)
            yield flagged(
                "gain_not_resolved.slow", gain=gain, slowest=slowest, length=whole, error=error
            )
        return
    kept = [line for line in fit.structures if line.delta_bic <= _AS_GOOD]
    gain = float(np.real(fit.numerator[0] / np.prod(-fit.poles)))
    total = fit.dead_time + lag_sum(fit.poles, fit.numerator)
    gains = np.array([gain, *(line.gain for line in kept)])
    totals = np.array([total, *(line.total_delay for line in kept)])
    if not fit.robust and (_apart(gains) or _apart(totals)):
        between = interval_in_time(totals.min(), totals.max())
        yield flagged("gain_not_resolved", low=gains.min(), high=gains.max(), totals=between)


def _apart(values: FloatArray) -> bool:
    """Whether values differ from the first by more than is usual between structures."""
    return bool(np.any(np.abs(values - values[0]) > _GAINS_APART * np.abs(values[0])))


def _cancelled_pair(fit: OutputErrorEstimate) -> Iterator[Flag]:
    """Report the first pair of poles that is nearly cancelled by zeros."""
    zeros = np.roots(fit.numerator[::-1])
    for pole in fit.poles[fit.poles.imag > 0]:
        if np.any(np.abs(zeros - pole) < _CANCELLED * abs(pole)):
            yield flagged("cancelled_pair", frequency=abs(pole) / (2 * np.pi))
            return


def _disagreement(fit: OutputErrorEstimate, dt: float, firm: str) -> Iterator[Flag]:
    """Report dead times of estimates, or of structures, that are far apart."""
    width, dead_time = fit.high - fit.low, max(fit.dead_time, dt)
    if fit.delay_estimates:
        if width > 0.3 * dead_time:
            apart = [
                f"{ESTIMATE_WORDS[key]} {in_time(delay)}"
                for key, delay in fit.delay_estimates
                if abs(delay - fit.dead_time) > 0.15 * fit.dead_time
            ]
            yield flagged("estimates_disagree", estimates=", ".join(apart))
        return
    low, high = profile_limits(*fit.profile)
    if not fit.open_start and width > max(_FAR_APART * dead_time, 2 * (high - low)):
        yield flagged(
            "structures_disagree",
            chosen=interval_in_time(low, high),
            all=interval_in_time(fit.low, fit.high),
            firm=firm,
        )


def right_zeros(fit: OutputErrorEstimate) -> ComplexArray:
    """Zeros in the right half-plane that are not far faster than the poles."""
    if fit.distributed.follows_flow:
        # They delay the onset, as dispersion does.
        return np.empty(0, dtype=np.complex128)
    zeros = np.roots(fit.numerator[::-1]).astype(np.complex128)
    near = np.abs(zeros) <= 3 * np.abs(fit.poles).max()
    return np.asarray(zeros[(zeros.real > 0) & near])


def _record_flags(data: StepData, fit: OutputErrorEstimate, start: float) -> Iterator[Flag]:
    """List the flags of the record: what the model does not explain, and what disturbed it."""
    if not fit.adequate:
        yield flagged(
            "structured_misfit" if fit.delay_estimates else "structured_misfit.stated",
            ratio=plainly(fit.residual.normalized_rms, 2),
        )
    if fit.load is not None:
        yield flagged(
            "load_disturbance.early" if fit.load.early else "load_disturbance",
            size=fit.load.size,
            when=in_time(start + fit.load.time, 4),
        )
    if data.edge < 8:
        yield flagged("no_rest", samples=data.edge)
    if data.relaxing:
        yield flagged("not_at_rest")
    elif data.drift:
        yield flagged("drift", rate=rate_in_time(data.drift / data.dt))
    if data.hum:
        yield flagged("hum", lines=", ".join(f"{f / data.dt:.4g} Hz" for f in data.hum))
    if data.coarse:
        yield flagged("coarse_quantisation", quantum=data.quantum)
    noise = max(fit.residual.std, data.sigma) if fit.adequate else None
    yield from outliers(data.output, fit.fitted, noise)
