"""Flags of an output-error fit."""

from __future__ import annotations

import numpy as np

from ..._wording import in_time, interval_in_time, plainly, rate_in_time, time_within
from ...numerics.arrays import ComplexArray
from ...numerics.engine.profile_ends import profile_limits
from ...numerics.output_error.margins import CLOSE, DecisionKey
from ...numerics.output_error.result import OutputErrorEstimate
from ...numerics.output_error.step_data import StepData
from ...results import Flag
from .model_flags import AS_GOOD, cancelled_pair, slow_modes, unresolved_gain
from .sensor_flags import outliers
from .words import ESTIMATE_WORDS, is_firm, structure_words

# Thresholds for flags alone are a matter of presentation.
_SAMPLES_BESIDE_NOTHING = 0.5  # a dead time below it counts as zero
_FAR_APART = 0.5  # width of an interval, in dead times, from which structures disagree


def fit_flags(
    data: StepData, fit: OutputErrorEstimate, max_delay: float | None, start: float
) -> tuple[Flag, ...]:
    """List the flags of a fit of one (mean) step record whose first sample is at `start` s."""
    found = [
        *model_flags(fit, data.dt, data.length, max_delay),
        _misfit(fit),
        _load(fit, start),
        *_disturbances(data, fit),
    ]
    return tuple(flag for flag in found if flag is not None)


def sampled_flags(
    fit: OutputErrorEstimate, dt: float, length: float, max_delay: float | None
) -> tuple[Flag, ...]:
    """List the flags of a fit of a record whose input is not a step."""
    found = model_flags(fit, dt, length, max_delay)
    if not fit.adequate:
        found.append(
            Flag(
                "coloured_residual",
                f"{fit.residual.correlation:.3g} neighbouring samples of the residual carry the "
                "information of one independent sample: coloured disturbances, or unmodelled "
                "dynamics; the interval is widened accordingly",
            )
        )
    return tuple(flag for flag in found if flag is not None)


def model_flags(
    fit: OutputErrorEstimate, dt: float, length: float, max_delay: float | None
) -> list[Flag | None]:
    """List the flags that follow from the model itself."""
    extrapolated = slow_modes(fit, length), unresolved_gain(fit, length)
    firm = "" if any(extrapolated) else _only_total(fit)
    return [
        _apparent(fit),
        _contradicting(fit),
        _parameter_bound(fit),
        _bound(dt, fit, max_delay),
        _nothing(dt, fit),
        _many_lags(fit, firm),
        _dispersed(fit),
        _open_start(fit, firm),
        *extrapolated,
        cancelled_pair(fit),
        _disagreement(dt, fit, firm),
        _inverse(fit),
        _marginal(fit),
    ]


def _marginal(fit: OutputErrorEstimate) -> Flag | None:
    """Report decisions so close that rounding may change them."""
    if not fit.close:
        return None
    words: dict[DecisionKey, str] = {
        "structure": "{} fits as well as the one chosen",
        "ruled_out": "{} is at the limit of what the data rule out",
        "adequate": "the residual is at the limit of what counts as noise",
        "likelihood": "the dead time is at the limit between the likelihood and several estimates",
    }
    found = [
        words[one.key].format(
            one.structure
            and f"order {one.structure.order}, relative degree {one.structure.relative_degree}"
        )
        for one in fit.close
    ]
    return Flag(
        "marginal_decision",
        f"{'; '.join(found)}: within {CLOSE:g} of the threshold, so that rounding on another "
        "processor may decide otherwise; compare the models in `structures`",
    )


def _apparent(fit: OutputErrorEstimate) -> Flag | None:
    """Report that the requested structures are ruled out by another one."""
    if fit.better is None:
        return None
    other = fit.better
    assert other.interval is not None
    return Flag(
        "apparent_dead_time",
        f"{structure_words(fit)} was requested and is ruled out by the data: "
        f"{time_within(fit.dead_time, fit.low, fit.high)} is an apparent dead time, which "
        "compensates for missing or superfluous lags, and its interval is valid only if the "
        f"structure is right; order {other.order}, relative degree {other.relative_degree} gives "
        f"{time_within(other.dead_time, *other.interval)} "
        f"({interval_in_time(*other.interval)})",
    )


