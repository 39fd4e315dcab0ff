"""Fit of a model with continuous dead time to a measured frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import control as ct
import numpy as np

from .._checks import integers, positive
from ..delayed import DelayedStateSpace
from ..errors import DataError, OptionError, OrderError
from ..numerics.arrays import FloatArray
from ..numerics.blas_threads import single_threaded
from ..numerics.rational.frf_data import FRFData
from ..numerics.rational.search import (
    DEFAULT_ORDERS,
    dead_time_bound,
    fit_structures,
    fits_with_unknown_errors,
)
from ..numerics.rational.spectra import hold_response
from ..numerics.rational.starts import longest_search
from .frf_selection import chosen_model
from .points import frf_points, held_every, sampled_every

_SAMPLES_PER_SHORTEST_PERIOD = 20


@single_threaded
def fit_frf(
    frf: ct.FrequencyResponseData,
    order: int | Sequence[int] | None = None,
    *,
    relative_degree: int | Sequence[int] | None = None,
    dt: float | None = None,
    max_dead_time: float | None = None,
    weighting: Literal["auto", "std", "relative", "uniform"] = "auto",
    hold: Literal["auto", "zoh"] | None = "auto",
    band_hz: tuple[float, float] | None = None,
    name: str | None = None,
) -> DelayedStateSpace:
    r"""Fit a stable transfer function with continuous dead time to a frequency response.

    Maximum likelihood [1]_, [5]_ for :math:`e^{-s\tau} b(s) / a(s)`, with noise of the measured
    standard deviation. No initial guess is needed: for each dead time on a grid the poles follow
    from a linear problem, and the best of these starts are refined. Order and relative degree are
    chosen by BIC if not given.

    Parameters
    ----------
    frf : MeasuredFRF
        One input, one output. Any `control.FrequencyResponseData`.
    order : int or sequence of int, optional
        Number of poles, or candidates; default 0 (a gain with dead time) to 4, or as many as the
        points determine, and more (up to 10) as long as the largest is the best or dynamics are
        missing: where more than a tenth of the response is left and the residual is correlated
        along frequency. Where three and more are the best, four to eight without zeros as well.
    relative_degree : int or sequence of int, optional
        Poles minus zeros, or candidates; default 1 to the order. With 0, as of order 0, the dead
        time is rounded to whole samples of the model.
    dt : float, optional
        Sample time of the model in s; default: that of the records behind the FRF, or a twentieth
        of the shortest measured period.
    max_dead_time : float, optional
        Upper bound of the search in s; default from the slope of the measured phase. At most a
        thousand periods of the eighth frequency.
        Lines at a distance df, as of a multisine, tell the dead time up to multiples of 1/df, and
        the slope of the phase up to half of that: give a bound where it may be longer.
    weighting : {"auto", "std", "relative", "uniform"}
        "std": the FRF's standard deviation. "relative": an error proportional to the response,
        weighted by the coherence if there is one. "uniform": the same error everywhere. "auto":
        "std" if there is one, "relative" if there is a coherence, and otherwise what the residuals
        tell: a relative error, the same one everywhere, or a relative one with a floor.
    hold : {"auto", "zoh", None}
        "zoh": the FRF was estimated from samples of a held input, and so is the response of the
        model (`dt` must be its sample time if the FRF has none), aliases included. "auto": do so if
        the FRF has a sample time, as from `spectral_frf`. None: the FRF contains no hold.
    band_hz : tuple of float, optional
        Use only points in this band.
    name : str, optional
        Name of the model.

    Returns
    -------
    DelayedStateSpace
        Sampled with a zero-order hold and the exact fractional dead time; ``.fit`` is an `FRFFit`
        with the continuous core, the dead time with its interval, and the structures.

    Raises
    ------
    UnsuitableSystemError
        An FRF with several inputs or outputs.
    DataError
        Too few points for the order, or a response below its noise.
    OrderError, OptionError
        An invalid order, relative degree or option.

    Notes
    -----
    Standard deviations from few repeats are themselves uncertain. With 50 points or more they are
    smoothed over nine neighbours (geometric mean) before they weight the points; with fewer they
    are moved towards that mean as far as the number of repeats explains their scatter [6]_.

    If the noise is not known, the standard deviations of the poles are computed from the residuals
    of the individual points [3]_: poles that depend on a noisy part of the band are more uncertain.
    Where the residuals do not tell a relative error from one that is the same everywhere, the
    interval covers both.

    The flag ``"phase_leads"`` reports an FRF whose time axis starts late, ``"systematic_error"``
    that poles beyond the fourth describe what may be an error of all points of unknown noise; the
    interval then covers lower orders within 3 % too. With ``"highest_order"`` the plant may be a
    distributed one, whose dead time the interval need not hold.

    The interval is that of the profile likelihood, widened if residuals are larger than the noise
    or correlated along frequency, joined with that of the mixture of all structures with weights
    ``exp(-BIC / 2)`` [4]_: how the phase is divided between dead time and lags depends on the
    structure, which the data may not determine.

    Unless order or relative degree are given, chains of four to eight nearly equal lags, diffusion
    and axial dispersion are compared as well, the latter two alone or beside a lag, as of heat in a
    wall or of what flows through a pipe: poles take a part of their many lags for dead time. The
    interval covers those that the data do not rule out. Equal lags and dispersion that fit better
    than all structures are the model; of dispersion, lags and zeros that approximate it for its
    dead time, with the flag ``"dispersed_flow"``. Where longer chains fit better, up to the
    longest, the interval begins at zero, with the flag ``"many_lags"``.

    References
    ----------
    .. [1] R. Pintelon and L. Van Biesen, Identification of transfer functions with time delay and
       its application to cable fault location, IEEE Trans. Instrum. Meas. 39 (1990) 479-484.
    .. [2] B. Gustavsen and A. Semlyen, Rational approximation of frequency domain responses by
       vector fitting, IEEE Trans. Power Delivery 14 (1999) 1052-1061, doi:10.1109/61.772353.
    .. [3] H. White, A heteroskedasticity-consistent covariance matrix estimator and a direct test
       for heteroskedasticity, Econometrica 48 (1980) 817-838, doi:10.2307/1912934.
    .. [4] K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed.,
       Springer 2002, chapter 4, doi:10.1007/b97636.
    .. [5] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd
       ed., Wiley 2012, chapter 9, doi:10.1002/9781118287422.
    .. [6] G. K. Smyth, Linear models and empirical Bayes methods for assessing differential
       expression in microarray experiments, Stat. Appl. Genet. Mol. Biol. 3 (2004) article 3,
       doi:10.2202/1544-6115.1027.

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
    step = None if dt is None else positive(dt, "dt", "sample time in s")
    held = held_every(frf, hold, step)
    below_hz = np.inf if held is None else 0.5 / held
    points = frf_points(frf, weighting, band_hz, below_hz=below_hz)
    frequency, response, sigma = points.frequency_hz, points.response, points.sigma
    if held is not None:
        passed = hold_response(2 * np.pi * frequency, held)
        response, sigma = response / passed, sigma / np.abs(passed)
    orders = None if order is None else integers(order, "order", 0, 30)
    degrees = (
        None if relative_degree is None else integers(relative_degree, "relative_degree", 0, 30)
    )
    orders = _within_points(orders, degrees, frequency.size)
    shortest = 1 / (_SAMPLES_PER_SHORTEST_PERIOD * float(frequency[-1]))
    sample_time = step or sampled_every(frf) or shortest
    omega = 2 * np.pi * frequency
    unit = float(np.sqrt(omega[0] * omega[-1]))
    longest = (
        dead_time_bound(response, omega, sigma)
        if max_dead_time is None
        else _searchable(positive(max_dead_time, "max_dead_time", "time in s"), omega)
    )
    # Scale response and weights to about 1: the tolerances of the optimiser are relative.
    size = float(np.sqrt(np.mean(np.abs(response) ** 2)))
    data = FRFData(
        s=np.asarray(1j * omega / unit, dtype=np.complex128),
        response=response / size,
        weight=size / sigma,
        max_dead_time=longest * unit,
        held=(held or 0.0) * unit,
    )
    if points.assumed:
        ways = fits_with_unknown_errors(data, orders, degrees)
        sigma = size / ways[0][0].weight
    else:
        ways = [(data, fit_structures(data, orders, degrees))]
    used = replace(points, response=response, sigma=sigma)
    stated = order is not None or relative_degree is not None
    return chosen_model(frf, ways, used, unit, size, sample_time, held, name, stated=stated)


