"""Estimate of process models of a prescribed form: the best of them, and whether others fit better.

The counterpart of `interval.likelihood_fit` for forms, fixed and bounded parameters: profile
likelihoods [1]_ of all forms that the data do not rule out.

References
----------
.. [1] D. J. Venzon and S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
   intervals, Appl. Statist. 37 (1988) 87-94, doi:10.2307/2347496.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import FloatArray
from ..constants import Z_95
from ..engine.poles import lag_sum
from ..engine.profile_ends import profile_limits
from ..engine.static_gain import INTEGRATOR, StaticGain, reached_after
from ..engine.structures import PLAUSIBLE
from ..engine.varpro import evaluate, respond
from ..engine.window import WindowFit
from ..families.form_fit import FormFit, fit_form
from ..families.lag_profiles import with_profiled_lags
from ..families.process_form import ProcessForm
from ..signals.correlation import fit_percent
from ..signals.noise import correlation_time
from .interval import likelihood_fit
from .margins import CloseDecision
from .result import (
    DelayInterval,
    Followed,
    OtherStructures,
    OutputErrorEstimate,
    ProcessEstimate,
    StructureFit,
    assembled,
)

IsNoise = Callable[[float, float], bool]
"""Whether a residual counts as noise: of its normalised rms and its correlation time."""


def process_fit(
    fits: WindowFit,
    forms: Sequence[ProcessForm],
    *,
    is_noise: IsNoise,
    others: OtherStructures,
    near: tuple[CloseDecision, ...] = (),
) -> OutputErrorEstimate:
    """Determine model, dead time and interval among process models of prescribed forms.

    Parameters
    ----------
    fits : WindowFit
        Fit of the structures of the forms, without their prescriptions.
    forms : sequence of ProcessForm
    is_noise : callable
    others : OtherStructures
        Beside those of `fits`.
    near
        As for `likelihood_fit`.
    """
    adequate = is_noise(fits.normalized_rms, fits.correlation)
    length = fits.scales.length
    if all(form.admits(fits.candidates[form.structure], length) for form in forms):
        found = likelihood_fit(fits, adequate=adequate, near=near)
        form = next(form for form in forms if form.structure == found.structure)
        if np.count_nonzero(found.poles.imag > 0) == int(form.pair):
            parameters = with_profiled_lags(
                fits.problem, fits.scales, form, found.process.parameters, fits.variance
            )
            return replace(found, process=ProcessEstimate(parameters, form), others=others)
    form_fits = [_fitted(fits, form) for form in forms]
    values = [_criterion(fits, fit) for fit in form_fits]
    best = int(np.argmin(values))
    chosen = form_fits[best]
    host = fits.candidates[chosen.form.structure]
    # What the prescriptions cost is part of the noise, if the data contradict them.
    variance = fits.variance * max(chosen.candidate.cost / max(host.cost, 1e-300), 1.0)
    if variance > 1.01 * fits.variance:
        chosen = _fitted(fits, chosen.form, variance)
    kept = [
        chosen if i == best else fit
        for i, fit in enumerate(form_fits)
        if values[i] <= values[best] + PLAUSIBLE
    ]
    ends = [profile_limits(*fit.profile) for fit in kept]
    first, last = profile_limits(*chosen.profile)
    interval = DelayInterval(
        min(low for low, _ in ends), max(high for _, high in ends), (last - first) / (2 * Z_95)
    )
    fitted = _predicted(fits, chosen)
    rms = fits.normalized_rms * float(np.sqrt(chosen.candidate.cost / max(host.cost, 1e-300)))
    error = (fits.window.output - fitted)[fits.window.start :]
    correlation = correlation_time(error)
    found = assembled(
        fits,
        chosen.candidate,
        is_noise(rms, correlation),
        (),
        {},
        interval,
        chosen.profile,
    )
    return replace(
        found,
        numerator=chosen.numerator,
        fitted=fitted,
        followed=_followed(fits, chosen, fitted),
        residual=found.residual._replace(
            std=float(np.sqrt(np.mean(error**2))), normalized_rms=rms, correlation=correlation
        ),
        static=_static(fits, chosen),
        alike=(),
        structures=_table(form_fits, values, ends=dict(zip(map(id, kept), ends, strict=True))),
        process=ProcessEstimate(
            with_profiled_lags(fits.problem, fits.scales, chosen.form, chosen.parameters, variance),
            chosen.form,
            chosen.at_bound,
        ),
        close=near,
        others=others._replace(better=_better(fits, chosen, others.better)),
    )


def _fitted(fits: WindowFit, form: ProcessForm, variance: float | None = None) -> FormFit:
    like = list(fits.candidates.values())
    like.sort(key=lambda one: one.structure != form.structure)
    numerators = [
        evaluate(fits.problem, one.structure, one.parameters[None]).numerator[0] for one in like
    ]
    noise = fits.variance if variance is None else variance
    return fit_form(fits.problem, form, fits.scales, like, numerators, noise)


def _criterion(fits: WindowFit, fit: FormFit) -> float:
    return fit.candidate.cost / fits.variance + fit.free * fits.penalty


def _better(fits: WindowFit, chosen: FormFit, better: StructureFit | None) -> StructureFit | None:
    """The structure without the prescriptions, if it rules them out; or what rules out both."""
    host = fits.candidates[chosen.form.structure]
    more = 2 + host.structure.order + host.structure.zeros - chosen.free
    excess = (chosen.candidate.cost - host.cost) / fits.variance - more * fits.penalty
    if better is not None:
        # relative to the structure without prescriptions, which may be worse: it has no integrator
        both = excess - better.delta_bic
        return replace(better, delta_bic=-both) if both > PLAUSIBLE else None
    if excess <= PLAUSIBLE:
        return None
    found = likelihood_fit(fits, adequate=True)
    static = fits.static(fits.candidates[found.structure])
    return StructureFit(
        found.structure,
        found.dead_time,
        static.total,
        -float(excess),
        (found.low, found.high),
        found.poles,
        static.gain,
    )


def _predicted(fits: WindowFit, fit: FormFit) -> FloatArray:
    """Model at every sample, with the terms that enter linearly."""
    window, problem = fits.window, fits.problem
    setting = problem.known, fit.numerator, fit.candidate.parameters
    rest = problem.data - respond(problem.drive, *setting)
    regressors = problem.weighted(problem.regressors)
    if problem.segments is not None:
        terms = problem.local_terms(fit.candidate.poles[None])
        left = problem.weighted(rest[:, None])
        if window.bins is None or window.own is None:
            remainder = terms.without(left[None])[0, :, 0]
            return np.asarray(problem.data - remainder / problem.root_weight)
        local = terms.fitted((problem.root_weight * rest)[None], window.own)[0]
        return np.asarray(respond(window.drive, *setting) + local)
    linear = np.linalg.lstsq(regressors, problem.weighted(rest[:, None])[:, 0])[0]
    return np.asarray(respond(window.drive, *setting) + window.columns @ linear)


def _followed(fits: WindowFit, fit: FormFit, fitted: FloatArray) -> Followed:
    window = fits.window
    alone = respond(window.drive, fits.problem.known, fit.numerator, fit.candidate.parameters)
    alone = alone + np.mean(window.output - alone)
    both = fit_percent(np.tile(window.output, (2, 1)), np.stack([fitted, alone]))
    return Followed(float(both[0]), float(both[1]), fit.form.structure, float(both[0]))


def _static(fits: WindowFit, fit: FormFit) -> StaticGain:
    length, poles = fits.scales.length, fit.candidate.poles
    moving = poles[np.abs(poles) * length >= INTEGRATOR]
    gain = next(one for one in fit.parameters if one.name == "gain")
    slow = np.abs(moving)
    return StaticGain(
        gain=gain.value,
        gain_std=gain.std if np.isfinite(gain.std) else 0.0,
        total=fit.candidate.dead_time + lag_sum(moving, fit.numerator),
        total_std=fit.total_std,
        slowest=float(slow.min(initial=np.inf)) * length,
        integrates=fit.form.integrator,
        reached=reached_after(poles, fit.numerator, length),
        sign_known=abs(gain.value) > Z_95 * gain.std,
    )


def _table(
    form_fits: Sequence[FormFit],
    values: Sequence[float],
    ends: dict[int, tuple[float, float]],
) -> tuple[StructureFit, ...]:
    lines = [
        StructureFit(
            fit.form.structure,
            fit.candidate.dead_time,
            fit.candidate.dead_time + lag_sum(fit.candidate.poles, fit.numerator),
            value - min(values),
            ends.get(id(fit)),
            fit.candidate.poles,
            float(fit.numerator[0] / np.prod(-fit.candidate.poles).real),
        )
        for fit, value in zip(form_fits, values, strict=True)
    ]
    return tuple(sorted(lines, key=lambda line: line.delta_bic))
