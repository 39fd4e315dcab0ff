"""Kung's realization of an impulse response behind a known delay."""

from __future__ import annotations

from dataclasses import dataclass, field

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..checks import one_of, whole
from ..delayed import DelayedStateSpace
from ..errors import OrderError
from ..numerics import state_space
from ..numerics.arrays import FloatArray, read_only
from ..numerics.delay_models import OneModel, hankel_size, realize_at
from ..results import Flag, Result
from ..signals import ImpulseResponse
from ..wording import in_time
from .impulses import as_impulse, channels, check_samples, filter_flags

HANKEL = ("square", "padded")

NO_GAP = 0.8
"""Ratio of neighbouring singular values from which there is no gap between them."""

DIED_AWAY = 0.2
"""Part of a response that may be left at the end of the data."""


@dataclass(frozen=True, eq=False)
class Realization(Result):
    """How a model was realized from an impulse response.

    ``iae`` is the sum of ``|impulse.markov[k] - sys.markov(n)[k]|`` over the
    ``n = delay + samples + 1`` samples that the model has seen, all channels
    together.

    Attributes
    ----------
    order : int
        States of the core.
    delay : int
        Delay in samples that was taken out of the data.
    samples : int
        Markov parameters behind the feedthrough that were used,
        ``delay + 1 ... delay + samples``.
    hankel : {"square", "padded"}
    feedthrough : bool
        Whether the direct term is G[delay]; else it is 0.
    singular_values : ndarray, shape (q,), q >= order
        Leading singular values of the Hankel matrix: all of them where it is
        small, else the `order` ones that the model is made of.
        `leading_singular_values` computes more.
    following : float
        Singular value ``order + 1``, the first that was left out; beyond a
        Hankel matrix of 200 rows an estimate from below.
    error_bound : float or None
        For the padded Hankel matrix: no frequency has a larger error (2-norm)
        against the data's own response, ``sum G[k] z^-k`` over the samples
        used. Twice the sum of the singular values that were left out; where
        they are not all known, its largest value that their sum of squares
        allows. None for the square one, for which no bound is known.
    iae : float
        Integrated absolute error, in the unit of the output per input.
    impulse : ImpulseResponse
        The data.
    flags : tuple of Flag
        ``"unstable"``, ``"not_died_away"``, ``"negative_pole"``, ``"no_gap"``,
        ``"filter_delay"``.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[0.0, 0.9 ** np.arange(99) + 0.01 * (-0.5) ** np.arange(99)]
    >>> found = cr.realize(pulse, 1, dt=0.1).fit
    >>> print(found.singular_values[:1].round(2), round(found.following, 4), round(found.iae, 3))
    [5.26] 0.0124 0.029
    """

    order: int
    delay: int
    samples: int
    hankel: str
    feedthrough: bool
    singular_values: FloatArray
    following: float
    error_bound: float | None
    iae: float
    impulse: ImpulseResponse = field(repr=False)
    flags: tuple[Flag, ...] = ()

    @property
    def dt(self) -> float:
        """Sample time in s."""
        return self.impulse.dt

    def leading_singular_values(self, count: int = 30) -> FloatArray:
        """Compute the first singular values of the Hankel matrix, as in the paper's Fig. 5.

        Returns
        -------
        ndarray, shape (count,), or fewer where the matrix is smaller
        """
        count = whole(count, "count", 1)
        padded = self.hankel == "padded"
        size = hankel_size(self.samples, padded=padded)
        count = min(count, size * min(self.impulse.n_inputs, self.impulse.n_outputs))
        if count <= self.singular_values.size:
            return self.singular_values[:count]
        markov = channels(self.impulse)
        model = realize_at(markov, self.delay, self.samples, count, padded=padded)
        return read_only(model.singular_values[:count])

    def _title(self) -> str:
        return f"Realization of order {self.order} behind {self.delay} samples"

    def _rows(self) -> list[tuple[str, str]]:
        values = ", ".join(f"{value:.4g}" for value in self.singular_values[: self.order])
        in_samples = f"({self.delay} samples of {in_time(self.dt, 6)})"
        rows = [
            ("dead time", f"{in_time(self.delay * self.dt, 5)} {in_samples}"),
            ("Hankel matrix", f"{self.hankel}, {self.samples} samples"),
            ("direct term", f"G[{self.delay}]" if self.feedthrough else "0"),
            ("singular values", f"{values} (next {self.following:.4g})"),
            ("sum of |error|", f"{self.iae:.4g}"),
        ]
        if self.error_bound is not None:
            rows.append(("error bound", f"{self.error_bound:.4g} at any frequency"))
        return rows

    def __repr__(self) -> str:
        flags = f", {len(self.flags)} flags" if self.flags else ""
        return (
            f"<Realization: order {self.order} behind {self.delay} samples, "
            f"IAE {self.iae:.4g}{flags}>"
        )


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

    Kung's algorithm on G[delay], G[delay + 1], ...; the delay itself is
    joined to the model unchanged.

    Parameters
    ----------
    impulse : ImpulseResponse, or array_like of shape (N,) or (p, m, N)
        Markov parameters (response to a unit pulse). An array needs `dt`.
    order : int
        States of the model without its delay.
    delay : int, optional
        Delay of all channels in samples.
    samples : int, optional
        Markov parameters behind ``G[delay]`` to use; default all.
    feedthrough : bool, optional
        True: the direct term is ``D = G[delay]`` as measured (the paper).
        False: ``D = 0``, the model is strictly proper. Default: as measured,
        unless the noise of the data is known and ``G[delay]`` is within three
        standard deviations of it; exact data of proper and strictly proper
        plants both come out exact.
    hankel : {"square", "padded"}, optional
        The paper's square Hankel matrix of samples // 2 rows, or Kung's
        zero-padded one, whose models are stable by construction and have an
        error bound; it needs data that have decayed within `samples`.
    dt : float, optional
        Sample time in s, where `impulse` is an array.

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
    Step (5) of the paper [1]_ is used with its misprints corrected:
    ``H_a = T(2:r+1, 1:r)``, ``H_b = T(1:r, 1)``, ``H_c = T(1, 1:r)`` and
    ``V`` without the transposes. The decomposition is truncated and
    matrix-free, with time and memory proportional to the data.

    References
    ----------
    .. [1] van Helvoirt et al., Approximate realization of valve dynamics with
       time delay, IFAC 2005, section 2.1.

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
    order = whole(order, "order", 1)
    delay = whole(delay, "delay", 0)
    padded = one_of(hankel, "hankel", HANKEL) == "padded"
    samples = check_samples(data, samples, order, delay, padded=padded, what="delay")
    markov = channels(data)
    model = realize_at(markov, delay, samples, order, padded=padded)
    rank = int(np.count_nonzero(model.singular_values[:order]))
    if rank < order:
        raise OrderError(
            f"order={order}, but the data behind {delay} samples have the numerical rank {rank}; "
            + (f"use an order of at most {rank}" if rank else "they are zero: a pure gain")
        )
    direct = uses_feedthrough(data, delay, feedthrough)
    D = markov[:, :, delay] if direct else np.zeros(markov.shape[:2])
    window = markov[:, :, : delay + samples + 1]
    response = np.zeros_like(window)
    with np.errstate(over="ignore", invalid="ignore"):
        response[:, :, delay:] = state_space.markov(model.A, model.B, model.C, D, samples + 1)
        iae = float(np.abs(window - response).sum())
    fit = Realization(
        order=order,
        delay=delay,
        samples=samples,
        hankel=hankel,
        feedthrough=direct,
        singular_values=read_only(model.singular_values),
        following=model.following,
        error_bound=model.rest_bound if padded else None,
        iae=iae if np.isfinite(iae) else np.inf,
        impulse=data,
        flags=filter_flags(data) + _pole_flags(model.A, samples) + _gap_flags(model, order),
    )
    core = ct.ss(model.A, model.B, model.C, D, data.dt)
    return DelayedStateSpace(core, delay, fit=fit)


