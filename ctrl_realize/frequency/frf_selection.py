"""The structure that a frequency response supports, what is uncertain in it, and the model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .._wording import plainly
from ..delayed import DelayedStateSpace, delayed_ss
from ..numerics.arrays import locked, read_only
from ..numerics.constants import Z_95
from ..numerics.rational.fit import FRFData, RationalFit
from ..numerics.rational.model import chain_state_space
from ..numerics.rational.search import (
    DEFAULT_ORDERS,
    dead_time_bound,
    fit_structures,
    information_criteria,
    residual_variance,
    smallest_cost,
)
from ..numerics.rational.uncertainty import (
    covariance,
    error_root,
    pole_deviations,
    profile_interval,
)
from ..numerics.statistics import mixture_quantile
from ..results import Flag
from .frf_fit import FRFFit, FRFStructure
from .points import FRFPoints

_POOR_MISFIT = 2.0
"""Residual over the measured noise from which a word is said."""
_NEAR_BIC = 8.0
"""Difference to the best BIC below which a structure widens the interval; beyond, its weight is
below 2 %."""
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


def chosen_model(
    frf: Any,
    data: FRFData,
    fits: dict[tuple[int, int], RationalFit],
    points: FRFPoints,
    unit: float,
    size: float,
    dt: float,
    held: float | None,
    name: str | None,
) -> DelayedStateSpace:
    """Choose the structure, state the uncertainty and build the model.

    Parameters
    ----------
    frf : control.FrequencyResponseData
        As it was measured.
    data : FRFData
        Frequencies in units of `unit` rad/s, responses in units of `size`.
    fits : dict
        (order, relative degree) -> fit.
    points : FRFPoints
        What was fitted, in the measurement's own units.
    unit, size : float
    dt : float
        Sample time of the model in s.
    held : float or None
        Sample time in s of the hold that was divided out.
    name : str or None
    """
    frequency, noise_known = points.frequency_hz, points.noise_known
    rows, scales = _structures(data, fits, unit, noise_known)
    best = rows[0]
    n, r = best.order, best.relative_degree
    chosen = fits[n, r]
    within = _profiles(data, fits, rows, scales, unit)
    interval, flags = _cover(rows, within, data.max_dead_time / unit, 1 / float(frequency[-1]))
    residual_ratio = _residual_ratio(data, chosen)
    if not noise_known and n > max(DEFAULT_ORDERS) and residual_ratio < _ACCURACY:
        interval, systematic = _of_lower_orders(data, fits, rows, scales, unit, interval)
        flags.extend(systematic)
    if noise_known and residual_ratio > _POOR_MISFIT:
        flags.append(
            Flag(
                "misfit",
                f"the residual is {plainly(residual_ratio, 2)} times the measured noise: the "
                f"plant is not exactly of order {n}, or is nonlinear; the interval is widened "
                "accordingly",
            )
        )
    flags.extend(_leading_phase(data, fits, chosen, unit))
    errors = error_root(data, chosen, scales[n, r], robust=not noise_known)
    poles, pole_std = pole_deviations(chosen, errors)
    A, B, C, D = chain_state_space(chosen.theta, chosen.numerator * size, n)
    used = best.dead_time
    if r == 0:
        used, rounded = _whole_samples(best.dead_time, dt)
        flags.extend(rounded)
    result = FRFFit(
        order=n,
        relative_degree=r,
        dead_time=best.dead_time,
        std_given_structure=best.std,
        interval=interval,
        frequency_hz=read_only(frequency),
        measured=locked(points.response),
        sigma=read_only(points.sigma),
        noise_known=noise_known,
        weighted_rms=residual_ratio,
        matrices=(read_only(A * unit), read_only(B * unit), read_only(C), read_only(D)),
        poles=locked(poles * unit),
        pole_std=read_only(pole_std * unit),
        structures=tuple(rows),
        name=str(frf.name or "measured"),
        dt=dt,
        hold_time=held,
        flags=tuple(flags),
    )
    return delayed_ss(result.core, dead_time=used, dt=dt, fit=result, name=name)


def _structures(
    data: FRFData, fits: dict[tuple[int, int], RationalFit], unit: float, noise_known: bool
) -> tuple[list[FRFStructure], dict[tuple[int, int], float]]:
    """List what was tried, best first, and the residual variance of each."""
    rows, scales = [], {}
    criteria = information_criteria(data, fits)
    for (n, r), fit in fits.items():
        freedom = 2 * data.s.size - (2 * n + 2 - r)
        scales[n, r] = residual_variance(data, fit, freedom, noise_known)
        rows.append(
            FRFStructure(
                order=n,
                relative_degree=r,
                dead_time=float(fit.theta[n]) / unit,
                std=float(np.sqrt(covariance(data, fit, scales[n, r])[n, n])) / unit,
                cost=smallest_cost(data, fit),
                bic=criteria[n, r],
            )
        )
    return sorted(rows, key=lambda row: row.bic), scales


def _whole_samples(dead_time: float, dt: float) -> tuple[float, list[Flag]]:
    """Round a dead time to samples, and say so where it matters."""
    # more than any model can hold are refused when it is made
    used = round(min(dead_time / dt, 1e9)) * dt
    if abs(used - dead_time) <= 1e-9 * dt:
        return used, []
    return used, [
        Flag(
            "dead_time_rounded",
            "a model with feedthrough needs a whole number of samples: its dead time is "
            f"{1e3 * used:.5g} ms, not {1e3 * dead_time:.5g} ms; a shorter dt reduces the "
            "rounding",
        )
    ]


def _leading_phase(
    data: FRFData, fits: dict[tuple[int, int], RationalFit], chosen: RationalFit, unit: float
) -> list[Flag]:
    """Say so where a response that comes before its input fits far better.

    At high order a chain of zeros imitates the lead, so a low order is asked.
    """
    # Half a radian at the highest frequency: what is less may as well be none.
    half_radian = 0.5 / float(np.abs(data.s).max())
    if chosen.theta[chosen.order] > half_radian:
        return []
    n = min(chosen.order, _ORDER_OF_LEAD)
    as_is = [fit.cost for (order, _), fit in fits.items() if order == n] or [chosen.cost]
    lead = dead_time_bound(data.response.conj(), np.abs(data.s), 1 / data.weight)
    turned = replace(data, response=data.response * np.exp(-data.s * lead), max_dead_time=lead)
    earlier = min(fit_structures(turned, (n,), (1,)).values(), key=lambda fit: fit.cost)
    dead_time = float(earlier.theta[n]) - lead
    if dead_time > -half_radian or earlier.cost > _FAR_BETTER * min(as_is):
        return []
    return [
        Flag(
            "phase_leads",
            f"the response is non-causal: at order {n} a negative dead time of "
            f"{1e3 * dead_time / unit:.3g} ms leaves "
            f"{100 * np.sqrt(earlier.cost / min(as_is)):.2g} % of the residual; the FRF's time "
            "axis starts late, perhaps because a delay was removed: add it back before the "
            "fit",
        )
    ]


def _profiles(
    data: FRFData,
    fits: dict[tuple[int, int], RationalFit],
    rows: list[FRFStructure],
    scales: dict[tuple[int, int], float],
    unit: float,
) -> list[tuple[float, float]]:
    """Return the profile intervals of the structures that come close to the best, best first.

    Where a numerator is freer than the plant's, the standard deviation is infinite, or says
    nothing; the profile is finite all the same.
    """
    found = []
    for row in rows:
        if row.bic - rows[0].bic < _NEAR_BIC:
            key = row.order, row.relative_degree
            count = row.order + 1 - row.relative_degree
            ends = profile_interval(data, fits[key], count, scales[key], row.std * unit)
            found.append((ends[0] / unit, ends[1] / unit))
    return found


def _residual_ratio(data: FRFData, fit: RationalFit) -> float:
    """Weighted rms residual, over the degrees of freedom."""
    lost = 0.5 * (fit.order + 1 + fit.numerator.size)
    return float(np.sqrt(fit.cost / (data.s.size - lost)))


def _of_lower_orders(
    data: FRFData,
    fits: dict[tuple[int, int], RationalFit],
    rows: list[FRFStructure],
    scales: dict[tuple[int, int], float],
    unit: float,
    interval: tuple[float, float],
) -> tuple[tuple[float, float], list[Flag]]:
    """Widen an interval to those of lower orders within the accuracy of frequency responses.

    What repeats in every point of a measurement, such as drift or a nonlinearity, is smooth along
    frequency: poles describe it as if it were the plant, and the residual does not show it.
    """
    best: dict[int, FRFStructure] = {}
    for row in rows:
        left = _residual_ratio(data, fits[_key(row)])
        if row.order < rows[0].order and left < _ACCURACY:
            best.setdefault(row.order, row)
    if not best:
        return interval, []
    ends = []
    for row in best.values():
        count = row.order + 1 - row.relative_degree
        ends.append(
            profile_interval(data, fits[_key(row)], count, scales[_key(row)], row.std * unit)
        )
    low = min(interval[0], *(first / unit for first, _ in ends))
    high = max(interval[1], *(last / unit for _, last in ends))
    least, most = best[min(best)], rows[0]
    above, left = (100 * _residual_ratio(data, fits[_key(row)]) for row in (least, most))
    return (low, high), [
        Flag(
            "systematic_error",
            f"order {least.order} leaves {above:.2g} % of the response, order {most.order} "
            f"{left:.2g} %: so small an error may be the measurement's, the same in all points, "
            "and not poles of the plant; the interval covers orders "
            f"{least.order} to {most.order}; repeat the measurement for its standard deviation, or "
            "state the order",
        )
    ]


def _key(row: FRFStructure) -> tuple[int, int]:
    return row.order, row.relative_degree


def _cover(
    rows: list[FRFStructure], within: list[tuple[float, float]], bound: float, shortest: float
) -> tuple[tuple[float, float], list[Flag]]:
    """Widen the best structure's interval to those that the data do not tell from it."""
    best, interval = rows[0], within[0]
    ends = np.array(within)
    # exp(-BIC / 2) is the evidence for a structure: the interval is that of the mixture.
    share = np.exp(-0.5 * np.array([row.bic - best.bic for row in rows[: len(within)]]))
    spread = np.maximum((ends[:, 1] - ends[:, 0]) / (2 * Z_95), 1e-12 * bound)
    centre = ends.mean(axis=1)
    low = min(interval[0], mixture_quantile(0.025, centre, spread, share))
    high = max(interval[1], mixture_quantile(0.975, centre, spread, share))
    flags = []
    low, high = max(low, 0.0), min(high, bound)
    if high >= (1 - 1e-9) * bound:
        flags.append(
            Flag(
                "delay_at_bound",
                "the dead time may be larger than the upper bound of the search, "
                f"{1e3 * bound:.4g} ms; try a larger max_dead_time",
            )
        )
    more = high - low - (interval[1] - interval[0])
    worth = max(0.5 * (interval[1] - interval[0]), _SHARE * best.dead_time)
    if more > max(worth, _SMALL_WIDTH * shortest):
        flags.append(
            Flag(
                "structures_disagree",
                "structures that fit equally well split the phase differently between dead "
                f"time and lags: the interval is {1e3 * (high - low):.3g} ms wide, within the "
                f"chosen structure {1e3 * (interval[1] - interval[0]):.3g} ms",
            )
        )
    return (low, high), flags
