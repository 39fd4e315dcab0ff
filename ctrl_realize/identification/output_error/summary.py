"""Model and result of an output-error fit, from its numerical estimate."""

from __future__ import annotations

import control as ct
import numpy as np

from ..._wording import interval_in_time
from ...delayed import DelayedStateSpace, delayed_ss
from ...numerics.arrays import ComplexArray
from ...numerics.output_error.result import OutputErrorEstimate
from .result import FOLLOWED_LESS, OutputErrorFit
from .words import form_words, model_words


def fitted_model(core: ct.StateSpace, result: OutputErrorFit) -> DelayedStateSpace:
    """Make the model of a fit from its continuous core, with the names of the first record."""
    first = result.records[0]
    return delayed_ss(
        core,
        dead_time=result.dead_time,
        dt=result.dt,
        fit=result,
        name=first.name or None,
        inputs=list(first.input_labels),
        outputs=list(first.output_labels),
    )


def fitted_core(fit: OutputErrorEstimate, poles: ComplexArray) -> ct.StateSpace:
    """Companion form of b(s)/a(s), in a time unit that makes its entries comparable."""
    n = poles.size
    moving = np.abs(poles[poles != 0])
    unit = float(np.exp(np.mean(np.log(moving)))) if moving.size else 1.0
    a = np.real(np.poly(poles / unit))[1:]
    b = np.zeros(n)
    b[: fit.numerator.size] = fit.numerator * unit ** (np.arange(fit.numerator.size) - float(n))
    matrix = np.eye(n, k=1)
    matrix[-1] = -a[::-1]
    last = np.zeros((n, 1))
    last[-1] = 1.0
    return ct.StateSpace(unit * matrix, unit * last, b[None], np.zeros((1, 1)))


def choices_of(fit: OutputErrorEstimate) -> tuple[str, ...]:
    """Say what was chosen automatically, and why."""
    s = fit.structure
    simple = " with up to three poles" if fit.robust and s.order <= 3 else ""
    kind = (
        model_words(fit.distributed.chain)
        if fit.distributed.chain
        else f"order {s.order}, relative degree {s.relative_degree}"
    )
    if fit.distributed.follows_flow:
        reasons = [
            "dead time: that of an axial-dispersion model, which fits clearly better than "
            f"all {len(fit.structures)} structures; {kind}: approximates it with the fewest "
            "parameters"
        ]
    else:
        reasons = [
            f"{kind}: lowest information criterion of {len(fit.structures)} "
            f"structures{simple}, with a penalty on zeros and on a fourth pole"
            if len(fit.structures) > 1
            else f"{kind}: the only structure that was tried"
        ]
    if fit.process.form is not None:
        reasons = [f"{form_words(fit.process.form)}: as requested"]
    reasons += _closest(fit)
    if fit.residual.rounded is not None and not fit.delay_estimates:
        reasons.append(
            "dead time and model: maximum likelihood of the rounded samples, with noise of "
            f"{fit.residual.rounded:.3g} before rounding"
        )
    if fit.delay_estimates:
        why = (
            "no model fits down to the noise level"
            if fit.robust
            else "the likelihood is flat down to the earliest dead time and has its maximum there, "
            "and most of the estimates agree on a later one"
        )
        reasons.append(f"dead time: median of five delay estimates, since {why}")
    if not fit.robust:
        reasons.append(_interval_of(fit))
    if fit.load is not None and not fit.load.early:
        reasons.append("a step of a load is part of the model: the output tells it beyond doubt")
    if fit.open_start:
        reasons.append(
            "interval widened towards the visible onset: with a zero in the model, the onset "
            "of the response is not identifiable"
        )
    if fit.residual.whitened:
        reasons.append(
            "the noise before the step is coloured: generalised least squares with an "
            f"autoregressive noise model, instead of counting {fit.residual.correlation:.3g} "
            "samples as one"
        )
    elif fit.residual.noise_lags:
        reasons.append(
            "the residual is coloured: generalised least squares with an autoregressive noise "
            f"model of order {fit.residual.noise_lags}"
        )
    elif fit.residual.correlation > 1:
        reasons.append(
            f"the residual is correlated: {fit.residual.correlation:.3g} samples count as one "
            "independent sample"
        )
    return tuple(reasons)


def _closest(fit: OutputErrorEstimate) -> list[str]:
    """Name a structure that follows the record more closely, and is not the model."""
    followed = fit.followed
    other = followed.closest
    if other == fit.structure or followed.by_closest - followed.complete < FOLLOWED_LESS:
        return []
    return [
        f"order {other.order}, relative degree {other.relative_degree} follows the record more "
        f"closely (fit {followed.by_closest:.1f} % instead of {followed.complete:.1f} %), but "
        + (
            "not more than additional parameters follow noise (information criterion)"
            if fit.adequate
            else "no structure reaches the noise, and simpler ones are more reliable then"
        )
    ]


def _interval_of(fit: OutputErrorEstimate) -> str:
    """Describe the interval: structures, and other models that extend it."""
    ends = [line.interval for line in fit.structures if line.interval is not None]
    if fit.process.form is not None:
        return "interval: profile likelihood of the process models that the data cannot rule out"
    parts = [f"{len(ends)} structure(s)"] if ends else []
    low = min((end[0] for end in ends), default=np.inf)
    high = max((end[1] for end in ends), default=-np.inf)
    parts += [
        f"{model_words(model)} ({interval_in_time(first, last)})"
        for model, first, last in fit.distributed.not_ruled_out
        if first < low or last > high
    ]
    return f"interval: profile likelihood of {', '.join(parts)} that the data cannot rule out"
