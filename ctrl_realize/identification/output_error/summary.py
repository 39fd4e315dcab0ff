"""Turn what the numerics found into the model and the result that users see."""

from __future__ import annotations

from dataclasses import replace

import control as ct
import numpy as np

from ..._wording import interval_in_time
from ...data import Record
from ...numerics.arrays import ComplexArray, FloatArray, locked
from ...numerics.output_error.result import Better, OutputErrorEstimate
from ...numerics.output_error.step_data import StepData
from ...numerics.separable.lag_chains import lag_sum
from ...numerics.separable.static_gain import INTEGRATOR
from ...results import Flag
from .repeat_flags import BY_CHANCE
from .repeatability import Repeatability
from .result import OutputErrorFit, StructureRow
from .words import ESTIMATE_WORDS, model_words


def summarise(
    fit: OutputErrorEstimate,
    data: StepData,
    time: FloatArray,
    records: tuple[Record, ...],
    flags: tuple[Flag, ...],
) -> OutputErrorFit:
    """Collect a `OutputErrorFit`."""
    length = (data.output.size - data.edge) * data.dt
    poles = np.where(np.abs(fit.poles) < INTEGRATOR / length, 0.0, fit.poles)
    onset = data.motion.onset * data.dt if data.motion is not None else float("nan")
    zeros = np.roots(fit.numerator[::-1]).astype(np.complex128)
    return OutputErrorFit(
        dead_time=fit.delay,
        std_given_structure=fit.std,
        interval=(fit.low, fit.high),
        onset=onset,
        total_delay=fit.delay + lag_sum(poles[poles != 0], fit.numerator),
        order=fit.structure.order,
        relative_degree=fit.structure.relative_degree,
        poles=locked(np.sort_complex(poles)),
        zeros=locked(np.sort_complex(zeros)),
        gain=float(fit.numerator[0] / np.prod(-poles[poles != 0]).real),
        at_noise_level=fit.adequate,
        normalized_rms=fit.normalized_rms,
        noise=data.sigma,
        residual=fit.residual,
        correlation=fit.correlation,
        delay_estimates={ESTIMATE_WORDS[key]: delay for key, delay in fit.delay_estimates},
        structures=tuple(
            StructureRow(
                line.structure.order,
                line.structure.relative_degree,
                line.delay,
                line.total_delay,
                line.delta_bic,
                None if np.isnan(line.low) else (line.low, line.high),
            )
            for line in fit.structures
        ),
        profile_delay=locked(fit.profile[0]),
        profile_deviance=locked(fit.profile[1]),
        time=locked(time),
        measured=locked(data.output),
        fitted=locked(fit.fitted),
        dt=data.dt,
        records=records,
        choices=_choices(fit),
        flags=flags,
        gain_std_given_structure=np.nan if fit.static is None else fit.static.gain_std,
        gain_interval=fit.gain_ends,
        total_delay_interval=fit.total_ends,
        better=None if fit.better is None else _row_of(fit.better),
    )


def _row_of(better: Better) -> StructureRow:
    n, r = better.structure.order, better.structure.relative_degree
    ends = better.low, better.high
    return StructureRow(n, r, better.delay, better.total, -better.delta_bic, ends)


def with_repeats(result: OutputErrorFit, repeats: Repeatability) -> OutputErrorFit:
    """Say how the records differ; the interval of the gain holds theirs where they do."""
    low, high = result.gain_interval
    kept = [name not in repeats.outlying for name in repeats.names]
    if repeats.gain_test[1] < BY_CHANCE:
        own = result.gain * repeats.gains[kept]
        low, high = min(low, *own), max(high, *own)
    return replace(result, repeatability=repeats, gain_interval=(float(low), float(high)))


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


def _choices(fit: OutputErrorEstimate) -> tuple[str, ...]:
    s = fit.structure
    simple = " with up to three poles" if fit.delay_estimates else ""
    kind = (
        model_words(fit.chain)
        if fit.chain
        else f"order {s.order}, relative degree {s.relative_degree}"
    )
    if fit.follows_flow:
        reasons = [
            "dead time: that of an axial-dispersion model, which fits clearly better than "
            f"all {len(fit.structures)} structures; {kind}: approximates it with the fewest "
            "parameters"
        ]
    else:
        reasons = [
            f"{kind}: lowest information criterion of {len(fit.structures)} "
            f"structures{simple}, with a penalty on zeros and on a fourth pole"
        ]
    if fit.delay_estimates:
        reasons.append(
            "dead time: median of five delay estimates, since no model fits down to the noise level"
        )
    else:
        reasons.append(_interval_of(fit))
    if fit.open_start:
        reasons.append(
            "interval widened towards the visible onset: with a zero in the model, the onset "
            "of the response is not identifiable"
        )
    if fit.whitened:
        reasons.append(
            "the noise before the step is coloured: generalised least squares with an "
            f"autoregressive noise model, instead of counting {fit.correlation:.3g} samples "
            "as one"
        )
    elif fit.correlation > 1:
        reasons.append(
            f"the residual is correlated: {fit.correlation:.3g} samples count as one "
            "independent sample independent sample independent sample"
        )
    return tuple(reasons)


def _interval_of(fit: OutputErrorEstimate) -> str:
    """Say what the interval is made of: structures of the table, and what reaches beyond them."""
    ends = [(line.low, line.high) for line in fit.structures if line.low == line.low]
    parts = [f"{len(ends)} structure(s)"] if ends else []
    low = min((end[0] for end in ends), default=np.inf)
    high = max((end[1] for end in ends), default=-np.inf)
    parts += [
        f"{model_words(model)} ({interval_in_time(first, last)})"
        for model, first, last in fit.other_models
        if first < low or last > high
    ]
    return f"interval: profile likelihood of {', '.join(parts)} that the data cannot rule out"