def _searchable(max_dead_time: float, omega: FloatArray) -> float:
    """Refuse a bound with too many candidates, or with dead times that are indistinguishable."""
    most, least = longest_search(omega), 1e-15 / float(omega[-1])
    if not least <= max_dead_time <= most:
        way = "long" if max_dead_time > most else "short"
        raise OptionError(
            f"max_dead_time={max_dead_time:g} s is too {way} for these frequencies; expected "
            f"{least:.3g} s, which is practically zero, to {most:.3g} s"
        )
    return max_dead_time


def _within_points(
    orders: tuple[int, ...] | None, degrees: tuple[int, ...] | None, n_points: int
) -> tuple[int, ...] | None:
    """Orders to try: those given, of the default ones those that so many points determine.

    A model has ``2 n + 2 - r`` parameters, half of the numbers in as many complex points.
    """
    tried = orders or tuple(DEFAULT_ORDERS)
    needed = {
        n: max(2 * n + 2 - r for r in degrees or range(min(n, 1), n + 1) if r <= n)
        for n in tried
        if degrees is None or min(degrees) <= n
    }
    if not needed:
        raise OrderError(
            f"relative_degree={degrees} is above order={tried}; expected at most the order"
        )
    possible = tuple(n for n in needed if needed[n] <= n_points)
    if (orders is not None and len(possible) < len(needed)) or not possible:
        lowest = f"; {n_points} points suffice for order {max(possible)}" if possible else ""
        raise DataError(
            f"{n_points} points are too few for order {max(needed)}; expected at least "
            f"{max(needed.values()) if orders else min(needed.values())}{lowest}"
        )
    return orders if len(possible) == len(needed) else possible
