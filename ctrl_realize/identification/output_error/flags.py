"""Flags of an output-error fit: of its model, and of the record that was fitted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._flags import Flag, flagged, flow_flag
from ..._wording import (
    in_time,
    interval_in_time,
    plainly,
    rate_in_time,
    time_and_interval,
    time_within,
)
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.constants import SMALLEST
from ...numerics.engine.modal import lag_sum, partial_fractions
from ...numerics.engine.profile import profile_limits
from ...numerics.engine.static_gain import INTEGRATOR, NEARLY_STRAIGHT
from ...numerics.output_error.result import (
    AT_BOUND,
    OtherStructures,
    OutputErrorEstimate,
    StructureFit,
)
from ...numerics.output_error.selection import CLOSE, DecisionKey
from ...numerics.output_error.step_data import StepData
from ...numerics.signals.filters import moving_mean
from ...numerics.signals.noise import largest_excess
from .sensor_flags import outliers
from .words import FAR_APART, gain_in_words, is_firm, order_words, sign_is_told, structure_words

# Thresholds for flags alone are a matter of presentation.
_SAMPLES_BESIDE_NOTHING = 0.5  # a dead time below it counts as zero
GAINS_APART = 0.2  # relative difference of gain or total delay between structures
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
    if not fit.adequate:
        interval = interval_in_time(fit.low, fit.high)
        yield flagged("structured_misfit", missed=missed(data, fit, start), interval=interval)
    yield from model_flags(fit, data.dt, data.length, latest)
    yield from _before_the_step(data, fit)
    yield from _record_flags(data, fit, start)


def missed(data: StepData, fit: OutputErrorEstimate, start: float) -> str:
    """Write how much of the response a model misses where most of the misfit is, and when that is.

    The root mean square without that of the noise; `start` in s. Noise hides the place less in
    means over as many samples as count as one.
    """
    error = data.output - fit.fitted
    means = moving_mean(error, round(fit.residual.correlation))
    first, stop = largest_excess(means)
    power, least = (float(np.mean(part[first:stop] ** 2)) for part in (error, means))
    share = _percent(float(np.sqrt(max(power - data.sigma**2, least))), data)
    begins, ends = start + data.clock[[first, stop - 1]]
    when = interval_in_time(begins, ends, "and")
    return f"{share} between {when} ({plainly(fit.residual.normalized_rms, 2)} times the noise)"


def _percent(size: float, data: StepData) -> str:
    span = float(np.ptp(data.output)) if data.motion is None else data.motion.span
    return f"{plainly(100 * size / span, 2)} % of the response"


def coarse_flag(quantum: float, data: StepData) -> Flag:
    """Tell of an output that is rounded more than its noise."""
    return flagged("coarse_quantisation", quantum=quantum, share=_percent(quantum, data))


def sampled_flags(
    fit: OutputErrorEstimate, dt: float, length: float, latest: float | None
) -> Iterator[Flag]:
    """List the flags of a fit of a record whose input is not a step."""
    yield from model_flags(fit, dt, length, latest)
    if not fit.adequate:
        yield flagged("coloured_residual", samples=fit.residual.correlation)


def model_flags(
    fit: OutputErrorEstimate,
    dt: float,
    length: float,
    latest: float | None,
    gain_ends: tuple[float, float] | None = None,
) -> Iterator[Flag]:
    """List the flags that follow from the model itself.

    `length` is that of the record in s, `latest` the dead time up to which was to be sought,
    `gain_ends` the interval of the gain where it is not that of the model alone.
    """
    extrapolated = list(_extrapolated(fit, length, gain_ends or fit.gain_ends))
    form, process = fit.process.form, structure_words(fit)
    if fit.better is not None:
        yield flagged(
            "apparent_dead_time",
            requested=process,
            dead_time=time_within(fit.dead_time, fit.low, fit.high),
            other=order_words(fit.better),
            other_dead_time=dead_time_of(fit.better),
        )
    elif other := _contradicting(fit):
        yield flagged(
            "structure_not_certain",
            requested=process,
            other=order_words(other),
            dead_time=dead_time_of(other),
        )
    if form and (bounds := [name for name in fit.process.at_bound if name in form.bounds]):
        yield flagged("parameter_at_bound", names=", ".join(bounds))
    reached = latest is not None and fit.latest >= latest * (1 - 1e-9)
    if reached and fit.high >= AT_BOUND * fit.latest:
        yield flagged("delay_at_bound", max_delay=fit.latest / dt)
    none = _may_be_none(fit, dt)
    if none or fit.open_start or (not fit.averaged and _is_wide(fit, dt)):
        yield flagged(
            "no_delay_resolved" if none else "structures_disagree",
            interval=interval_in_time(fit.low, fit.high),
            known="" if extrapolated else _known_sum(fit),
        )
    if fit.distributed.unlimited:
        yield flagged("many_lags", known="" if extrapolated else _known_sum(fit))
    yield from _dispersed_flow(fit)
    yield from extrapolated
    yield from _cancelled_pair(fit)
    zeros = right_zeros(fit)
    right = np.sort(zeros[zeros.imag == 0].real)
    # A response begins in the wrong direction if the number of its real zeros there is odd.
    if right.size % 2:
        yield flagged("inverse_response", zero=right[0])
    if fit.close:
        named = [(near.key, near.structure and order_words(near.structure)) for near in fit.close]
        said = "; ".join(_DECISIONS[key].format(structure) for key, structure in named)
        yield flagged("marginal_decision", decisions=said, close=CLOSE)


def _known_sum(fit: OutputErrorEstimate) -> str:
    if fit.static is None or not (fit.adequate and is_firm(fit.static.total, fit.total_ends)):
        return ""
    return f"; their sum is {time_and_interval(fit.static.total, *fit.total_ends)}"


def dead_time_of(line: StructureFit) -> str:
    """Dead time of a structure that is not ruled out, with its interval."""
    assert line.interval is not None
    return time_and_interval(line.dead_time, *line.interval)


def _contradicting(fit: OutputErrorEstimate) -> StructureFit | None:
    """Structure that was not requested and fits as well, with another dead time."""
    others = fit.others or OtherStructures()
    for other in others.alike:
        if other.delta_bic <= _AS_GOOD and not fit.low <= other.dead_time <= fit.high:
            return others.with_interval(other)
    return None


def _dispersed_flow(fit: OutputErrorEstimate) -> Iterator[Flag]:
    """Report that axial dispersion explains the response better than lags."""
    flow = min(fit.distributed.flows, key=lambda flow: flow.delta_bic, default=None)
    if flow is None or (flow.delta_bic >= 0 and not fit.distributed.follows_flow):
        return
    yield flow_flag(flow, followed=fit.distributed.follows_flow)


def _extrapolated(
    fit: OutputErrorEstimate, length: float, gain_ends: tuple[float, float]
) -> Iterator[Flag]:
    """Report that a record of `length` s does not show the gain, or not all of the response."""
    seen, ends, unseen = max(length - fit.dead_time, 0.0), "", fit.poles[:0]
    if np.abs(fit.poles).min() * length < INTEGRATOR:
        yield flagged("integrating")
    elif fit.numerator[0] and (unseen := _not_died_away(fit.poles, seen)).size:
        residues, gain, _ = partial_fractions(fit.poles[None], np.ones(1), fit.numerator.size)
        left = float(np.real(np.exp(fit.poles * seen) @ residues[0] @ fit.numerator))
        reached = 1 + left / (gain[0] * fit.numerator[0])
        ends = f"the record ends at {plainly(100 * reached, 2)} % of the response"
    unresolved = list(_unresolved_gain(fit, length, ends and f"; {ends}"))
    yield from unresolved
    if ends and not unresolved:
        periods = 2 * np.pi / np.maximum(np.abs(unseen.imag), SMALLEST)
        more = float(np.max(np.minimum(_SETTLED / -unseen.real, periods))) - seen
        said = gain_in_words(float(gain[0] * fit.numerator[0]), gain_ends)
        yield flagged("not_settled", ends=ends, gain=said, more=in_time(more, 2))


def _not_died_away(poles: ComplexArray, seen: float) -> ComplexArray:
    """Poles whose part of the response has not decayed at the end of the record.

    The decay is exp(re(p) t), whatever |p| is. An oscillatory pair shows its mean, and thus the
    gain, after a period; if it was observed for less, the record only contains its rise.
    """
    slow = -poles.real * seen < _SETTLED
    return poles[slow & (np.abs(poles.imag) * seen < 2 * np.pi)]


def _unresolved_gain(fit: OutputErrorEstimate, length: float, ends: str) -> Iterator[Flag]:
    """Report that gain or total delay are not determined: structures differ, or the sign is open.

    The sign is determined if the interval of the gain does not contain zero (`sign_is_told`);
    `ends` says where the record ends, if that is too early.
    """
    if fit.static is not None and not sign_is_told(fit.gain_ends):
        gain, (low, high) = fit.static.gain, fit.gain_ends
        if fit.load is not None and fit.load.early:
            yield flagged("gain_not_resolved.load", gain=gain)
        elif fit.static.resolved:
            yield flagged("gain_not_resolved.sign", gain=gain, low=low, high=high, ends=ends)
        else:
            slowest, error = in_time(float(1 / np.abs(fit.poles).min())), fit.static.gain_std
            yield flagged("gain_not_resolved.slow", gain=gain, slowest=slowest, error=error)
        return
    kept = [line for line in fit.structures if line.delta_bic <= _AS_GOOD]
    gain = float(np.real(fit.numerator[0] / np.prod(-fit.poles)))
    total = fit.dead_time + lag_sum(fit.poles, fit.numerator)
    gains = np.array([gain, *(line.gain for line in kept)])
    totals = np.array([total, *(line.total_delay for line in kept)])
    rates = np.array([np.abs(poles).min() for poles in (fit.poles, *(line.poles for line in kept))])
    least, most = fit.gain_ends
    if rates[0] * length < INTEGRATOR and rates.max() * length < NEARLY_STRAIGHT:
        gains, totals = gains * rates, totals - 1 / rates  # those of a slope
        least, most = -np.inf, np.inf
    if not fit.robust and (_apart(gains) or _apart(totals)):
        low, high, between = gains.min(), gains.max(), interval_in_time(totals.min(), totals.max())
        beyond = "" if least <= low and high <= most else " (more than its interval holds)"
        yield flagged(
            "gain_not_resolved", low=low, high=high, beyond=beyond, totals=between, ends=ends
        )


def _apart(values: FloatArray) -> bool:
    """Whether values differ from the first by more than is usual between structures."""
    return bool(np.any(np.abs(values - values[0]) > GAINS_APART * np.abs(values[0])))


def _cancelled_pair(fit: OutputErrorEstimate) -> Iterator[Flag]:
    """Report the first pair of poles that is nearly cancelled by zeros."""
    zeros = np.roots(fit.numerator[::-1])
    for pole in fit.poles[fit.poles.imag > 0]:
        if np.any(np.abs(zeros - pole) < _CANCELLED * abs(pole)):
            yield flagged("cancelled_pair", frequency=abs(pole) / (2 * np.pi))
            return


def _may_be_none(fit: OutputErrorEstimate, dt: float) -> bool:
    """Whether a model without dead time fits as well, unless that was stated."""
    form = fit.process.form
    stated = form is not None and (not form.dead_time or "dead_time" in form.fixed)
    return fit.low <= _SAMPLES_BESIDE_NOTHING * dt and not stated


def _is_wide(fit: OutputErrorEstimate, dt: float) -> bool:
    """Whether structures, or estimates beside a model at noise level, are far apart."""
    width, (low, high) = fit.high - fit.low, profile_limits(*fit.profile)
    within = 0.0 if fit.delay_estimates else 2 * (high - low)
    return not fit.robust and width > max(FAR_APART * max(fit.dead_time, dt), within)


def right_zeros(fit: OutputErrorEstimate) -> ComplexArray:
    """Zeros in the right half-plane that are not far faster than the poles."""
    if fit.distributed.follows_flow:
        # They delay the onset, as dispersion does.
        return np.empty(0, dtype=np.complex128)
    zeros = np.roots(fit.numerator[::-1]).astype(np.complex128)
    return np.asarray(zeros[(zeros.real > 0) & (np.abs(zeros) <= 3 * np.abs(fit.poles).max())])


def _before_the_step(data: StepData, fit: OutputErrorEstimate) -> Iterator[Flag]:
    """Report an output that moved before the step, or may have.

    An input change before the record may explain the start of the response if that starts together
    with the step and less than a total delay was recorded before it; or if the model has zeros in
    the right half-plane, with which it imitates a second response, and less than the dead time was
    recorded.
    """
    rest = data.edges[0][0] * data.dt
    if data.relaxing:
        moved = _percent(float(np.ptp(fit.fitted[: data.edge])), data)
        yield flagged("not_at_rest", moved=moved, rest=in_time(rest))
        return
    lags = fit.poles[np.abs(fit.poles) * data.length >= INTEGRATOR]
    at_once = _may_be_none(fit, data.dt) and rest < fit.dead_time + lag_sum(lags, fit.numerator)
    detour = rest < fit.high and right_zeros(fit).size > 0
    if at_once or detour:
        yield flagged("earlier_input" if at_once else "earlier_input.zeros", rest=in_time(rest))


def _record_flags(data: StepData, fit: OutputErrorEstimate, start: float) -> Iterator[Flag]:
    """List the flags of the record: what disturbed it."""
    if fit.load is not None:
        size, when = fit.load.size, in_time(start + fit.load.time, 4)
        if fit.load.own_gain and fit.static is not None:
            gain = fit.static.gain + fit.load.own_gain
            yield flagged("load_disturbance.own", size=size, when=when, gain=gain)
        else:
            yield flagged(
                "load_disturbance.early" if fit.load.early else "load_disturbance",
                size=size,
                when=when,
            )
    if data.edge < 8:
        yield flagged("no_rest", samples=data.edge, share=_percent(data.sigma, data))
    if data.drift and not data.relaxing:
        share = _percent(abs(data.drift) * data.input.size, data)
        yield flagged("drift", rate=rate_in_time(data.drift / data.dt), share=share)
    if data.hum:
        yield flagged("hum", lines=", ".join(f"{f / data.dt:.4g} Hz" for f in data.hum))
    if data.coarse:
        yield coarse_flag(data.quantum, data)
    noise = max(fit.residual.std, data.sigma) if fit.adequate else np.inf
    yield from outliers(data.output, (data.output - fit.fitted) / noise, start + data.clock)
