"""Checks and default sizes for realization and delay scan."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integer
from ..._flags import Flag, flagged
from ..._wording import in_time
from ...data import ImpulseResponse
from ...errors import DataError, DelayRangeError, OptionError, OrderError
from ...numerics.arrays import FloatArray
from ...numerics.hankel.delay_models import hankel_size
from ...numerics.hankel.lanczos import largest_magnitude

SETTLING_BAND = 0.02
"""Distance from the final value, relative to the range, within which a step response is settled."""

MIN_NOISE = 32
"""Least number of baseline samples for an estimate of the noise."""

MOST_WORK = 30_000_000
"""Largest automatic product of delays and samples of a scan; it takes twenty seconds to a
minute."""

MAX_WINDOWS = 16
"""Windows of a long baseline that are used, evenly spaced."""


def as_impulse(impulse: ImpulseResponse | ArrayLike, dt: float | None) -> ImpulseResponse:
    """Return an impulse response unchanged, or make one from an array and a sample time."""
    if isinstance(impulse, ImpulseResponse):
        if dt is not None and dt != impulse.dt:
            raise OptionError(f"dt={dt!r}, the impulse response has dt={impulse.dt:g}; omit dt")
        return impulse
    if dt is None:
        raise OptionError(
            f"impulse is a {type(impulse).__name__}; give its sample time dt=, "
            "or an ImpulseResponse"
        )
    return ImpulseResponse(impulse, dt)


def channels(impulse: ImpulseResponse) -> FloatArray:
    """Return the Markov parameters with shape (p, m, N)."""
    return impulse.markov if impulse.markov.ndim == 3 else impulse.markov[np.newaxis, np.newaxis]


def check_samples(
    impulse: ImpulseResponse, samples: Any, order: int, max_delay: int, *, padded: bool, what: str
) -> int:
    """Return the number of samples after the feedthrough; None: as many as there are.

    `what` is the name of the argument behind `max_delay`.
    """
    available = impulse.n_samples
    if available <= max_delay + 1:
        raise DelayRangeError(
            f"{what}={max_delay} needs more than {max_delay + 1} samples, "
            f"the response has {available}"
        )
    used = available - 1 - max_delay if samples is None else integer(samples, "samples", 2)
    if used + max_delay + 1 > available:
        raise DelayRangeError(
            f"samples={used} and {what}={max_delay} need {used + max_delay + 1} "
            f"samples, the response has {available}"
        )
    largest = hankel_size(used, padded=padded) * min(impulse.ninputs, impulse.noutputs)
    if not 1 <= order <= largest:
        raise OrderError(
            f"order={order}, but a Hankel matrix of {used} samples allows 1 <= order <= {largest}"
        )
    return used


def settled_samples(impulse: ImpulseResponse, order: int, max_delay: int) -> int:
    """Return the default number of samples of a delay scan.

    Three times the settling time of the step response (2 % of its range), at least 256 and 8 per
    order, as far as available. Later samples contain only noise, and cost time for every delay: for
    many delays fewer samples are used, so that a scan takes less than a minute.

    Raises
    ------
    DataError
        Too few samples remain for that many delays.
    """
    fits = impulse.n_samples - 1 - max_delay
    step = np.cumsum(channels(impulse), axis=-1)
    away = np.abs(step - step[..., -1:])
    band = SETTLING_BAND * away.max(axis=-1, keepdims=True)
    settled = int(np.flatnonzero((away > band).any(axis=(0, 1)))[-1:].sum())
    affordable = MOST_WORK // (max_delay + 1)
    if affordable < min(fits, max(3 * max_delay, 256, 8 * order)):
        raise DataError(
            f"a scan of {max_delay + 1} delays over {fits} samples would take hours: the "
            "response is strongly oversampled; decimate the record (after a low-pass "
            "filter), give max_delay= and samples=, or use fit_output_error, which averages "
            "neighbouring samples itself"
        )
    return min(fits, affordable, max(3 * settled, 256, 8 * order))


def noise_floor(impulse: ImpulseResponse, size: int) -> float | None:
    """Return the largest singular value of a Hankel matrix of pure noise.

    Parameters
    ----------
    impulse : ImpulseResponse
        Its `noise`, cut into windows, fills Hankel matrices of the same size.
    size : int
        Rows of the Hankel matrix of the data.

    Returns
    -------
    float or None
        The largest over windows that overlap by half; for filtered noise it varies by a third
        between windows. If the noise is shorter than a window, it is scaled by the square root of
        the size, as for white noise. None if fewer than 32 baseline samples are known.
    """
    noise = impulse.noise
    if noise is None or impulse.markov.ndim == 3 or noise.size < MIN_NOISE:
        return None
    rows = min(size, (noise.size + 1) // 2)
    starts = np.arange(0, noise.size - (2 * rows - 1) + 1, max(1, rows // 2))
    chosen = starts[np.linspace(0, starts.size - 1, min(starts.size, MAX_WINDOWS)).astype(np.intp)]
    windows = np.lib.stride_tricks.sliding_window_view(noise, 2 * rows - 1)[chosen]
    return float(largest_magnitude(windows, rows).max() * np.sqrt(size / rows))


def filter_flags(impulse: ImpulseResponse) -> tuple[Flag, ...]:
    """Flag a causal filter that the data contain, with its delay."""
    still = impulse.filter
    if still is None or still.zero_phase:
        return ()
    late = still.group_delay
    return (flagged("filter_delay", filter=still, samples=late, time=in_time(late * impulse.dt)),)