def _contradicting(fit: OutputErrorEstimate) -> Flag | None:
    """Report that structures that were not requested fit as well, with another dead time."""
    if fit.others is None or fit.better is not None:
        return None
    for other in fit.others.not_ruled_out:
        if other.delta_bic <= AS_GOOD and not fit.low <= other.dead_time <= fit.high:
            assert other.interval is not None
            return Flag(
                "structure_not_certain",
                f"{structure_words(fit)} was requested; order {other.order}, relative degree "
                f"{other.relative_degree} fits as well, with a dead time of "
                f"{time_within(other.dead_time, *other.interval)} "
                f"({interval_in_time(*other.interval)}): the interval holds only if the requested "
                "structure is right; without it, identify gives one that covers the choice",
            )
    return None


def _parameter_bound(fit: OutputErrorEstimate) -> Flag | None:
    """Report that parameters of a process model ended at a bound that was asked for."""
    asked = (
        ()
        if fit.process.form is None
        else tuple(n for n in fit.process.at_bound if n in fit.process.form.bounds)
    )
    if not asked:
        return None
    return Flag(
        "parameter_at_bound",
        f"{', '.join(asked)} ended at a bound: the data suggest a value beyond it, and the other "
        "parameters make up for that; try wider bounds",
    )


def _bound(dt: float, fit: OutputErrorEstimate, max_delay: float | None) -> Flag | None:
    if max_delay is None or fit.latest < max_delay * dt * (1 - 1e-9):
        return None
    if fit.high < 0.98 * fit.latest:
        return None
    return Flag(
        "delay_at_bound",
        f"the dead time may be larger than max_delay={max_delay:g} samples; try a larger one",
    )


def _misfit(fit: OutputErrorEstimate) -> Flag | None:
    if fit.adequate:
        return None
    return Flag(
        "structured_misfit",
        "no model fits down to the noise level (the residual, averaged over bins, is "
        f"{plainly(fit.residual.normalized_rms, 2)} times the noise): "
        "the plant is nonlinear or has unmodelled dynamics; "
        + (
            "the dead time is the median of five delay estimates and the interval is their range"
            if fit.delay_estimates
            else "the interval is valid only if a given structure is that of the plant"
        )
        + "; actuator='auto' also fits what a valve or drive does before or behind the lags",
    )


def _load(fit: OutputErrorEstimate, start: float) -> Flag | None:
    """Report that something else moved the output, and what to do."""
    if fit.load is None:
        return None
    when = in_time(start + fit.load.time, 4)
    known = (
        "so soon after a step of the input that its response cannot be told from that of the "
        "input: gain and total delay are not determined; repeat the test"
        if fit.load.early
        else "its response was estimated together with the model; cut the record before "
        f"{when} for a model without it"
    )
    return Flag(
        "load_disturbance",
        f"a load moved the output by {fit.load.size:.3g} from {when} on: {known}. If another "
        "signal of the record moves then, name it as a second input",
    )


def _disagreement(dt: float, fit: OutputErrorEstimate, firm: str) -> Flag | None:
    if fit.delay_estimates:
        width = fit.high - fit.low
        if width <= 0.3 * max(fit.dead_time, dt):
            return None
        apart = [
            f"{ESTIMATE_WORDS[key]} {in_time(delay)}"
            for key, delay in fit.delay_estimates
            if not _near(fit, delay)
        ]
        words = ", ".join(apart)
        return Flag("estimates_disagree", f"delay estimates far from their median: {words}")
    low, high = profile_limits(*fit.profile)
    wide = fit.high - fit.low > _FAR_APART * max(fit.dead_time, dt)
    if fit.open_start or not wide or fit.high - fit.low <= 2 * (high - low):
        return None
    return Flag(
        "structures_disagree",
        f"the chosen structure gives a dead time of {interval_in_time(low, high)}, other "
        f"structures that the data cannot rule out {interval_in_time(fit.low, fit.high)}: "
        f"dead time and fast lags are hardly distinguishable{firm}",
    )


def _near(fit: OutputErrorEstimate, delay: float) -> bool:
    return abs(delay - fit.dead_time) <= 0.15 * fit.dead_time


def _nothing(dt: float, fit: OutputErrorEstimate) -> Flag | None:
    if fit.low > _SAMPLES_BESIDE_NOTHING * dt:
        return None
    if fit.process.form is not None and (
        not fit.process.form.dead_time or "dead_time" in fit.process.form.fixed
    ):
        return None
    return Flag(
        "no_delay_resolved", f"a model without dead time fits as well (up to {in_time(fit.high)})"
    )


