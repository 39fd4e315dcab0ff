"""Estimate of models with prescribed parameters: the best of them, and whether others fit better.

The counterpart of `interval.likelihood_fit` for process models with fixed and bounded parameters,
and for structures without fast lags: profile
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

from ..constants import SMALLEST, VERY_STRONG
from ..engine.structures import Candidate
from ..engine.window_fit import WindowFit
from ..families.form_fit import fit_form
from ..families.lag_profiles import with_profiled_lags
from ..families.process_form import ProcessForm
from ..families.slow_lags import fit_slow_lags
from ..signals.noise import correlation_time
from .interval import likelihood_fit
from .other_structures import Compared, Requested, better_than, line_of
from .result import OtherStructures, OutputErrorEstimate, ProcessEstimate, StructureFit
from .selection import CloseDecision, chains_of

_CONTRADICTED = 1.01
"""Sum of squares over that without the prescriptions, from which on these are no small error."""

IsNoise = Callable[[float, float], bool]
"""Whether a residual counts as noise: of its normalised rms and its correlation time."""


def fit_requested(
    fits: WindowFit,
    requested: Requested,
    *,
    adequate: bool,
    is_noise: IsNoise,
    others: Compared,
    near: tuple[CloseDecision, ...] = (),
) -> OutputErrorEstimate:
    """Determine model, dead time and interval among what is requested; see `process_fit`."""
    if requested.fastest is not None:
        return fit_without_fast_lags(fits, requested.fastest, is_noise=is_noise, near=near)
    if requested.forms:
        return process_fit(fits, requested.forms, is_noise=is_noise, others=others, near=near)
    found = likelihood_fit(fits, adequate=adequate, near=near)
    return replace(found, others=others.told(others.better))


def process_fit(
    fits: WindowFit,
    forms: Sequence[ProcessForm],
    *,
    is_noise: IsNoise,
    others: Compared,
    near: tuple[CloseDecision, ...],
) -> OutputErrorEstimate:
    """Determine model, dead time and interval among process models of prescribed forms.

    Parameters
    ----------
    fits : WindowFit
        Fit of the structures of the forms, without their prescriptions; those that it leaves out,
        as they are not at noise level, are no alternatives.
    forms : sequence of ProcessForm
    is_noise : callable
    others : Compared
        Beside those of `fits`.
    near
        As for `likelihood_fit`.
    """
    forms = tuple(form for form in forms if form.structure in fits.candidates)
    adequate = is_noise(fits.normalized_rms, fits.correlation)
    if all(form.admits(fits.candidates[form.structure], fits.scales.length) for form in forms):
        found = likelihood_fit(fits, adequate=adequate, near=near)
        form = next(form for form in forms if form.structure == found.structure)
        if np.count_nonzero(found.poles.imag > 0) == int(form.pair):
            process = _with_profiles(fits, ProcessEstimate(found.process.find, form))
            return replace(found, process=process, others=others.told(others.better))
    like = list(fits.candidates.values())
    fitted = [fit_form(fits.problem, form, fits.scales, like) for form in forms]
    models = {model.structure: model for model in fitted}
    given = fits.of(models, rivals={})
    # What the prescriptions cost is part of the noise, if the data contradict them.
    excess = given.best.cost / max(fits.candidates[given.best.structure.plain].cost, SMALLEST)
    if excess > _CONTRADICTED:
        sigma = float(np.hypot(fits.sigma, fits.rounding) * np.sqrt(excess))
        given = given.of(models, sigma=sigma, rounding=0.0)
    found = likelihood_fit(given, adequate=adequate, near=near)
    chosen = fitted[forms.index(found.process.form)]
    host = fits.candidates[chosen.structure.plain]
    rms = fits.normalized_rms * float(np.sqrt(chosen.cost / max(host.cost, SMALLEST)))
    error = (fits.window.output - found.fitted)[fits.window.start :]
    correlation = correlation_time(error)
    std = float(np.sqrt(np.mean(error**2)))
    return replace(
        found,
        adequate=is_noise(rms, correlation),
        residual=found.residual._replace(std=std, normalized_rms=rms, correlation=correlation),
        process=_with_profiles(given, found.process),
        others=others.told(_better(fits, chosen, others.better)),
    )


def fit_without_fast_lags(
    fits: WindowFit, fastest: float, *, is_noise: IsNoise, near: tuple[CloseDecision, ...]
) -> OutputErrorEstimate:
    """Determine model, dead time and interval among structures without lags that are faster, in s.

    Parameters
    ----------
    fits : WindowFit
        Of the structures, without that bound.
    fastest, is_noise, near
        As for `fit_slow_lags` and `process_fit`.
    """
    every = fits.candidates.values()
    models = {}
    for host in every:
        order = host.structure.order
        fewer = [one for one in every if order - 1 <= one.structure.order < order]
        model = fit_slow_lags(fits, host, fewer, fastest)
        models[model.structure] = model
    given = fits.of(models, rivals={})
    excess = given.best.cost / max(fits.best.cost, SMALLEST)
    better = better_than(given.best, fits)
    if better is not None:
        # What the bound costs is part of the noise.
        given = given.of(models, sigma=given.sigma * float(np.sqrt(max(excess, 1.0))))
    adequate = is_noise(fits.misfit(given.best), fits.correlation)
    chains = [c for c in chains_of(fits) if fastest * np.abs(c.candidate.poles).max() <= 1]
    found = likelihood_fit(given, adequate=adequate, chains=chains, near=near)
    return replace(found, others=OtherStructures(better))


def _with_profiles(fits: WindowFit, process: ProcessEstimate) -> ProcessEstimate:
    """Profiled intervals of lags where the curvature does not describe them."""
    assert process.form is not None
    form = process.form
    return replace(process, find=lambda: with_profiled_lags(fits, form, process.parameters))


def _better(fits: WindowFit, chosen: Candidate, better: StructureFit | None) -> StructureFit | None:
    """The structure without the prescriptions, if it rules them out; or what rules out both."""
    host = fits.candidates[chosen.structure.plain]
    more = host.structure.free - chosen.structure.free
    excess = (chosen.cost - host.cost) / fits.variance - more * fits.penalty
    if better is not None:
        # relative to the structure without prescriptions, which may be worse: it has no integrator
        both = excess - better.delta_bic
        return replace(better, delta_bic=-both) if both > VERY_STRONG else None
    if excess <= VERY_STRONG:
        return None
    return line_of(fits, host, -excess)
