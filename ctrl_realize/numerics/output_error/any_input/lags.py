"""Lags with dead time in slow noise: the dead time is the mean over all that is not ruled out.

Slow noise hides the second lag of a plant, and any noise the third. The information criterion then
chooses fewer lags, and takes the others for dead time. The mean over dead times has less of such a
bias: every number of lags has its profile likelihood [3]_ over the same dead times, and a weight by
its best fit [4]_, with a charge for each lag and each initial value. A lag costs what one that is
not there gains in 5 % of records, so that criterion and likelihood-ratio test say the same [5]_.
Three equal lags [2]_ count as much as one: else three lags are taken for two. Where three are
chosen, the interval reaches as far as that of four. In loops, moreover, zeros and pairs of poles
imitate the slow noise that the controller answers.

Noise is the autoregression of the residual of these lags, and both are fitted in turn [1]_, for
lags that were asked for as for those that were not. Measured: `benchmarks.closed_loop`.

References
----------
.. [1] D. W. Clarke, Generalized least squares estimation of the parameters of a dynamic model, IFAC
   Symposium on Identification in Automatic Control Systems, Prague 1967, paper 3.17.
.. [2] V. Strejc, Naherungsverfahren fur aperiodische Ubergangscharakteristiken, Regelungstechnik 7
   (1959) 124-128.
.. [3] S. A. Murphy and A. W. van der Vaart, On profile likelihood, J. Amer. Statist. Assoc. 95
   (2000) 449-465, doi:10.1080/01621459.2000.10474219.
.. [4] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer
   2002, section 4.2 (model averaging).
.. [5] T. Soderstrom and P. Stoica, System Identification, Prentice Hall 1989, section 11.5.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...arrays import FloatArray
from ...constants import CHI2_95, SMALLEST, VERY_STRONG
from ...engine.eliminate import eliminate, evaluate
from ...engine.plausible_models import CALIBRATED, PlausibleDraw
from ...engine.problem import Structure
from ...engine.profile import Points, profile_curve, profile_grid, profile_limits, profile_points
from ...engine.static_gain import NEARLY_STRAIGHT
from ...engine.structures import SLOWEST, Candidate
from ...engine.window_fit import RAMP, WindowFit, clipped, has_outliers
from ...families.form_fit import fit_form
from ...families.lag_profiles import with_profiled_lags
from ...families.process_form import ProcessForm
from ...rules import Rule
from ...signals.noise import correlation_time
from ...signals.noise_model import noise_lags
from ..interval import profile_of
from ..load import IN_SLOW_NOISE
from ..other_structures import Requested, line_of
from ..result import (
    DelayInterval,
    OtherStructures,
    OutputErrorEstimate,
    ProcessEstimate,
    StructureFit,
    assembled,
)
from .data import SOUGHT, Load, SampledData
from .loads import Lags, charge, gained, over_motion, sized, sought, unlikely, with_loads
from .window import SampledWindow, fit_windows, left_of, noise_model

LAGS = tuple(ProcessForm(f"P{n}D", n) for n in (1, 2, 3))
FURTHER = ProcessForm("P4D", 4)  # where three lags are chosen
EQUAL = ProcessForm("P3D", 3, equal=True)
_RIVALS = (Structure(1, 1), Structure(2, 2), Structure(2, 1))
_RULED_OUT = 30.0
"""Of the criterion: a zero beside a pole slower than the record reached 11 in loops without one, a
pair of poles 375 and more where there was one (350 samples)."""
_TURNS = 5  # of noise model and lags, at most
_ALIKE = 0.01  # largest difference of coefficients of noise models, and part of the size of loads
_BEYOND = 1.5  # total delays of the first fit, up to which a dead time is sought
_SLOW = np.array([1.0, -0.95])
"""Noise for which the first turn is repeated where it leaves coloured noise: beside a slow load the
inverse of a controller fits better than the plant. Of 20 relay tests the dead times of 13 were a
tenth to a fifth of the true ones. Ablation: first turn in slow noise."""
_HIDDEN = 0.1
"""Of the record, that may come from before it and is left out for that: dead times longer than what
is left out would be ruled out by samples that depend on an input that is not known."""
_SHORTER = 0.3  # of the last lag: a further one, where a profile starts
_BETWEEN = 8  # dead times between two points of a profile
_TAIL = 0.025  # of the weight, beyond each end of an interval


def charged_misfit(fits: WindowFit, lags: Candidate) -> float:
    """Misfit and charges; one initial value more of a record lowers the misfit by one for noise."""
    free = CHI2_95 * (lags.parameters.size - 1)
    charge = free + fits.problem.local_count(lags.structure.order)
    return lags.cost / (CALIBRATED * fits.variance) + charge


def profiled(fits: WindowFit, fitted: Sequence[Candidate]) -> list[Points]:
    """Best models with given dead times, the same for every number of lags.

    A further lag that vanishes at the minimum has no grid of its own. Every profile starts from
    its minimum or from that of fewer lags, by what is closer at each dead time.
    """
    setting = fits.problem, fits.variance, fits.scales
    grids = [profile_grid(setting[0], one, *setting[1:]) for one in fitted]
    grid = np.unique(np.concatenate([*grids, [one.dead_time for one in fitted]]))
    found: list[Points] = []
    for one in fitted:
        starts = np.tile(one.parameters, (grid.size, 1))
        if found and starts.shape[1] > found[-1][float(grid[0])].parameters.size:
            fewer = np.stack([found[-1][float(at)].parameters for at in grid])
            more = np.arange(1, starts.shape[1] - fewer.shape[1] + 1)
            nested = np.hstack([fewer, fewer[:, -1:] + np.log(_SHORTER) * more])
            starts[:, 0] = grid
            own, theirs = (eliminate(setting[0], one.structure, x).cost for x in (starts, nested))
            starts = np.where((theirs < own)[:, None], nested, starts)
        starts[:, 0] = grid
        found.append(profile_points(setting[0], one, *setting[1:], starts))
    return found


def weighted(
    fits: WindowFit, profiles: Sequence[Points], larger: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Dead times (G,), and the weights (S, G) of every number of lags; they sum to 1.

    Of an input that moves so many times further; what a model misses, beside the best, then grows
    with the square of that.
    """
    every = np.array(sorted(profiles[0]))
    values = np.array([[charged_misfit(fits, own[float(at)]) for at in every] for own in profiles])
    cost = np.array([[own[float(at)].cost for at in every] for own in profiles])
    values += (larger**2 - 1.0) * (cost - cost.min()) / (CALIBRATED * fits.variance)
    fine, density = _densities(every, values)
    least = values.min(axis=1, keepdims=True)
    weights = np.exp(-0.5 * (least - least.min()))
    return fine, weights / weights.sum() * density


