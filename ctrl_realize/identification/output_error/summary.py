"""Model and result of an output-error fit, from its numerical estimate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..._wording import chosen, interval_in_time
from ...delayed import DelayedStateSpace, delayed_ss
from ...delayed.operands import in_state_space
from ...numerics.output_error.result import OutputErrorEstimate
from ..plausible import continuous_core
from .result import FOLLOWED_LESS, OutputErrorFit
from .words import form_words, model_words, order_words


def fitted_model(result: OutputErrorFit, known: Any = None) -> DelayedStateSpace:
    """Make the model of a fit, with the names of the first record, and a known part behind it."""
    first, core = result.records[0], continuous_core(result.estimate.numerator, result.poles)
    if known is not None:
        core = in_state_space(known) * core
    return delayed_ss(
        core,
        dead_time=result.dead_time,
        dt=result.dt,
        fit=result,
        name=first.name or None,
        inputs=list(first.input_labels),
        outputs=list(first.output_labels),
    )


def choices_of(fit: OutputErrorEstimate) -> Iterator[str]:
    """Say what was chosen automatically, and why."""
    kind = kind_of(fit)
    count = len(fit.structures)
    if fit.averaged and fit.process.form is None:
        yield chosen("dead_time.averaged", kinds=f"1 to {count}", kind=kind)
    elif fit.process.form is not None:
        yield chosen("structure.requested", form=form_words(fit.process.form))
    elif fit.distributed.follows_flow:
        yield chosen("structure.flow", kind=kind, count=count)
    elif count == 1:
        yield chosen("structure.only", kind=kind)
    else:
        simple = " with up to three poles" if fit.robust and fit.structure.order <= 3 else ""
        yield chosen("structure.lowest", kind=kind, count=count, simple=simple)
    complete, _, other, closest = fit.followed
    if other != fit.structure and closest - complete >= FOLLOWED_LESS:
        yield chosen(
            "structure.closest_in_noise" if fit.adequate else "structure.closest",
            other=order_words(other),
            closest=closest,
            complete=complete,
        )
    residual = fit.residual
    if residual.rounded is not None and not fit.delay_estimates:
        yield chosen("dead_time.rounded", noise=residual.rounded)
    if fit.delay_estimates:
        yield chosen("dead_time.robust" if fit.robust else "dead_time.flat")
    if not fit.robust:
        yield interval_of(fit)
    if fit.load is not None and not fit.load.early:
        yield chosen("load.step")
    if fit.open_start:
        yield chosen("interval.open_start")
    if residual.whitened:
        yield chosen("noise.whitened", samples=residual.correlation)
    elif residual.noise_lags:
        yield chosen("noise.autoregressive", order=residual.noise_lags)
    elif residual.correlation > 1:
        yield chosen("noise.correlated", samples=residual.correlation)


def kind_of(fit: OutputErrorEstimate) -> str:
    """Name the model: a chain of lags, or a structure."""
    chain = fit.distributed.chain
    return model_words(chain) if chain else order_words(fit.structure)


def interval_of(fit: OutputErrorEstimate) -> str:
    """Describe the interval: structures, and other models that extend it."""
    if fit.averaged:
        return chosen("interval.averaged")
    ends = [line.interval for line in fit.structures if line.interval is not None]
    if fit.process.form is not None:
        return chosen("interval.forms")
    parts = [f"{len(ends)} structure(s)"] if ends else []
    low = min((end[0] for end in ends), default=np.inf)
    high = max((end[1] for end in ends), default=-np.inf)
    parts += [
        f"{model_words(model)} ({interval_in_time(first, last)})"
        for model, first, last in fit.distributed.not_ruled_out
        if first < low or last > high
    ]
    return chosen("interval.structures", models=", ".join(parts))
