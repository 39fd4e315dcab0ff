"""Model and result of an output-error fit, from its numerical estimate."""

from __future__ import annotations

from collections.abc import Iterator

import control as ct
import numpy as np

from ..._wording import interval_in_time
from ...delayed import DelayedStateSpace, delayed_ss
from ...numerics.arrays import ComplexArray
from ...numerics.output_error.result import OutputErrorEstimate
from .result import FOLLOWED_LESS, OutputErrorFit
from .words import form_words, model_words, order_words


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


def choices_of(fit: OutputErrorEstimate) -> Iterator[str]:
    """Say what was chosen automatically, and why."""
    chain = fit.distributed.chain
    kind = model_words(chain) if chain else order_words(fit.structure)
    count = len(fit.structures)
    if fit.process.form is not None:
        yield f"{form_words(fit.process.form)}: as requested"
    elif fit.distributed.follows_flow:
        yield (
            "dead time: that of an axial-dispersion model, which fits clearly better than all "
            f"{count} structures; {kind}: approximates it with the fewest parameters"
        )
    elif count == 1:
        yield f"{kind}: the only structure that was tried"
    else:
        simple = " with up to three poles" if fit.robust and fit.structure.order <= 3 else ""
        yield (
            f"{kind}: lowest information criterion of {count} structures{simple}, with a penalty "
            "on zeros and on a fourth pole"
        )
    yield from _closest(fit)
    residual = fit.residual
    if residual.rounded is not None and not fit.delay_estimates:
        yield (
            "dead time and model: maximum likelihood of the rounded samples, with noise of "
            f"{residual.rounded:.3g} before rounding"
        )
    if fit.delay_estimates:
        why = (
            "no model fits down to the noise level"
            if fit.robust
            else "the likelihood is flat down to the earliest dead time and has its maximum there, "
            "and most of the estimates agree on a later one"
        )
        yield f"dead time: median of five delay estimates, since {why}"
    if not fit.robust:
        yield _interval_of(fit)
    if fit.load is not None and not fit.load.early:
        yield "a step of a load is part of the model: the output tells it beyond doubt"
    if fit.open_start:
        yield (
            "interval widened towards the visible onset: with a zero in the model, the onset of "
            "the response is not identifiable"
        )
    if residual.whitened:
        yield (
            "the noise before the step is coloured: generalised least squares with an "
            f"autoregressive noise model, instead of counting {residual.correlation:.3g} samples "
            "as one"
        )
    elif residual.noise_lags:
        yield (
            "the residual is coloured: generalised least squares with an autoregressive noise "
            f"model of order {residual.noise_lags}"
        )
    elif residual.correlation > 1:
        yield (
            f"the residual is correlated: {residual.correlation:.3g} samples count as one "
            "independent sample"
        )


def _closest(fit: OutputErrorEstimate) -> Iterator[str]:
    """Name a structure that follows the record more closely, and is not the model."""
    followed = fit.followed
    other = followed.closest
    if other != fit.structure and followed.by_closest - followed.complete >= FOLLOWED_LESS:
        why = (
            "not more than additional parameters follow noise (information criterion)"
            if fit.adequate
            else "no structure reaches the noise, and simpler ones are more reliable then"
        )
        yield (
            f"{order_words(other)} follows the record more closely (fit "
            f"{followed.by_closest:.1f} % instead of {followed.complete:.1f} %), but {why}"
        )


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
