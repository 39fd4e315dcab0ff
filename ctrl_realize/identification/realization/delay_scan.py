"""The paper's delay estimate: realize after every delay, and choose the smallest IAE."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ..._checks import integer
from ...data import ImpulseResponse
from ...delayed import DelayedStateSpace, fit_of
from ...numerics.arrays import read_only
from ...numerics.blas_threads import single_threaded
from .delay_scan_result import DelayScan
from .realize import realize
from .result import Realization
from .scan_curve import scan_curve, scan_flags
from .scan_surface import Surface, scan_surface


@single_threaded
def estimate_delay(
    impulse: ImpulseResponse | ArrayLike,
    order: int,
    *,
    max_delay: int,
    samples: int | None = None,
    feedthrough: bool | None = None,
    hankel: str = "square",
    dt: float | None = None,
) -> DelayedStateSpace:
    """Estimate the delay of an impulse response by the paper's scan, and realize the model.

    For every d in 0...max_delay the response from d on is realized at the given order and delayed
    by z^-d, and the integrated absolute error is computed over one window, the same for all d. The
    delay with the smallest error is chosen.

    Parameters
    ----------
    impulse : ImpulseResponse, or array_like of shape (N,) or (p, m, N)
        Markov parameters. An array needs `dt`. Several channels share one delay.
    order : int
        States of the model without its delay. If the order is too low, lags are taken for delay; if
        it is much too high, states model the delay.
    max_delay : int
        Largest delay to try, in samples.
    samples : int, optional
        Markov parameters after each ``G[d]`` to use (the paper's n). Default: three times the
        settling time of the data (2 %), at least 256, at most what remains after `max_delay`. Later
        samples contain only noise.
    feedthrough : bool, optional
        True: all models have the feedthrough ``D = G[d]`` (as in the paper). False: ``D = 0``.
        Default: ``G[d]`` for the candidates; the returned model then follows the rule of `realize`.
    hankel : {"square", "padded"}, optional
        As for `realize`.
    dt : float, optional
        Sample time in s, if `impulse` is an array.

    Returns
    -------
    DelayedStateSpace
        ``realize(impulse, order, delay=scan.delay, samples=scan.samples)``;
        its `fit` is the `DelayScan`.

    Raises
    ------
    OrderError
        The order is not in 1...rows of the Hankel matrix, or larger than the numerical rank of the
        data at the best delay.
    DelayRangeError
        `max_delay` and `samples` need more data than there are.

    Notes
    -----
    With feedthrough, exact data of a sampled strictly proper plant are fitted equally well by its
    delay and by one more sample; the smaller delay is returned. MATLAB's ``nk`` of a strictly
    proper model is one more.

    The model class has free B, C and D, in which the delay is only weakly determined: `interval` is
    wide even at low noise. Filters and differentiation that remain in the data bias the estimate.

    All delays are decomposed together by a truncated, residual-controlled Lanczos recurrence; the
    errors agree with those of the dense SVD to ``1e-11 sum |G| + 1e-9 IAE``.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 2.1.
    .. [2] S. Y. Kung, A new identification and model reduction algorithm via singular value
       decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.
    .. [3] S. Bjorklund and L. Ljung, A review of time-delay estimation techniques, Proc. 42nd IEEE
       Conf. Decision and Control (2003) 2502-2507, doi:10.1109/CDC.2003.1272997.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[np.zeros(38), 0.1 * 0.9 ** np.arange(300)]
    >>> sys = cr.estimate_delay(pulse, 1, max_delay=60, dt=0.01)
    >>> sys.delay, sys.fit.delay_interval
    (37, (37, 38))
    """
    order = integer(order, "order", 1)
    surface = scan_surface(impulse, (order,), max_delay, samples, feedthrough, hankel, dt)
    return best_of(surface, order)


def best_of(surface: Surface, order: int) -> DelayedStateSpace:
    """Realize the model of one order at its best delay."""
    iae, delay, flat = scan_curve(surface, order)
    system = realize(
        surface.impulse,
        order,
        delay=delay,
        samples=surface.samples,
        feedthrough=surface.feedthrough,
        hankel=surface.hankel,
    )
    realization = fit_of(system, Realization)
    fit = DelayScan(
        iae=read_only(iae),
        delay=delay,
        delay_interval=flat,
        order=order,
        samples=surface.samples,
        feedthrough=surface.feedthrough is not False,
        singular_values=read_only(surface.singular_values[:, :order]),
        noise_floor=surface.noise_floor,
        impulse=realization.impulse,
        realization=realization,
        flags=(*scan_flags(surface, order), *realization.flags),
    )
    return system.replace(fit=fit)
