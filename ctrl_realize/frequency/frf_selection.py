"""The structure that a frequency response supports, what is uncertain in it, and the model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from .._flags import Flag, flagged, flow_flag
from .._wording import chosen, in_time, plainly
from ..delayed import DelayedStateSpace, delayed_ss
from ..numerics.arrays import locked, read_only
from ..numerics.constants import VERY_STRONG, Z_95
from ..numerics.engine.problem import Structure
from ..numerics.engine.static_gain import mixture_quantile
from ..numerics.engine.structures import Candidate
from ..numerics.output_error.selection import Choice
from ..numerics.rational.frf_data import FRFData, modal_state_space, pole_deviations
from ..numerics.rational.search import (
    DEFAULT_ORDERS,
    dead_time_bound,
    fit_structures,
    independent_points,
    information_criterion,
    unexplained,
)
from ..numerics.signals.noise import largest_excess
from .comparison import hertz
from .frf_fit import FRFFit, FRFStructure
from .frf_structures import ComparedFits, ManyLags, compared_fits, key_of, residual_ratio
from .points import FRFPoints

_POOR_MISFIT, _MOST_LEFT = 2.0, 0.5
"""Residual over the measured noise, and part of a response of unknown noise that is left, from
which a word is said."""
_SHARE = 0.1
"""Part of the dead time by which structures must disagree for a word about it: the interval covers
all of them in any case, and some other structure nearly always widens a narrow one."""
_SMALL_WIDTH = 1e-3
"""Widening in shortest periods below which nothing is said."""
_ACCURACY = 0.03
"""Error, over the response, below which a response of unknown noise may be wrong in all its points:
two repeats of an undulator's differ by 2.8 % (median), and each is fitted to 1 % by order 9 or 10.
Up to the default orders it may be the noise of the points."""
_ORDER_OF_LEAD = 4
"""Highest order that is asked whether the response leads."""
_FAR_BETTER = 0.5
"""Of the square of the residual."""
_POLES_TRIED = 10
"""Unstable poles of the grid. Of 20 simulated unstable plants 18 lowered the criterion by 31 and
more (two were unstable below the band), and of 14 stable ones none by more than -5."""


def chosen_model(
    frf: Any, ways: list[tuple[FRFData, dict[Structure, Candidate]]], points: FRFPoints,
    unit: float, size: float, dt: float, held: float | None, name: str | None, *, stated: bool,
) -> DelayedStateSpace:  # fmt: skip
    """Choose the structure, state the uncertainty and build the model.

    Parameters
    ----------
    frf : control.FrequencyResponseData
        As it was measured.
    ways : list of FRFData, dict
        Frequencies in units of `unit` rad/s, responses in units of `size`, and the fits of all
        structures; then those with other weights that are not ruled out.
    points : FRFPoints
        What was fitted, in the measurement's own units.
    unit, size : float
    dt : float
        Sample time of the model in s.
    held : float or None
        Sample time in s of the hold that was divided out.
    name : str or None
    stated : bool
        Whether order or relative degree were given.
    """
    frequency, noise_known = points.frequency_hz, points.noise_known
    (data, fits), *others = ways
    compared = compared_fits(data, fits, unit, noise_known)
    fits, rows, scales = compared.fits, compared.rows, compared.scales
    best = rows[0]
    many = ManyLags() if stated else compared.of_many_lags(data)
    near, beside = compared.near(many.better), [*many.ends, *[(0.0, 0.0)] * many.unlimited]
    ends = [compared.interval(data, key_of(row), solved=row is best) for row in near]
    for other, its in others:
        more = compared_fits(other, its, unit, noise_known)
        beside.append(more.interval(other, key_of(more.rows[0]), solved=True))
    own, choices = many.own or ends[0], []
    if many.choice is None:
        model, std = fits[key_of(best)], best.std
        poles, pole_std = pole_deviations(data, model, scales[key_of(best)], robust=not noise_known)
    else:
        model, std = many.choice.model, (own[1] - own[0]) / (2 * Z_95 * unit)
        choices.append(_why(many.choice, len(rows)))
        poles = model.poles[np.argsort(np.abs(model.poles), kind="stable")]
        pole_std = np.full(poles.size, np.nan)  # they follow a law, or approximate one
    n, r, dead_time = model.structure.order, model.structure.relative_degree, model.dead_time / unit
    many_poles = n > max(DEFAULT_ORDERS) and many.choice is None
    own, *every = [(low / unit, high / unit) for low, high in (own, *ends, *beside)]
    within, beside = every[: len(near)], [own, *every[len(near) :]]
    limits = data.max_dead_time / unit, 1 / frequency[-1]
    interval, flags = _cover(dead_time, near, within, beside, *limits)
    if many.unlimited:
        flags.append(flagged("many_lags", known=""))
    if many.flow is not None:
        followed = many.choice is not None and many.choice.flow is not None
        flags.append(flow_flag(many.flow, followed=followed, unit=unit))
    ratio = residual_ratio(data, model)
    if not noise_known and many_poles and ratio < _ACCURACY:
        interval, systematic = _of_lower_orders(data, compared, unit, interval)
        flags.extend(systematic)
    if noise_known and ratio > _POOR_MISFIT:
        first, stop = largest_excess(np.abs(data.misfit(model)))
        band = f"{hertz(frequency[first])} and {hertz(frequency[stop - 1])}"
        flags.append(flagged("structured_misfit.frf", ratio=plainly(ratio, 2), band=band, order=n))
    elif noise_known and not stated and many_poles and n == max(row.order for row in rows):
        flags.append(flagged("highest_order.frf", order=n))
    left = np.linalg.norm(data.misfit(model)) / np.linalg.norm(data.weight * data.response)
    if left > _MOST_LEFT and not noise_known:
        flags.append(flagged("structured_misfit.most", left=plainly(100 * float(left), 2)))
    # A response that leads its input explains the misfit, which no other order or bound mends.
    flags = [*_leading_phase(data, fits, model, unit)] or flags
    if many_poles or left > _MOST_LEFT:
        flags.extend(_unstable_pole(data, fits, model, unit))
    A, B, C, D = modal_state_space(data, model)
    used = dead_time
    if r == 0:
        # more than any model can hold are refused when it is made; a held input waits for a sample
        used = (round if held is None else ceil)(min(used / dt, 1e9)) * dt
        if abs(used - dead_time) > 1e-9 * dt:
            exact = in_time(dead_time, 5)
            flags.append(flagged("dead_time_rounded", used=in_time(used, 5), dead_time=exact))
    result = FRFFit(
        order=n, relative_degree=r, dead_time=dead_time, std_given_structure=std,
        interval=interval,
        frequency_hz=read_only(frequency),
        measured=locked(points.response),
        sigma=read_only(points.sigma),
        noise_known=noise_known,
        weighted_rms=ratio,
        matrices=(
            read_only(A * unit), read_only(B * unit), read_only(C * size), read_only(D * size),
        ),
        poles=locked(poles * unit),
        pole_std=read_only(pole_std * unit),
        structures=tuple(rows),
        name=str(frf.name or "measured"),
        dt=dt,
        hold_time=held,
        flags=tuple(flags),
        choices=tuple(choices),
        stated=stated,
    )  # fmt: skip
    if not result.gain_resolved:
        lowest = f"{frequency[0]:.4g}"
        open_end = flagged("gain_not_resolved.frf", gain=result.gain, lowest=lowest)
        result = replace(result, flags=(*result.flags, open_end))
    if held is not None:
        points_alone = (
            result.response(2 * np.pi * frequency) + data.misfit(model) / data.weight * size
        )
        result = replace(result, measured=locked(points_alone))
    return delayed_ss(result.core, dead_time=used, dt=dt, fit=result, name=name)


def _why(choice: Choice, count: int) -> str:
    """Say why a chain of lags or dispersion was chosen instead of one of `count` structures."""
    structure = choice.model.structure
    if choice.flow is None:
        return chosen("structure.chain", order=structure.order, count=count)
    kind = f"order {structure.order}, relative degree {structure.relative_degree}"
    return chosen("structure.flow", kind=kind, count=count)


def _leading_phase(
    data: FRFData, fits: dict[Structure, Candidate], chosen: Candidate, unit: float
) -> Iterator[Flag]:
    """Say so where a response that comes before its input fits far better.

    At high order a chain of zeros imitates the lead, so a low order is asked.
    """
    # Half a radian at the highest frequency: what is less may as well be none.
    half_radian = 0.5 / float(np.abs(data.s).max())
    if chosen.dead_time > half_radian:
        return
    n = min(max(chosen.structure.order, 1), _ORDER_OF_LEAD)
    as_is = [fit.cost for key, fit in fits.items() if key.order == n] or [chosen.cost]
    lead = dead_time_bound(data.response.conj(), np.abs(data.s), 1 / data.weight)
    turned = replace(data, response=data.response * np.exp(-data.s * lead), max_dead_time=lead)
    earlier = min(fit_structures(turned, (n,), (1,)).values(), key=lambda fit: fit.cost)
    dead_time = earlier.dead_time - lead
    if dead_time <= -half_radian and earlier.cost <= _FAR_BETTER * min(as_is):
        left = 100 * np.sqrt(earlier.cost / min(as_is))
        yield flagged("phase_leads", order=n, dead_time=in_time(dead_time / unit), left=left)


def _unstable_pole(
    data: FRFData, fits: dict[Structure, Candidate], chosen: Candidate, unit: float
) -> Iterator[Flag]:
    """Say so where an unstable plant of low order fits better than the stable model.

    The all-pass factor (s - p) / (s + p) makes a plant with the pole p stable, and leaves the noise
    as it is.
    """

    def fitted(log_pole: float, orders: tuple[int, ...]) -> tuple[float, Candidate]:
        pole = float(np.exp(log_pole))
        mirrored = data.response * (data.s - pole) / (data.s + pole)
        found = fit_structures(replace(data, response=mirrored), orders, None)
        return min(
            ((information_criterion(data, fit, count, 1), fit) for fit in found.values()),
            key=lambda one: one[0],
        )

    count = independent_points(data, fits)
    omega = np.abs(data.s)
    poles = np.log(np.geomspace(omega.min() / 2, omega.max() / 2, _POLES_TRIED))
    tried = [fitted(pole, (1, 2)) for pole in poles]
    best = int(np.argmin([criterion for criterion, _ in tried]))
    if unexplained(data, tried[best][1]) > _MOST_LEFT:
        return
    order = tried[best][1].structure.order
    ends = poles[max(best - 1, 0)], poles[min(best + 1, poles.size - 1)]
    closest = minimize_scalar(
        lambda at: fitted(float(at), (order,))[0], bounds=ends, method="bounded",
        options={"xatol": 0.01},
    )  # fmt: skip
    pole = float(closest.x)
    criterion, fit = fitted(pole, (order,))
    if criterion < information_criterion(data, chosen, count) - VERY_STRONG:
        yield flagged(
            "unstable.frf",
            pole=plainly(float(np.exp(pole)) * unit, 3),
            order=order,
            dead_time=in_time(fit.dead_time / unit),
            left=100 * unexplained(data, fit),
            chosen=chosen.structure.order,
            left_by_chosen=100 * unexplained(data, chosen),
        )


def _of_lower_orders(
    data: FRFData, compared: ComparedFits, unit: float, interval: tuple[float, float]
) -> tuple[tuple[float, float], list[Flag]]:
    """Widen an interval to those of lower orders within the accuracy of frequency responses.

    What repeats in every point of a measurement, such as drift or a nonlinearity, is smooth along
    frequency: poles describe it as if it were the plant, and the residual does not show it.
    """
    fits, rows = compared.fits, compared.rows
    best: dict[int, FRFStructure] = {}
    for row in rows:
        left = residual_ratio(data, fits[key_of(row)])
        if row.order < rows[0].order and left < _ACCURACY:
            best.setdefault(row.order, row)
    if not best:
        return interval, []
    ends = [compared.interval(data, key_of(row), solved=True) for row in best.values()]
    low = min(interval[0], *(first / unit for first, _ in ends))
    high = max(interval[1], *(last / unit for _, last in ends))
    least, most = best[min(best)], rows[0]
    above, left = (100 * residual_ratio(data, fits[key_of(row)]) for row in (least, most))
    systematic = flagged(
        "systematic_error",
        least=least.order,
        left_by_least=above,
        most=most.order,
        left_by_most=left,
    )
    return (low, high), [systematic]


def _cover(
    dead_time: float,
    rows: list[FRFStructure],
    within: list[tuple[float, float]],
    beside: list[tuple[float, float]],
    bound: float,
    shortest: float,
) -> tuple[tuple[float, float], list[Flag]]:
    """Widen the interval of the model to those that the data do not tell from it.

    `within` are those of structures, `beside` that of the model first, and then those of chains,
    diffusion and dispersion, and of other weights.
    """
    (first, last), ends = beside[0], np.array(within).reshape(-1, 2)
    low, high = min(low for low, _ in beside), max(high for _, high in beside)
    if rows:
        # exp(-BIC / 2) is the evidence for a structure: the interval is that of the mixture.
        share = np.exp(-0.5 * np.array([row.bic - rows[0].bic for row in rows]))
        spread = np.maximum((ends[:, 1] - ends[:, 0]) / (2 * Z_95), 1e-12 * bound)
        centre = ends.mean(axis=1)
        low = min(low, mixture_quantile(0.025, centre, spread, share))
        high = max(high, mixture_quantile(0.975, centre, spread, share))
    flags = []
    low, high = max(low, 0.0), min(high, bound)
    if high >= (1 - 1e-9) * bound:
        flags.append(flagged("delay_at_bound.frf", bound=in_time(bound, 4)))
    own = last - first
    worth = max(0.5 * own, _SHARE * dead_time, _SMALL_WIDTH * shortest)
    if high - low - own > worth:
        flags.append(
            flagged("structures_disagree.frf", wide=in_time(high - low), chosen=in_time(own))
        )
    return (low, high), flags
