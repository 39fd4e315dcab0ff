"""A model with free dead time from a measured frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import control as ct
import numpy as np

from ..checks import one_of, positive, whole
from ..delayed import DelayedStateSpace, delayed_ss
from ..errors import DataError, OptionError, OrderError
from ..numerics.arrays import read_only
from ..numerics.rational import chain_state_space
from ..numerics.rational_fit import FRFData, RationalFit, covariance, profile_interval
from ..numerics.rational_search import (
    DEFAULT_ORDERS,
    dead_time_bound,
    fit_structures,
    information_criterion,
    residual_variance,
    smallest_cost,
)
from ..numerics.spectra import hold_response
from ..numerics.statistics import mixture_quantile
from ..results import Flag
from .frf_fit import FRFFit, FRFStructure
from .points import FRFPoints, frf_points

_NEAR_BIC = 8.0
_SMALL_WIDTH = 1e-3
_SAMPLES_PER_SHORTEST_PERIOD = 20


def fit_frf(
    frf: ct.FrequencyResponseData,
    order: int | Sequence[int] | None = None,
    *,
    relative_degree: int | Sequence[int] | None = None,
    dt: float | None = None,
    max_dead_time: float | None = None,
    weighting: Literal["auto", "std", "relative", "uniform"] = "auto",
    hold: Literal["zoh"] | None = None,
    band_hz: tuple[float, float] | None = None,
    name: str | None = None,
) -> DelayedStateSpace:
    r"""Fit a stable transfer function with free dead time to a frequency response.

    Maximum likelihood, as Pintelon and Van Biesen (1990) proposed, for
    :math:`e^{-s\tau} b(s) / a(s)` with noise of the measured standard deviation. No initial guess
    is needed: for each dead time on a grid the poles come from a linear problem, and the best of
    these starts are refined. Order and relative degree are chosen by BIC where not given.

    Parameters
    ----------
    frf : MeasuredFRF
        One input, one output. Any `control.FrequencyResponseData` will do.
    order : int or sequence of int, optional
        Number of poles, or candidates; default 1 to 4, and beyond (to 10) as long as the largest
        is the best.
    relative_degree : int or sequence of int, optional
        Poles minus zeros, or candidates; default 1 to the order. With 0 the dead time is rounded
        to whole samples of the model.
    dt : float, optional
        Sample time of the model in s; default a twentieth of the shortest period measured.
    max_dead_time : float, optional
        Upper bound of the search in s; default from the slope of the measured phase.
    weighting : {"auto", "std", "relative", "uniform"}
        "std": the FRF's standard deviation. "relative": an error in proportion to the response,
        and to what the coherence says where there is one. "uniform": the same error everywhere.
        "auto": "std" where there is one, else "relative".
    hold : {"zoh", None}
        "zoh" for an FRF that was estimated from samples of a held input, such as one from
        `spectral_frf`: the hold, for which `dt` must be that of the samples, is divided out.
    band_hz : tuple of float, optional
        Use points in this band alone.
    name : str, optional
        Name of the model.

    Returns
    -------
    DelayedStateSpace
        Sampled behind a zero-order hold with the exact fractional dead time; ``.fit`` is an
        `FRFFit` with the continuous core, the dead time with its interval, and the structures.

    Raises
    ------
    UnsuitableSystemError
        An FRF with several inputs or outputs.
    DataError
        Too few points for the order.
    OrderError, OptionError
        An order, a degree or an option that makes no sense.

    Notes
    -----
    The standard deviations of few repeats are themselves uncertain. With 50 points or more they
    are smoothed over nine neighbours (geometric mean) before they weight the points.

    The interval is the profile likelihood's, widened for residuals larger than the noise or
    correlated along frequency, joined with that of the mixture of all structures, each with the
    weight ``exp(-BIC / 2)``: the split of the phase between dead time and lags depends on the
    structure, which the data may not tell.

    References
    ----------
    .. [1] R. Pintelon and L. Van Biesen, Identification of transfer functions with time delay
       and its application to cable fault location, IEEE Trans. Instrum. Meas. 39 (1990).
    .. [2] B. Gustavsen and A. Semlyen, Rational approximation of frequency domain responses by
       vector fitting, IEEE Trans. Power Delivery 14 (1999).

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> f = np.geomspace(0.1, 20, 80)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(2 * np.exp(-0.0289 * s) / (0.08 * s + 1) ** 2, f)
    >>> model = cr.fit_frf(frf, 2, dt=0.001)
    >>> print(f"{model.fit.dead_time:.6f}")
    0.028900
    """
    if hold is not None:
        one_of(hold, "hold", ("zoh",))
        if dt is None:
            raise OptionError("hold='zoh' needs dt, the sample time of the held input in s")
    step = None if dt is None else positive(dt, "dt", "sample time in s")
    below_hz = 0.5 / step if hold is not None and step is not None else np.inf
    points = frf_points(frf, weighting, band_hz, below_hz=below_hz)
    frequency, response, sigma = points.frequency_hz, points.response, points.sigma
    if hold is not None and step is not None:
        response = response / hold_response(2 * np.pi * frequency, step)
    orders = _candidates(order, "order", 1)
    degrees = _candidates(relative_degree, "relative_degree", 0)
    _check_structures(orders, degrees, frequency.size)
    sample_time = (
        1 / (_SAMPLES_PER_SHORTEST_PERIOD * float(frequency[-1])) if step is None else step
    )
    omega = 2 * np.pi * frequency
    unit = float(np.sqrt(omega[0] * omega[-1]))
    longest = (
        dead_time_bound(response, omega, sigma)
        if max_dead_time is None
        else positive(max_dead_time, "max_dead_time", "time in s")
    )
    # Equal size of response and weights around 1: the optimiser's thresholds are relative.
    size = float(np.sqrt(np.mean(np.abs(response) ** 2)))
    data = FRFData(
        s=np.asarray(1j * omega / unit, dtype=np.complex128),
        response=response / size,
        weight=size / sigma,
        max_dead_time=longest * unit,
    )
    fits = fit_structures(data, orders, degrees)
    used = replace(points, response=response)
    return _result(frf, data, fits, used, unit, size, sample_time, name)


def _candidates(given: int | Sequence[int] | None, name: str, low: int) -> tuple[int, ...] | None:
    """Return the whole numbers to try."""
    if given is None:
        return None
    try:
        values = tuple(given)  # type: ignore[arg-type]
    except TypeError:
        values = (given,)  # type: ignore[assignment]
    if not values:
        raise OrderError(f"{name}={given!r} is empty; needed is at least one number")
    try:
        return tuple(sorted({whole(value, name, low, 30) for value in values}))
    except OptionError as error:
        raise OrderError(str(error)) from error


def _check_structures(
    orders: tuple[int, ...] | None, degrees: tuple[int, ...] | None, n_points: int
) -> None:
    """Refuse degrees above all orders, and more parameters than there are points."""
    tried = orders or DEFAULT_ORDERS
    pairs = [(n, r) for n in tried for r in (degrees or range(1, n + 1)) if r <= n]
    if not pairs:
        raise OrderError(
            f"relative_degree={degrees} is above order={orders or tuple(tried)}; needed is at "
            "most the order"
        )
    needed = max(2 * n + 2 - r for n, r in pairs)
    if n_points < needed:
        raise DataError(
            f"{n_points} points are too few for order {max(tried)}; {needed} are needed, or a "
            "lower order"
        )


def _result(
    frf: Any,
    data: FRFData,
    fits: dict[tuple[int, int], RationalFit],
    points: FRFPoints,
    unit: float,
    size: float,
    dt: float,
    name: str | None,
) -> DelayedStateSpace:
    """Choose the structure, state the uncertainty and build the model."""
    frequency, noise_known = points.frequency_hz, points.noise_known
    n_values = 2 * frequency.size
    rows, scales = [], {}
    for (n, r), fit in fits.items():
        n_parameters = 2 * n + 2 - r
        cost, bic = smallest_cost(data, fit), information_criterion(data, fit, n, r)
        scales[n, r] = residual_variance(data, fit, n_values - n_parameters, noise_known)
        spread = covariance(data, fit, scales[n, r])[n, n]
        rows.append(
            FRFStructure(n, r, float(fit.theta[n]) / unit, float(np.sqrt(spread)) / unit, cost, bic)
        )
    rows.sort(key=lambda row: row.bic)
    best = rows[0]
    n, r = best.order, best.relative_degree
    chosen = fits[n, r]
    within = _profiles(data, fits, rows, scales, unit)
    interval, flags = _cover(rows, within, data.max_dead_time / unit, 1 / float(frequency[-1]))
    misfit = float(np.sqrt(chosen.cost / (frequency.size - 0.5 * (2 * n + 2 - r))))
    if noise_known and misfit > 2:
        flags.append(
            Flag(
                "misfit",
                f"the residual is {misfit:.2g} times the measured noise: the plant is not exactly "
                f"of order {n}, or not linear; the interval is widened by that",
            )
        )
    A, B, C, D = chain_state_space(chosen.theta, chosen.numerator * size, n)
    matrices = (read_only(A * unit), read_only(B * unit), read_only(C), read_only(D))
    dead_time = best.dead_time
    used = dead_time
    if r == 0:
        used = round(dead_time / dt) * dt
        if abs(used - dead_time) > 1e-9 * dt:
            flags.append(
                Flag(
                    "dead_time_rounded",
                    "a model with direct term takes whole samples: its dead time is "
                    f"{1e3 * used:.5g} ms, not {1e3 * dead_time:.5g} ms; a shorter dt rounds less",
                )
            )
    locked = np.array(points.response)
    locked.flags.writeable = False
    result = FRFFit(
        order=n,
        relative_degree=r,
        dead_time=dead_time,
        std=best.std,
        interval=interval,
        frequency_hz=read_only(frequency),
        measured=locked,
        sigma=read_only(points.sigma),
        noise_known=noise_known,
        misfit=misfit,
        matrices=matrices,
        structures=tuple(rows),
        name=str(frf.name or "measured"),
        flags=tuple(flags),
    )
    return delayed_ss(result.core, dead_time=used, dt=dt, fit=result, name=name)


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


def _cover(
    rows: list[FRFStructure], within: list[tuple[float, float]], bound: float, shortest: float
) -> tuple[tuple[float, float], list[Flag]]:
    """Widen the best structure's interval to those that the data do not tell from it."""
    best, interval = rows[0], within[0]
    ends = np.array(within)
    # exp(-BIC / 2) is the evidence for a structure: the interval is that of the mixture.
    share = np.exp(-0.5 * np.array([row.bic - best.bic for row in rows[: len(within)]]))
    spread = np.maximum((ends[:, 1] - ends[:, 0]) / 3.92, 1e-12 * bound)
    centre = ends.mean(axis=1)
    low = min(interval[0], mixture_quantile(0.025, centre, spread, share))
    high = max(interval[1], mixture_quantile(0.975, centre, spread, share))
    flags = []
    low, high = max(low, 0.0), min(high, bound)
    if best.dead_time >= (1 - 1e-9) * bound:
        flags.append(
            Flag(
                "delay_at_bound",
                f"the dead time is at the upper bound of the search, {1e3 * bound:.4g} ms; "
                "try a larger max_dead_time",
            )
        )
    if high - low > max(1.5 * (interval[1] - interval[0]), _SMALL_WIDTH * shortest):
        flags.append(
            Flag(
                "structures_disagree",
                "structures that fit as well split the phase otherwise between dead time and "
                f"lags: the interval is {1e3 * (high - low):.3g} ms wide, within the chosen "
                f"structure {1e3 * (interval[1] - interval[0]):.3g} ms",
            )
        )
    return (low, high), flags
