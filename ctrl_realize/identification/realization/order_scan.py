"""IAE as a function of order and delay, from one decomposition for each delay."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integer, integers
from ...data import ImpulseResponse
from ...delayed import DelayedStateSpace
from ...errors import OptionError
from ...numerics.arrays import FloatArray, read_only
from ...numerics.blas_threads import single_threaded
from ...results import Flag, Result
from .delay_scan import best_of
from .impulses import filter_flags
from .order import suggest_order
from .scan_curve import scan_curve, scan_flags
from .scan_surface import Surface, scan_surface

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class OrderScan(Result):
    """IAE of the best models over order and delay.

    ``iae[i, d]`` is the integrated absolute error of order ``orders[i]`` with a delay of d samples,
    as in `DelayScan.iae`; ``delays[i]`` is the best delay of that order, ``delay_intervals[i]``
    contains those within 5 % of its IAE.

    Attributes
    ----------
    orders : tuple of int
    iae : ndarray, shape (orders, max_delay + 1)
        An order above the numerical rank has the IAE of the rank.
    delays : tuple of int
        Best delay of each order, in samples.
    delay_intervals : tuple of (int, int)
        Delays of each order within 5 % of its smallest IAE, in samples.
    singular_values : ndarray, shape (max_delay + 1, max(orders))
        Of the Hankel matrix for each delay.
    noise_floor : float or None
        Largest singular value of pure noise; None if it is not known.
    order : int
        Suggested order. With known noise: singular values up to it are above 1.3 times the noise
        floor at the order's own delay, and it lowers the IAE by more than a factor of 1.3 compared
        with one order less (4 compared with two). With known standard deviations, as from
        `impulse_from_io`: the smallest one whose IAE is below their sum, or a larger one that
        lowers it by more than a factor of 3. Otherwise: the smallest one whose IAE is within 10 %
        of the smallest.
    samples : int
        Markov parameters after each delay used.
    impulse : ImpulseResponse
    flags : tuple of Flag
        For the suggested order.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> k = np.arange(300)
    >>> pulse = np.r_[np.zeros(22), 0.9**k + 0.8**k]     # 21 samples, then two lags
    >>> scan = cr.scan_orders(pulse, 3, max_delay=40, dt=0.01)
    >>> for order, delay, iae in zip(scan.orders, scan.delays, scan.iae):
    ...     print(order, delay, round(float(iae[delay]), 3))
    1 22 0.691
    2 21 0.0
    3 20 0.0
    """

    orders: tuple[int, ...]
    iae: FloatArray
    delays: tuple[int, ...]
    delay_intervals: tuple[tuple[int, int], ...]
    singular_values: FloatArray
    noise_floor: float | None
    order: int
    samples: int
    impulse: ImpulseResponse = field(repr=False)
    _surface: Surface = field(repr=False)
    flags: tuple[Flag, ...] = ()

    @property
    def dt(self) -> float:
        """Sample time in s."""
        return self.impulse.dt

    @property
    def max_delay(self) -> int:
        """Largest delay that was tried, in samples."""
        return int(self.iae.shape[1] - 1)

    @property
    def delay(self) -> int:
        """Best delay of the suggested order, in samples."""
        return self.delays[self.orders.index(self.order)]

    def system(self, order: int | None = None) -> DelayedStateSpace:
        """Return the result of `estimate_delay` for an order, without another decomposition.

        Parameters
        ----------
        order : int, optional
            One of `orders`; default: the suggested one.

        Returns
        -------
        DelayedStateSpace
            Its `fit` is a `DelayScan`.
        """
        chosen = self.order if order is None else integer(order, "order", 1)
        if chosen not in self.orders:
            raise OptionError(f"order={chosen} was not scanned; choose one of {self.orders}")
        return best_of(self._surface, chosen)

    def last_singular_value(self, order: int) -> float:
        """Return singular value `order` at the best delay of that order."""
        return float(self.singular_values[self.delays[self.orders.index(order)], order - 1])

    def table(self) -> pd.DataFrame:
        """Return one row for each order.

        Returns
        -------
        pandas.DataFrame
            Index ``order``; columns ``delay`` and its 5 % interval
            ``delay_low``, ``delay_high`` in samples, ``dead_time`` in s, ``iae``, ``contrast``,
            ``singular_value``, ``noise_ratio``, ``suggested``.
        """
        import pandas as pd

        rows = []
        for i, order in enumerate(self.orders):
            least = float(self.iae[i, self.delays[i]])
            value = self.last_singular_value(order)
            rows.append(
                {
                    "order": order,
                    "delay": self.delays[i],
                    "delay_low": self.delay_intervals[i][0],
                    "delay_high": self.delay_intervals[i][1],
                    "dead_time": self.delays[i] * self.dt,
                    "iae": least,
                    "contrast": float(self.iae[i, 0]) / least if least > 0 else np.inf,
                    "singular_value": value,
                    "noise_ratio": value / self.noise_floor if self.noise_floor else np.nan,
                    "suggested": order == self.order,
                }
            )
        return pd.DataFrame(rows).set_index("order")

    def _title(self) -> str:
        return f"Order scan: suggested order {self.order}, delay {self.delay} samples"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for i, order in enumerate(self.orders):
            low, high = self.delay_intervals[i]
            value = self.last_singular_value(order)
            noise = f", {value / self.noise_floor:.2f} x noise" if self.noise_floor else ""
            found = f"delay {self.delays[i]} ({low}...{high}) samples"
            found += f", IAE {self.iae[i, self.delays[i]]:.4g}, singular value {value:.4g}{noise}"
            rows.append((f"order {order}", found))
        return rows

    def __repr__(self) -> str:
        return (
            f"<OrderScan: orders {self.orders[0]}...{self.orders[-1]}, "
            f"d = 0...{self.max_delay}, suggested {self.order}>"
        )


@single_threaded
def scan_orders(
    impulse: ImpulseResponse | ArrayLike,
    orders: int | Iterable[int] = 8,
    *,
    max_delay: int,
    samples: int | None = None,
    feedthrough: bool | None = None,
    hankel: str = "square",
    dt: float | None = None,
) -> OrderScan:
    """Compute the IAE for all orders and delays, and suggest an order.

    The models of all orders are leading parts of one decomposition for each delay, so the scan
    costs little more than its highest order.

    Parameters
    ----------
    impulse : ImpulseResponse, or array_like of shape (N,) or (p, m, N)
        Markov parameters. An array needs `dt`.
    orders : int or iterable of int, optional
        Orders to try; a number n stands for 1...n.
    max_delay, samples, feedthrough, hankel, dt
        As for `estimate_delay`.

    Returns
    -------
    OrderScan

    Raises
    ------
    OrderError, DelayRangeError, OptionError, DataError
        As for `estimate_delay`.

    Notes
    -----
    Kung's models of lower order are leading parts of those of higher order [1]_: they use the first
    of the same singular vectors.

    References
    ----------
    .. [1] S. Y. Kung, A new identification and model reduction algorithm via singular value
       decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> k = np.arange(300)
    >>> pulse = np.r_[np.zeros(22), 0.9**k + 0.8**k]   # 21 samples, then two lags
    >>> scan = cr.scan_orders(pulse, 4, max_delay=40, dt=0.01)
    >>> scan.order, scan.delay
    (2, 21)
    """
    every = orders if isinstance(orders, Iterable) else range(1, integer(orders, "orders", 1) + 1)
    tried = integers(every, "orders", 1)
    surface = scan_surface(impulse, tried, max_delay, samples, feedthrough, hankel, dt)
    curves = [scan_curve(surface, order) for order in surface.orders]
    delays = tuple(delay for _, delay, _ in curves)
    last = surface.singular_values[list(delays), np.array(surface.orders) - 1]
    chosen = suggest_order(surface, last)
    return OrderScan(
        orders=surface.orders,
        iae=read_only(surface.iae),
        delays=delays,
        delay_intervals=tuple(flat for *_, flat in curves),
        singular_values=read_only(surface.singular_values),
        noise_floor=surface.noise_floor,
        order=chosen,
        samples=surface.samples,
        impulse=surface.impulse,
        flags=(*scan_flags(surface, chosen), *filter_flags(surface.impulse)),
        _surface=surface,
    )
