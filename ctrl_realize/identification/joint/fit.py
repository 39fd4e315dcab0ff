"""One model of time records and a measured frequency response."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress
from typing import Literal

import control as ct
import numpy as np

from ..._wording import chosen, in_time
from ...data import Record
from ...data.given import as_records
from ...data.shown_units import in_shown_units
from ...delayed import DelayedStateSpace, fit_of
from ...frequency.fit import fit_frf
from ...frequency.frf_fit import FRFFit
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.blas_threads import single_threaded
from ...numerics.constants import SMALLEST
from ...numerics.engine.problem import KnownFactor, Structure
from ...numerics.engine.structures import Scales
from ...numerics.engine.window_fit import Window
from ...numerics.joint.data import JointData, sampled_part, step_part
from ...numerics.joint.effects import Effect, with_random_effects
from ...numerics.joint.fit import joint_fit
from ...numerics.output_error.any_input.data import cut
from ...numerics.output_error.result import OutputErrorEstimate
from ...numerics.output_error.step_data import StepData
from ...numerics.rational.frf_data import FRFData
from ...numerics.rational.search import points_as_one
from ..output_error.any_input import joined
from ..output_error.fit import fit_output_error
from ..output_error.repeat_flags import BY_CHANCE
from ..output_error.result import OutputErrorFit
from ..output_error.summary import fitted_model, interval_of, kind_of
from ..process_structures import Structures, plain_pairs
from .flags import joint_flags
from .result import JointFit

_LEAST = 1e-6  # of the response: noise of exact points, for which the weights must be finite


@single_threaded
@in_shown_units
def fit_joint(
    records: Record | Sequence[Record],
    frf: ct.FrequencyResponseData,
    *,
    structures: Structures | None = None,
    max_delay: int | None = None,
    weighting: Literal["auto", "std", "relative", "uniform"] = "auto",
    hold: Literal["auto", "zoh"] | None = "auto",
    band_hz: tuple[float, float] | None = None,
    dead_time: tuple[float, float] | None = None,
) -> DelayedStateSpace:
    """Fit one model with dead time to time records and a frequency response of the same plant.

    Maximum likelihood with independent noise in both [1]_: every residual counts in units of its
    own noise. Both are fitted alone first, by `fit_output_error` and `fit_frf`, which determines
    noise that was not measured. The joint model is then compared with the two alone.

    Parameters
    ----------
    records : Record or sequence of Record
        One input, one output; see `fit_output_error`.
    frf : MeasuredFRF
        One input, one output, at least 3 points. Any `control.FrequencyResponseData`.
    structures : optional
        Structures to try, (order, relative degree) or names of process models as for
        `fit_output_error`, without prescribed parameters; default: those of `fit_output_error`.
    max_delay : int, optional
        Largest delay in samples of the records.
    weighting, hold, band_hz : optional
        See `fit_frf`. With ``hold="zoh"`` and an FRF without sample time, that of the records is
        the hold's.
    dead_time : (low, high), optional
        Range in s of the dead time, stated by the user; see `fit_output_error`.

    Returns
    -------
    DelayedStateSpace
        With the sample time of the records; ``.fit`` is a `JointFit`.

    Raises
    ------
    DataError, NoStepError, UnsuitableSystemError, OptionError, OrderError
        See `fit_output_error` and `fit_frf`.

    Notes
    -----
    Whether the two have one model is tested by the likelihood ratio of common parameters against
    parameters of each (as an F ratio [2]_ if the noise of the FRF was estimated from its fit). If
    the probability is below 1 % for all structures that are not ruled out, the flag
    ``"frf_contradicts_records"`` says where they contradict each other, and whether another gain or
    another dead time of the FRF explains it; the interval then spans those of both alone.

    Gains, dead times and time constants that differ between the records by more than their noise
    enter with the standard error of their mean [3]_. The noise of the records counts as white, with
    a variance that is enlarged by its correlation. Of long records with an input other than a step
    a part is used.

    References
    ----------
    .. [1] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd
       ed., Wiley 2012, chapter 9, doi:10.1002/9781118287422.
    .. [2] G. C. Chow, Tests of equality between sets of coefficients in two linear regressions,
       Econometrica 28 (1960) 591-605, doi:10.2307/1910133.
    .. [3] N. M. Laird and J. H. Ware, Random-effects models for longitudinal data, Biometrics 38
       (1982) 963-974, doi:10.2307/2529876.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> rng = np.random.default_rng(1)
    >>> t = 0.01 * np.arange(600)
    >>> y = np.where(t < 1.125, 0.0, 3 * -np.expm1(-(t - 1.125) / 0.4))
    >>> record = cr.Record(t, t >= 0.995, y + 0.02 * rng.standard_normal(t.size))
    >>> f = np.geomspace(0.1, 5, 20)
    >>> s = 2j * np.pi * f
    >>> noise = 0.01 * rng.standard_normal((20, 2)) @ [1, 1j]
    >>> frf = cr.MeasuredFRF(3 * np.exp(-0.125 * s) / (0.4 * s + 1) + noise, f)
    >>> fit = cr.identification.fit_joint(record, frf, structures=[(1, 1), (2, 2)]).fit
    >>> fit.structure, round(fit.dead_time, 3), fit.agreement.contradicts
    ((1, 1), 0.125, False)
    """
    several = as_records(records)
    pairs = plain_pairs(structures, "fit_joint")
    first = fit_of(
        fit_output_error(several, structures=pairs, max_delay=max_delay, dead_time=dead_time),
        OutputErrorFit,
    )
    held = first.dt if hold == "zoh" else None
    n = None if pairs is None else sorted({n for n, _ in pairs})
    r = None if pairs is None else sorted({r for _, r in pairs})
    found = fit_frf(
        frf, n, relative_degree=r, dt=held, weighting=weighting, hold=hold, band_hz=band_hz
    )
    other = fit_of(found, FRFFit)
    latest = None if max_delay is None else max_delay * first.dt
    window, scales, data, time = _records(first, latest)
    lows, highs = zip(first.interval, other.interval, strict=True)
    span = float(min(lows)), float(max(highs))
    if dead_time is not None:
        span = max(span[0], dead_time[0]), min(span[1], dead_time[1])
    spread = _spread(first)
    window = with_random_effects(window, first.estimate, spread, scales.dt)
    points, freedom = _points(other, scales.latest)
    both = JointData(window, scales, points, freedom)
    estimate, agreed = joint_fit(both, _starts(first, other), span, stated=pairs is not None)
    if agreed.contradicts:
        low, high = min(span[0], estimate.dead_time), max(span[1], estimate.dead_time)
        estimate = replace(estimate, low=low, high=high)
    growth = float(np.std(window.output - estimate.fitted))
    growth /= max(float(np.std(first.measured - first.fitted)), SMALLEST)
    estimate = replace(
        estimate,
        adequate=first.at_noise_level and not agreed.contradicts,
        residual=estimate.residual._replace(
            std=first.residual * growth,
            normalized_rms=first.normalized_rms * growth,
            correlation=first.correlation,
        ),
        others=first.estimate.others,
    )
    result = JointFit(
        estimate=estimate,
        data=data,
        time=time,
        records=several,
        repeatability=first.repeatability,
        record_fit=first,
        frf_fit=other,
        agreement=agreed,
        stated=first.stated,
        choices=tuple(_choices(estimate, first, other, spread)),
    )
    stated = tuple(flag for flag in first.flags if flag.code == "parameter_at_bound")
    return fitted_model(replace(result, flags=(*joint_flags(result, latest), *stated)))


def _records(
    first: OutputErrorFit, latest: float | None
) -> tuple[Window, Scales, StepData, FloatArray]:
    """Rows of the records, and what is shown of them: data and times."""
    if np.isfinite(first.onset):
        return *step_part(first.data, first.estimate, latest), first.data, first.time
    repeats = first.repeatability
    used = first.records if repeats is None else list(compress(first.records, repeats.kept))
    outputs, inputs = ([np.ravel(getattr(r, k)) for r in used] for k in ("output", "input"))
    data = cut(outputs, inputs, first.data.dt, first.data.every, KnownFactor()).after(
        first.dead_time
    )
    return *sampled_part(data, first.estimate, latest), *joined(used, data, first.residual)


def _spread(first: OutputErrorFit) -> list[tuple[Effect, float]]:
    """Standard errors of what differs between records by more than their noise."""
    repeats = first.repeatability
    if repeats is None:
        return []
    kept = repeats.kept
    tests: tuple[tuple[Effect, FloatArray, float], ...] = (
        ("gain", repeats.gains, repeats.gain_test[1]),
        ("dead_time", repeats.delays, repeats.p_value),
        ("lags", np.log(repeats.lags), repeats.lag_test[1]),
    )
    return [
        (key, float(np.std(values[kept], ddof=1) / np.sqrt(kept.sum())))
        for key, values, chance in tests
        if chance < BY_CHANCE
    ]


def _choices(
    estimate: OutputErrorEstimate,
    first: OutputErrorFit,
    other: FRFFit,
    spread: Sequence[tuple[Effect, float]],
) -> Iterator[str]:
    kind, count = kind_of(estimate), len(estimate.structures)
    if estimate.distributed.follows_flow:
        yield chosen("structure.flow", kind=kind, count=count)
    else:
        yield chosen("structure.joint" if count > 1 else "structure.only", kind=kind, count=count)
    yield interval_of(estimate)
    yield chosen("joint.records", noise=first.residual, samples=first.correlation)
    yield chosen("joint.stated" if other.noise_known else "joint.scatter")
    if spread:
        said = {
            "gain": lambda std: f"gains ({100 * std:.2g} %)",
            "dead_time": lambda std: f"dead times ({in_time(std)})",
            "lags": lambda std: f"time constants ({100 * std:.2g} %)",
        }
        yield chosen("joint.spread", what=", ".join(said[key](std) for key, std in spread))


def _points(fit: FRFFit, latest: float) -> tuple[FRFData, float]:
    """Points with the noise that their own fit leaves, never less than what was measured."""
    omega = 2 * np.pi * fit.frequency_hz
    scale = max(fit.weighted_rms, 1.0) if fit.noise_known else fit.weighted_rms
    # Exact points would have no noise at all.
    scale = max(scale, _LEAST * float(np.max(np.abs(fit.measured) / fit.sigma)))
    scale *= float(np.sqrt(points_as_one((fit.measured - fit.response(omega)) / fit.sigma)))
    freedom = 2.0 * omega.size - (2 * fit.order + 2 - fit.relative_degree)
    known = fit.noise_known and fit.weighted_rms <= 1.0
    weight = np.sqrt(2.0) / (fit.sigma * scale)  # so that real and imaginary parts have variance 1
    points = FRFData(np.asarray(1j * omega), fit.measured, weight, latest)
    return points, np.inf if known else freedom


def _starts(
    first: OutputErrorFit, other: FRFFit
) -> dict[Structure, tuple[tuple[float, ComplexArray], ...]]:
    return {
        line.structure: ((line.dead_time, line.poles),)
        + (((other.dead_time, other.poles),) if line.order == other.order else ())
        for line in first.structures
    }
