"""Output-error fit for inputs other than steps: random, pseudo-random, sweeps, operating data.

One record or several of one plant: poles, numerator and dead time are common; level, drift and
initial state are estimated for each record (see `local_terms`).

Output error [1]_ with elimination of linear terms [2]_. The selection of samples is our own
rule.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   4.2 (output-error models) and 10.2 (iterative search).
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [3] D. W. Clarke, Generalized least squares estimation of the parameters of a dynamic model, IFAC
   Symposium on Identification in Automatic Control Systems, Prague 1967, paper 3.17.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...arrays import FloatArray
from ...engine.compared_fits import converged
from ...engine.poles import parameters_from_poles
from ...engine.problem import KnownFactor, Problem, Structure
from ...engine.structures import Candidate, search
from ...engine.window import window_of_rows
from ...engine.window_fit import WindowFit, extended, with_known_noise
from ...families.process_form import ProcessForm
from ...signals.correlation import fit_percent
from ...signals.noise import correlation_time, winsorised_sigma
from ...validation.own_response import OwnResponse
from ..interval import likelihood_fit
from ..margins import close_to
from ..other_structures import other_structures
from ..process_models import process_fit
from ..result import OutputErrorEstimate, followed_by
from ..selection import chains_of
from .condensed import MOST_LAGS, Condensed, condensed
from .data import SampledData, cut
from .own_response import own_response
from .stretch import WHITE, explained, fit_stretch, response_samples, samples_in_a_block
from .window import ORDERS, SampledWindow, modelled, window_of

MORE_LAGS = (Structure(4, 4), Structure(5, 5))
"""Tried as well where three poles are chosen: zeros beside them imitate further lags. Ablation:
fourth and fifth lag."""
_LEAST_LAGS = 30  # of a response that is condensed; fewer cost as much
_CLEARLY = 4.0  # standard deviations of a chi-square: 3e-5 by chance


@dataclass(frozen=True, eq=False)
class SampledFit:
    """Fit of records with any input.

    `fitted` has one entry for each record, from its start on. `explained` is the decrease of the
    sum of squares due to the input, divided by the residual variance: a chi-square. If the records
    are longer than `data`, `condensed` contains the data that were fitted. `noise` is the
    polynomial that makes the noise white, 1 for white noise.
    """

    fit: OutputErrorEstimate
    data: SampledData
    fitted: tuple[FloatArray, ...]
    explained: float
    known: KnownFactor
    noise: FloatArray
    condensed: Condensed | None = None

    def own_delay(self, output: FloatArray, signal: FloatArray) -> OwnResponse:
        """Shift and scale the common model to fit one record best, whether it was fitted or not."""
        one = cut([output], [signal], self.data.dt, self.data.every)
        start = min(max(self.data.starts), one.outputs[0].size // 2)
        one = replace(one, starts=(start,)).whitened(self.noise)
        return own_response(one, self.fit, self.known)


def fit_sampled(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    dt: float,
    *,
    structures: Sequence[Structure] | None = None,
    forms: Sequence[ProcessForm] = (),
    latest: float | None = None,
    known: KnownFactor | None = None,
    huber: bool = True,
    whiten: bool = True,
) -> SampledFit:
    """Estimate the dead time of one plant from records with any input that moves.

    Parameters
    ----------
    outputs, inputs : sequence of ndarray
        One of each for every record; outputs are NaN where a sample is missing.
    dt : float
        Sample time in s.
    structures, forms, latest, known, huber, whiten
        See `fit_step_record`; orders up to 3 by default, `latest` a quarter of the longest record.

    Notes
    -----
    The past before a record is represented by an initial state, which is eliminated together with
    level and drift. The input within the dead time before the record is unknown: samples for one
    and a half dead times of the best first-order model are left out, at most half of the record. If
    the residual is coloured, all structures are fitted again by generalised least squares [3]_:
    inputs and outputs are filtered by the residual's autoregressive model, which does not change a
    linear plant. Not if structures are given: the residual may be what they cannot describe.

    Of a record of more than `data.MOST_SAMPLES` a part is fitted. If the response ends within
    `condensed.MOST_LAGS` samples, all samples are fitted afterwards; if the plant is slower, means
    over blocks of samples, with which the part is longer (`stretch`).

    Where samples are missing, there is no filter, and the correlation of the residual is that of
    its samples as if they were neighbours: an average over the gaps, as it counts for the errors of
    slow parameters.
    """
    factor = known or KnownFactor()
    tried = ORDERS if structures is None else tuple(structures)
    fit_part = partial(fit_stretch, factor, latest, huber)
    every, done = samples_in_a_block(outputs, inputs, dt, whiten, fit_part)
    if done is None or structures is not None:
        whiten &= structures is None
        done = fit_part(whiten, cut(outputs, inputs, dt, every), tried)
    part, unweighted = done
    data, stretch = part.data, part.fit
    fits = stretch
    long = any(y.size > every * kept.size for y, kept in zip(outputs, data.outputs, strict=True))
    usable = long and not any(np.isnan(y).any() for y in outputs)
    sums = _condensed(outputs, inputs, data, stretch, huber) if usable else None
    if sums is not None:
        stretch = replace(stretch, scales=replace(stretch.scales, dt=dt))
        fits = _fit_condensed(sums, stretch, factor)
    if structures is None and fits.best.structure.order == ORDERS[-1].order:
        fits = extended(fits, MORE_LAGS)
    chains = chains_of(fits) if structures is None else []
    others = None
    if structures is not None:
        # On the part also if all samples were fitted: what is ruled out there is ruled out in any
        # case.
        others = other_structures(stretch, partial(part.fit_of, ORDERS))
    white = fits.correlation <= WHITE
    if forms and others is not None:
        fit = process_fit(
            fits, forms, is_noise=lambda _, correlation: correlation <= WHITE, others=others
        )
    else:
        fit = replace(likelihood_fit(fits, adequate=white, chains=chains), others=others)
    if sums is not None:
        fitted = _on_stretch(data, fit, factor)
        left = winsorised_sigma(window_of(data, factor).output - fitted, 0.0)
        fit = replace(fit, fitted=fitted, residual=fit.residual._replace(std=left))
    elif part.noise.size > 1:
        fit = replace(_of_measured(part, fit), unweighted=unweighted)
    elif fit.distributed.chain:
        left = correlation_time(fits.window.output - fit.fitted)
        fit = replace(fit, residual=fit.residual._replace(correlation=left), adequate=left <= WHITE)
    correlation = fit.residual.correlation
    # There is no baseline for the noise; correlation is estimated from means over bins.
    residual = fit.residual._replace(normalized_rms=float(np.sqrt(correlation)))
    close = fit.close + close_to("adequate", correlation, WHITE)
    fit = replace(fit, residual=residual, close=close)
    parts = np.split(fit.fitted, data.edges[1:-1])
    return SampledFit(
        fit,
        data,
        tuple(values * scale for values, scale in zip(parts, data.scales, strict=True)),
        explained(stretch),
        factor,
        part.noise,
        sums,
    )


def _of_measured(part: SampledWindow, fit: OutputErrorEstimate) -> OutputErrorEstimate:
    """Describe a fit of filtered records in terms of those that were measured."""
    fitted = _on_stretch(part.data, fit, part.known)
    window = window_of(part.data, part.known)
    measured = replace(part.fit, window=window, problem=window.problem)
    chosen = Candidate(fit.structure, _parameters(fit), 0.0)
    followed = followed_by(measured, chosen, fit.numerator)
    complete = float(fit_percent(window.output[None], fitted[None])[0])
    return replace(
        fit,
        fitted=fitted,
        followed=followed._replace(complete=complete),
        residual=fit.residual._replace(
            std=winsorised_sigma(window.output - fitted, 0.0), noise_lags=part.noise.size - 1
        ),
    )


def _condensed(
    outputs: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    data: SampledData,
    stretch: WindowFit,
    huber: bool,
) -> Condensed | None:
    """All samples of records of which a part was fitted, if their response is short enough."""
    lags = response_samples(stretch.best, data.dt)
    if not lags <= MOST_LAGS:
        return None
    return condensed(
        [y / scale for y, scale in zip(outputs, data.scales, strict=True)],
        [u / scale for u, scale in zip(inputs, data.scales, strict=True)],
        data.dt,
        max(int(np.ceil(lags)), _LEAST_LAGS),
        huber=huber,
    )


def _fit_condensed(sums: Condensed, stretch: WindowFit, known: KnownFactor) -> WindowFit:
    """Fit all structures to all samples, starting from the fit of a part."""
    m, scales = sums.data.size, stretch.scales
    problem = Problem(sums.data, np.ones(m), sums.drive, np.empty((m, 0)), known)
    starts = {s: [fit.parameters] for s, fit in stretch.candidates.items()}
    fits = search(problem, starts, scales, starts=starts)
    fits = converged(problem, fits, scales, sums.noise**2, sums.samples)
    closest = min(fits.values(), key=lambda candidate: candidate.cost)
    freedom = max(m - 2 - closest.structure.free, 1)
    # Residual above the noise: what no structure explains is treated as noise of that size.
    excess = closest.cost / freedom / sums.noise**2
    colour = excess if excess > 1 + _CLEARLY * np.sqrt(2 / freedom) else 1.0
    window = replace(window_of_rows(problem), samples=sums.samples)
    return with_known_noise(window, fits, scales, sums.noise, colour)


def _on_stretch(data: SampledData, fit: OutputErrorEstimate, known: KnownFactor) -> FloatArray:
    """Model at the samples of the part, with local level, drift and initial state."""
    return modelled(data, known, _parameters(fit), fit.numerator)


def _parameters(fit: OutputErrorEstimate) -> FloatArray:
    return np.concatenate([[fit.dead_time], parameters_from_poles(fit.poles)])