def _many_lags(fit: OutputErrorEstimate, firm: str) -> Flag | None:
    if not fit.distributed.unlimited:
        return None
    return Flag(
        "many_lags",
        "the fit improves with every further equal lag, up to the highest order tried: any part "
        f"of the dead time may consist of further lags{firm}",
    )


def _dispersed(fit: OutputErrorEstimate) -> Flag | None:
    """Report that axial dispersion explains the response better than lags."""
    flow = min(fit.distributed.flows, key=lambda flow: flow.delta_bic, default=None)
    if flow is None or (flow.delta_bic >= 0 and not fit.distributed.follows_flow):
        return None
    behind = f" and a lag of {in_time(flow.lag)}" if flow.lag else ""
    kind = (
        f"an axial-dispersion model (mean residence time {in_time(flow.mean)}, Peclet number "
        f"{flow.peclet:.2g}{behind})"
    )
    if fit.distributed.follows_flow:
        return Flag(
            "dispersed_flow",
            f"{kind} fits the response clearly better than a transfer function with lags: the "
            "dead time is that of the dispersion model, and the poles and zeros of the model "
            "have no physical meaning",
        )
    return Flag(
        "dispersed_flow",
        f"{kind} after a dead time of {in_time(flow.dead_time)} fits better than a transfer "
        "function with lags: if something flows through the plant, that dead time is the "
        "more likely one",
    )


def _open_start(fit: OutputErrorEstimate, firm: str) -> Flag | None:
    if not fit.open_start:
        return None
    return Flag(
        "onset_open",
        "the best model has a zero, which can imitate a smooth onset: how much of the time "
        "before the visible onset is dead time is not identifiable; it is between "
        f"{interval_in_time(fit.low, fit.high, 'and')}{firm}. Backlash and static friction have "
        "the same effect at one step amplitude: fit records of several amplitudes together, whose "
        "delays then differ, or the records with actuator='auto'",
    )


def _only_total(fit: OutputErrorEstimate) -> str:
    """State that the total delay is well determined, if it is."""
    firm = fit.static is None or is_firm(fit.static.total, fit.total_ends)
    return "; only the total delay is well determined" if firm else ""


def right_zeros(fit: OutputErrorEstimate) -> ComplexArray:
    """Zeros in the right half-plane that are not far faster than the poles."""
    if fit.distributed.follows_flow:
        # They delay the onset, as dispersion does.
        return np.empty(0, dtype=np.complex128)
    zeros = np.roots(fit.numerator[::-1]).astype(np.complex128)
    near = np.abs(zeros) <= 3 * np.abs(fit.poles).max()
    return np.asarray(zeros[(zeros.real > 0) & near])


def _inverse(fit: OutputErrorEstimate) -> Flag | None:
    zeros = right_zeros(fit)
    right = np.sort(zeros[zeros.imag == 0].real)
    # A response begins in the wrong direction if the number of its real zeros there is odd.
    if right.size % 2 == 0:
        return None
    return Flag(
        "inverse_response",
        "inverse response: the model first moves in the wrong direction (right half-plane "
        f"zero at {right[0]:.3g} rad/s); the dead time ends where that "
        "initial motion begins",
    )


def _disturbances(data: StepData, fit: OutputErrorEstimate) -> list[Flag | None]:
    flags: list[Flag | None] = []
    if data.edge < 8:
        flags.append(
            Flag(
                "no_rest",
                f"{data.edge} samples before the step: the noise is estimated from "
                "differences of neighbouring samples, which do not show slow disturbances",
            )
        )
    if data.relaxing:
        flags.append(
            Flag(
                "not_at_rest",
                "the output was still moving before the step, as after an earlier input: the "
                "free response of the model was estimated together with the model",
            )
        )
    elif data.drift:
        flags.append(
            Flag(
                "drift",
                f"a drift of {rate_in_time(data.drift / data.dt)} was estimated together with the "
                "model",
            )
        )
    if data.hum:
        lines = ", ".join(f"{f / data.dt:.4g} Hz" for f in data.hum)
        flags.append(
            Flag(
                "hum", f"a sinusoidal disturbance at {lines} was estimated together with the model"
            )
        )
    if data.coarse:
        flags.append(
            Flag(
                "coarse_quantisation",
                f"the output is quantised in steps of {data.quantum:.3g}, more than its "
                "noise: averaging does not remove the quantisation error",
            )
        )
    noise = max(fit.residual.std, data.sigma) if fit.adequate else None
    return flags + outliers(data.output, fit.fitted, noise)