def uses_feedthrough(impulse: ImpulseResponse, delay: int, feedthrough: bool | None) -> bool:
    """Decide whether the direct term is what was measured at the delay."""
    if feedthrough is not None:
        return bool(feedthrough)
    noise = impulse.noise
    if noise is None or noise.size < 2 or impulse.markov.ndim == 3:
        return True
    return bool(abs(impulse.markov[delay]) > 3 * np.std(noise, ddof=1))


def _pole_flags(A: FloatArray, samples: int) -> tuple[Flag, ...]:
    poles = np.linalg.eigvals(A)
    flags = []
    largest = float(np.abs(poles).max())
    if largest >= 1:
        flags.append(
            Flag(
                "unstable",
                f"the largest pole has magnitude {largest:.5f}: an integrating plant, noise, or "
                "an order that is too high; hankel='padded' is stable by construction",
            )
        )
    elif largest**samples > DIED_AWAY:
        flags.append(
            Flag(
                "not_died_away",
                f"the largest pole has magnitude {largest:.5f} and keeps "
                f"{100 * largest**samples:.0f} % of its response at the end of the {samples} "
                "samples: an integrating plant, or data that end too early to know the gain",
            )
        )
    negative = poles[(np.abs(poles.imag) < 1e-9) & (poles.real < 0)].real
    if negative.size:
        flags.append(
            Flag(
                "negative_pole",
                f"there is a pole at z = {negative.min():.4f}, which no sampled lag has: "
                "the order is probably too high",
            )
        )
    return tuple(flags)


def _gap_flags(model: OneModel, order: int) -> tuple[Flag, ...]:
    last = float(model.singular_values[order - 1])
    if model.following < NO_GAP * last:
        return ()
    return (
        Flag(
            "no_gap",
            f"singular values {order} and {order + 1} are {last:.4g} and {model.following:.4g}: "
            "without a gap between them the order is not visible in the data",
        ),
    )
