"""Common parts of delay scan and order scan: models and IAE for all orders and delays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integer, one_of
from ...data import ImpulseResponse
from ...numerics.arrays import FloatArray
from ...numerics.hankel.delay_models import hankel_size, iae_of_models, realize_at_delays
from .impulses import as_impulse, channels, check_samples, noise_floor, settled_samples
from .realize import HANKEL


@dataclass(frozen=True, eq=False)
class Surface:
    """IAE of each order over the delay, and the singular values for every delay.

    ``iae[i]`` belongs to ``orders[i]``; `feedthrough` and `hankel` are as requested.
    """

    impulse: ImpulseResponse
    orders: tuple[int, ...]
    samples: int
    feedthrough: bool | None
    hankel: str
    singular_values: FloatArray
    iae: FloatArray
    noise_floor: float | None

    @property
    def rounding(self) -> float:
        """Differences of the IAE up to which delays are equally good."""
        return 1e-11 * float(np.abs(channels(self.impulse)[:, :, : self.window]).sum())

    @property
    def window(self) -> int:
        """Number of samples of the IAE."""
        return int(self.samples + self.iae.shape[1])


def scan_surface(
    impulse: ImpulseResponse | ArrayLike,
    orders: Sequence[int],
    max_delay: Any,
    samples: Any,
    feedthrough: bool | None,
    hankel: str,
    dt: float | None,
) -> Surface:
    """Check the arguments, decompose for every delay, and compute all IAEs over one window."""
    data = as_impulse(impulse, dt)
    max_delay = integer(max_delay, "max_delay", 0)
    hankel = one_of(hankel, "hankel", HANKEL)
    padded = hankel == "padded"
    highest = max(orders)
    check_samples(data, samples, highest, max_delay, padded=padded, what="max_delay")
    if samples is None:
        samples = settled_samples(data, highest, max_delay)
    markov = channels(data)[:, :, : samples + max_delay + 1]
    delays = np.arange(max_delay + 1)
    direct = markov[:, :, delays].transpose(2, 0, 1)
    if feedthrough is False:
        direct = np.zeros_like(direct)
    models = realize_at_delays(markov, delays, samples, highest, padded=padded)
    return Surface(
        impulse=data,
        orders=tuple(orders),
        samples=samples,
        feedthrough=feedthrough,
        hankel=hankel,
        singular_values=models.singular_values,
        iae=np.stack([iae_of_models(markov, delays, models, order, direct) for order in orders]),
        noise_floor=noise_floor(data, hankel_size(samples, padded=padded)),
    )