def posterior_of(points: Points, variance: float) -> tuple[float, float, float]:
    """Mean dead time of one structure and the ends of its interval, by its profile likelihood."""
    every = np.array(sorted(points))
    values = np.array([[points[float(at)].cost / variance for at in every]])
    fine, density = _densities(every, values)
    return known_dead_time(fine, density[0])


def _densities(every: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Dead times (G,) and the weight (S, G) of each by profiles (S, K) at `every`."""
    part = np.arange(_BETWEEN) / _BETWEEN
    fine = np.append((every[:-1, None] + np.diff(every)[:, None] * part).ravel(), every[-1])
    between = PchipInterpolator(every, values, axis=1)(fine)
    density = np.exp(-0.5 * (between - values.min(axis=1, keepdims=True))) * np.gradient(fine)
    return fine, density / np.maximum(density.sum(axis=1, keepdims=True), SMALLEST)


def with_moves(
    fits: WindowFit, profiles: Sequence[Points], larger: float
) -> tuple[float, float, float]:
    """Mean dead time and the ends of its interval, had the input moved so many times further."""
    dead_times, shares = weighted(fits, profiles, larger)
    return known_dead_time(dead_times, shares.sum(axis=0))


def known_dead_time(dead_times: FloatArray, weights: FloatArray) -> tuple[float, float, float]:
    """Mean dead time and the ends of its interval."""
    ends = np.interp([_TAIL, 1.0 - _TAIL], np.cumsum(weights), dead_times).tolist()
    return float(weights @ dead_times), ends[0], ends[1]


def plain_lags(requested: Requested) -> bool:
    """Whether lags with a dead time are asked for, or nothing."""
    forms = all(
        form.dead_time and not (form.prescribed or form.pair or form.lead or form.integrator)
        for form in requested.forms
    )
    return forms and (bool(requested.forms) or requested.structures is None)


def fit_lags(
    data: SampledData, requested: Requested
) -> tuple[SampledWindow, OutputErrorEstimate, tuple[Load, ...]]:
    """Fit lags and noise in turn; what rules out the lags is told by `others` of the estimate."""
    limit = SOUGHT * data.longest if requested.latest is None else requested.latest
    within = requested.earliest, max(limit, requested.earliest)
    forms = sorted(requested.forms or LAGS, key=lambda form: form.lags)
    early, noise, like, loads, told = 0.0, np.ones(1), None, list[Load](), True
    for turn in range(_TURNS):
        fit = partial(_turn, data, forms, requested.whiten, within, early)
        made = fit(like, loads, noise, like.left if like else ())
        if turn == 0 and made.noise.size > 1 and Rule.SLOW_TURN.on:
            made = _likelier(made, fit(None, loads, _SLOW))
        placed, load = sought(data, made.part, made.lags, made.loads)
        # Where one was not told in noise like the residual, none is in the next turn.
        trial = load if told or turn < 2 else None
        more = _beside(data, fit, made, [*placed, trial]) if trial else made
        told = _tells(made, more)
        made, placed = (more, more.loads) if told else (made, placed)
        alike = not told and _alike(loads, placed) and _same(noise, made.noise)
        if (turn and alike) or turn == _TURNS - 1:
            break
        like, noise, loads = made, made.noise, placed
        # Noise hides how a delay divides, and not the whole of it.
        total = made.best.dead_time - float(np.sum(1.0 / made.best.poles.real))
        within = within[0], max(min(within[1], _BEYOND * total), within[0])
        early = min(total, _HIDDEN * data.longest)
    part, fitted = made.part, made.fitted
    fits = part.fit
    if requested.huber:
        fits, fitted = _robust(fits, forms, fitted)
    part = replace(part, fit=fits)
    if part.quantum:
        fits = replace(fits, rounded=part.rounding)
    problem, scales = fits.problem, fits.scales
    # Free lags follow all that equal ones do: these count for weights alone.
    equal = [] if requested.forms else [fit_form(problem, EQUAL, scales, fitted)]
    profiles = profiled(fits, [*fitted, *equal])
    dead_times, shares = weighted(fits, profiles)
    weights = shares.sum(axis=0)
    mean, first, last = known_dead_time(dead_times, weights)
    if not requested.forms and shares[len(LAGS) - 1 :].sum() > 0.5:
        # Three lags may stand for more: one more than chosen is never ruled out.
        further = fit_form(problem, FURTHER, scales, fitted)
        low, high = profile_limits(*profile_of(fits, further))
        first, last = min(first, low), max(last, high)
    std = float(np.sqrt(np.sum(weights * (dead_times - mean) ** 2)))
    chosen = _with_dead_time(fits, mean, forms, fitted)
    chosen = chosen if requested.forms else _integrating(fits, chosen)
    curves = {
        one.structure: profile_curve(points, one, fits.variance, scales)
        for one, points in zip(fitted, profiles, strict=False)
    }
    found = assembled(
        fits, chosen, True, (), curves, DelayInterval(first, last, std),
        curves[chosen.structure],
    )  # fmt: skip
    form = forms[fitted.index(fits.candidates[chosen.structure])]
    find = partial(with_profiled_lags, fits, form, found.process.parameters)
    process = ProcessEstimate(find, form if requested.forms else None)
    plain = {s.plain: _plain(one) for s, one in fits.candidates.items()}
    plainly = fits.of(plain)
    better = _better(part, min(fitted, key=partial(charged_misfit, fits)), within)
    of_lags = np.add.reduceat(shares.sum(axis=1), range(len(forms)))
    evidence = dict(zip(plain, of_lags.tolist(), strict=True))
    points = {
        one.structure.plain: {at: _plain(point) for at, point in own.items()}
        for one, own in zip(fitted, profiles, strict=False)
    }
    others = OtherStructures(better)
    found = replace(
        found, process=process, points=points, others=others,
        with_moves=partial(with_moves, fits, profiles),
    )  # fmt: skip
    found = replace(found, drawn=PlausibleDraw(plainly, evidence, plain.__getitem__))
    return part, found, tuple(made.loads)


class _Turn(NamedTuple):
    """Records with a fit, lags that were fitted, the best, what it leaves, its noise, and loads."""

    part: SampledWindow
    fitted: list[Candidate]
    best: Candidate
    errors: list[FloatArray]
    noise: FloatArray
    loads: list[Load]

    @property
    def lags(self) -> Lags:
        """The best model with its numerator."""
        return Lags.of(self.part, self.best)

    @property
    def left(self) -> tuple[FloatArray, ...]:
        """Residuals of every record from its first sample on, in its unit; 0 before they begin."""
        data, whole = self.part.data, []
        for y, rows, error, scale in zip(
            data.outputs, data.rows, self.errors, data.scales, strict=True
        ):
            whole.append(np.zeros(y.size))
            whole[-1][rows] = scale * error
        return tuple(whole)


def _turn(
    data: SampledData,
    forms: Sequence[ProcessForm],
    whiten: bool,
    within: tuple[float, float],
    early: float,
    like: _Turn | None,
    loads: Sequence[Load],
    noise: FloatArray,
    left: tuple[FloatArray, ...] = (),
) -> _Turn:
    """Fit lags in given noise beside loads, and find the noise that they leave."""
    if like is not None:
        data = with_loads(data, like.lags, loads)
    # Huber's loss would pull the data towards one lag.
    part = fit_windows(data, (Structure(1, 1),), within, False, noise, left, early)
    fits, fitted = _fitted(part.fit, forms, like.fitted if like else [])
    best = _plain(min(fitted, key=partial(charged_misfit, fits)))
    part = replace(part, fit=fits)
    errors = left_of(part, best)
    lags = noise_lags(min(part.data.counts)) if whiten else 0
    following = noise_model(part, best, np.concatenate(errors), lags)
    made = _Turn(part, fitted, best, errors, following, [])
    return made._replace(loads=sized(part, made.lags, loads))


def _beside(
    data: SampledData, fit: Callable[..., _Turn], made: _Turn, loads: Sequence[Load]
) -> _Turn:
    """Fit lags beside loads, which are placed anew once.

    A load leaves slow noise behind, in the filter of which its time is hard to see.
    """
    slow = fit(made, loads, made.part.noise, made.part.residual)
    again = _likelier(slow, fit(made, loads, np.ones(1)))
    placed, _ = sought(data, again.part, again.lags, again.loads)
    return _likelier(again, fit(again, placed, again.noise, again.left))


def _tells(made: _Turn, more: _Turn) -> bool:
    """Whether a fit beside a load tells it."""
    excess = gained(made.errors, more.errors) - charge(made.errors)
    needed = VERY_STRONG if more.noise.size == 1 else IN_SLOW_NOISE
    smaller = all(size < 1 for size in over_motion(more.part.data, more.loads))
    return smaller and excess > needed


def _alike(before: Sequence[Load], after: Sequence[Load]) -> bool:
    """Whether loads have kept their places and their sizes."""
    return all(
        old.row == new.row and abs(new.size - old.size) <= _ALIKE * abs(new.size)
        for old, new in zip(before, after, strict=True)
    )


def _same(noise: FloatArray, following: FloatArray) -> bool:
    """Whether noise models are one."""
    return following.size == noise.size and bool(np.abs(following - noise).max() <= _ALIKE)


def _likelier(one: _Turn, other: _Turn) -> _Turn:
    """Of two turns the one whose errors are the likelier."""
    return other if gained(one.errors, other.errors) > 0 else one


def _fitted(
    fits: WindowFit, forms: Sequence[ProcessForm], like: Sequence[Candidate]
) -> tuple[WindowFit, list[Candidate]]:
    """Fit lags, starting from others, and take the noise from the closest."""
    start = [*fits.candidates.values(), *like]
    fitted = [fit_form(fits.problem, form, fits.scales, start) for form in forms]
    return _with_noise(fits, fitted), fitted


def _robust(
    fits: WindowFit, forms: Sequence[ProcessForm], fitted: list[Candidate]
) -> tuple[WindowFit, list[Candidate]]:
    """Repeat the fit with Huber's loss if there are outliers, as `fit_window` does."""
    window, best = fits.window, _plain(min(fitted, key=partial(charged_misfit, fits)))
    error = fits.residual(best)
    if not has_outliers(error):
        return fits, fitted
    pulled = window.output - error + clipped(error, 0.0)
    return _fitted(replace(fits, problem=window.with_output(pulled)), forms, fitted)


def _better(
    part: SampledWindow, lags: Candidate, within: tuple[float, float]
) -> StructureFit | None:
    """A structure with a zero or a pair that rules lags out, each with noise of its own.

    The noise of lags takes what they miss of a response that rings: only that of the rival tells.
    """
    rivals = fit_windows(part.data, _RIVALS, within, False, np.ones(1))
    count = min(*part.data.counts, *rivals.data.counts)

    def value(window: SampledWindow, model: Candidate) -> float:
        left = left_of(window, model)
        return unlikely(left, count) + model.structure.free * float(np.log(count * len(left)))

    every = [
        one
        for one in rivals.fit.candidates.values()
        if one.structure.zeros or np.abs(one.poles.imag).max() > 0
    ]
    if not every:
        return None
    best = min(every, key=partial(value, rivals))
    excess = value(rivals, best) - value(part, _plain(lags))
    return line_of(rivals.fit, best, excess) if excess < -_RULED_OUT else None


def _with_dead_time(
    fits: WindowFit, dead_time: float, forms: Sequence[ProcessForm], fitted: Sequence[Candidate]
) -> Candidate:
    """Best lags with a given dead time: the fewest that are not clearly worse (BIC)."""
    fixed = {"dead_time": dead_time}
    found = {}
    for form, one in zip(forms, fitted, strict=True):
        there = fit_form(fits.problem, replace(form, fixed=fixed), fits.scales, [one])
        found[one.structure] = Candidate(one.structure, there.parameters, there.cost)
    values = fits.criteria(found)
    return found[min(values, key=lambda structure: values[structure])]


def _integrating(fits: WindowFit, chosen: Candidate) -> Candidate:
    """Take a lag far slower than the records for an integrator where that is no worse (BIC)."""
    length = fits.scales.length
    if float(np.abs(chosen.poles).min()) * length >= NEARLY_STRAIGHT:
        return chosen
    n, fixed = chosen.structure.order, {"dead_time": chosen.dead_time, "lag_1": length / SLOWEST}
    form = ProcessForm(f"P{n}D", n, fixed=fixed)
    slope = fit_form(fits.problem, form, fits.scales, [chosen])
    if slope.cost - chosen.cost > fits.penalty * fits.variance:
        return chosen
    return Candidate(chosen.structure, slope.parameters, slope.cost)


def _with_noise(fits: WindowFit, lags: Sequence[Candidate]) -> WindowFit:
    """Compare lags with the noise that the closest of them leaves.

    One lag may look like an integrator where several do not.
    """
    closest = min(lags, key=lambda one: one.cost)
    residual = evaluate(fits.problem, closest.structure, closest.parameters[None]).residual[0]
    terms = 2 + closest.structure.order + fits.problem.local_count(closest.structure.order)
    sigma = float(np.sqrt(closest.cost / max(residual.size - terms, 1)))
    correlation = correlation_time(residual)
    slowest = float(np.abs(closest.poles).min()) * fits.scales.length
    return fits.of(
        {one.structure: one for one in lags}, sigma=sigma, rounding=0.0, correlation=correlation,
        rivals={}, normalized_rms=1.0, scales=replace(fits.scales, integrating=slowest < RAMP),
    )  # fmt: skip


def _plain(lags: Candidate) -> Candidate:
    """Lags of a form, with the parameters of a structure."""
    return Candidate(lags.structure.plain, lags.theta, lags.cost)
