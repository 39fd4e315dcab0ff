"""Kung's realization of an impulse response after a known delay."""

from __future__ import annotations

from collections.abc import Iterator

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integer, one_of
from ..._flags import Flag, flagged
from ...data import ImpulseResponse
from ...delayed import DelayedStateSpace
from ...errors import OrderError
from ...numerics.arrays import FloatArray, read_only
from ...numerics.blas_threads import single_threaded
from ...numerics.hankel.delay_models import OneModel, realize_at
from ...numerics.state_space import responses
from .impulses import as_impulse, channels, check_samples, filter_flags
from .result import Realization

HANKEL = ("square", "padded")

NO_GAP = 0.8
"""Ratio of neighbouring singular values above which there is no gap between them."""

DIED_AWAY = 0.2
"""Fraction of a response that may remain at the end of the data."""

CLEAR = 3.0
"""Standard deviations of the noise above which a feedthrough is significant."""


@single_threaded
def realize(
    impulse: ImpulseResponse | ArrayLike,
    order: int,
    *,
    delay: int = 0,
    samples: int | None = None,
    feedthrough: bool | None = None,
    hankel: str = "square",
    dt: float | None = None,
) -> DelayedStateSpace:
    """Realize an impulse response as a state-space system with dead time.

    Kung's algorithm on G[delay], G[delay + 1], ...; the delay itself is added to the model
    unchanged.

    Parameters
    ----------
    impulse : ImpulseResponse, or array_like of shape (N,) or (p, m, N)
        Markov parameters (response to a unit pulse). An array needs `dt`.
    order : int
        States of the model without its delay.
    delay : int, optional
        Delay of all channels in samples.
    samples : int, optional
        Markov parameters after ``G[delay]`` to use; default: all.
    feedthrough : bool, optional
        True: the feedthrough is ``D = G[delay]`` (the paper). False: ``D = 0``, the model is
        strictly proper. Default: ``D = G[delay]``, unless the noise of the data is known and
        ``G[delay]`` is within three standard deviations of it; exact data of proper and strictly
        proper plants are both reproduced exactly.
    hankel : {"square", "padded"}, optional
        The paper's square Hankel matrix of samples // 2 rows, or Kung's zero-padded one, whose
        models are stable by construction and have an error bound; it needs data that have decayed
        within `samples`.
    dt : float, optional
        Sample time in s, if `impulse` is an array.

    Returns
    -------
    DelayedStateSpace
        Its `fit` is a `Realization`.

    Raises
    ------
    OrderError
        The order is not in 1...rows of the Hankel matrix, or larger than the
        numerical rank of the data.
    DelayRangeError
        Delay and samples need more data than there are.
    DataError, OptionError
        Data or arguments that cannot be used.

    Notes
    -----
    Step (5) of the paper [1]_ is used with its misprints corrected: ``H_a = T(2:r+1, 1:r)``, ``H_b
    = T(1:r, 1)``, ``H_c = T(1, 1:r)`` and ``V`` without the transposes. The decomposition is
    truncated and matrix-free, with time and memory proportional to the data.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 2.1.
    .. [2] S. Y. Kung, A new identification and model reduction algorithm via singular value
       decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.
    .. [3] B. L. Ho and R. E. Kalman, Effective construction of linear state-variable models from
       input/output functions, Regelungstechnik 14 (1966) 545-548, doi:10.1524/auto.1966.14.112.545.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[np.zeros(4), 0.1 * 0.9 ** np.arange(200)]   # 3 samples, then a lag
    >>> sys = cr.realize(pulse, 1, delay=3, dt=0.01)
    >>> sys.delay, np.round(sys.delay_free.poles().real, 12)
    (3, array([0.9]))
    """
    data = as_impulse(impulse, dt)
    order = integer(order, "order", 1)
    delay = integer(delay, "delay", 0)
    hankel = one_of(hankel, "hankel", HANKEL)
    padded = hankel == "padded"
    samples = check_samples(data, samples, order, delay, padded=padded, what="delay")
    markov = channels(data)
    model = realize_at(markov, delay, samples, order, padded=padded)
    rank = int(np.count_nonzero(model.singular_values[:order]))
    if rank < order:
        raise OrderError(
            f"order={order}, but the numerical rank of the data after {delay} samples is "
            f"{rank}; "
            + (f"use an order of at most {rank}" if rank else "the data are zero: a pure gain")
        )
    direct = uses_feedthrough(data, delay, feedthrough)
    D = markov[:, :, delay] if direct else np.zeros(markov.shape[:2])
    fit = Realization(
        order=order,
        delay=delay,
        samples=samples,
        hankel=hankel,
        feedthrough=direct,
        singular_values=read_only(model.singular_values),
        next_singular_value=model.following,
        error_bound=model.rest_bound if padded else None,
        iae=_iae(markov[:, :, : delay + samples + 1], model, D, delay),
        impulse=data,
        flags=(*filter_flags(data), *_model_flags(model, order, samples)),
    )
    return DelayedStateSpace(ct.ss(model.A, model.B, model.C, D, data.dt), delay, fit=fit)


def uses_feedthrough(impulse: ImpulseResponse, delay: int, feedthrough: bool | None) -> bool:
    """Decide whether the feedthrough is the Markov parameter at the delay."""
    if feedthrough is not None:
        return bool(feedthrough)
    noise = impulse.noise
    if noise is None or noise.size < 2 or impulse.markov.ndim == 3:
        return True
    return bool(abs(impulse.markov[delay]) > CLEAR * np.std(noise, ddof=1))


def _iae(window: FloatArray, model: OneModel, D: FloatArray, delay: int) -> float:
    """IAE of the model; infinite if it grows beyond all numbers."""
    response = np.zeros_like(window)
    count = window.shape[2] - delay
    with np.errstate(over="ignore", invalid="ignore"):
        response[:, :, delay:] = responses.markov(model.A, model.B, model.C, D, count)
        iae = float(np.abs(window - response).sum())
    return iae if np.isfinite(iae) else np.inf


def _model_flags(model: OneModel, order: int, samples: int) -> Iterator[Flag]:
    """List the flags that follow from poles and singular values."""
    poles = np.linalg.eigvals(model.A)
    largest = float(np.abs(poles).max())
    if largest >= 1:
        yield flagged("unstable.realization", largest=largest)
    elif largest**samples > DIED_AWAY:
        share = 100 * largest**samples
        yield flagged("not_died_away", largest=largest, share=share, samples=samples)
    negative = poles[(np.abs(poles.imag) < 1e-9) & (poles.real < 0)].real
    if negative.size:
        yield flagged("negative_pole", pole=negative.min())
    last, following = float(model.singular_values[order - 1]), model.following
    if following >= NO_GAP * last:
        yield flagged("no_gap", order=order, next=order + 1, last=last, following=following)
