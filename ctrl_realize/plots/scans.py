"""Plots of realizations and delay scans: singular values, IAE over delay."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .._wording import in_time
from ..delayed import DelayedStateSpace
from ..identification.realization.delay_scan_result import DelayScan
from ..identification.realization.order_scan import OrderScan
from ..identification.realization.result import Realization
from ..numerics.arrays import FloatArray
from . import style
from .shared_docs import documented


@documented()
def delay_plot(
    scan: DelayScan | DelayedStateSpace,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the IAE over the delay, its minimum and all delays within 5 % of it (figure 6).

    Parameters
    ----------
    scan : DelayScan, or model with one as its `fit`
    **kwargs
        Line properties of the curve.

    Raises
    ------
    OptionError
        The model was not found by a delay scan.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[np.zeros(38), 0.1 * 0.9 ** np.arange(300)]
    >>> cplt = cr.plots.delay_plot(cr.estimate_delay(pulse, 1, max_delay=60, dt=0.01))
    >>> cplt.axes[0, 0].get_xlabel()
    'delay [samples]'
    """
    advice = "no delay scan; use estimate_delay or identify(record, method='scan')"
    result = style.result_of(scan, DelayScan, advice)
    looks = {"color": style.MODEL, "label": f"order {result.order}", **kwargs}
    low, high = result.delay_interval
    with style.canvas(ax, title=title, default_title=result.impulse.name) as (axes,):
        lines = list(axes.plot(np.arange(result.iae.size), result.iae, **looks))
        axes.plot(
            [result.delay], [result.iae[result.delay]], "o", color=style.MODEL, markersize=8,
            zorder=4, label=f"{result.delay} samples = {in_time(result.delay * result.dt)}",
        )  # fmt: skip
        axes.axvspan(
            low - 0.5, high + 0.5, color=style.BAND, alpha=0.22, linewidth=0,
            label=f"within 5 %: {low}...{high}",
        )  # fmt: skip
        _misfit_axes(axes)
        if result.impulse.filter is not None and result.impulse.filter.group_delay > 0:
            inside = f", {result.impulse.filter.group_delay:.1f} of them from the filter"
            axes.set_xlabel(axes.get_xlabel() + inside)
        return style.finished([axes], [lines], loc="over")


@documented()
def singular_value_plot(
    fit: Realization | DelayScan | OrderScan | DelayedStateSpace,
    *,
    count: int = 30,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the singular values of the Hankel matrix, and the level of pure noise (figure 5).

    Parameters
    ----------
    fit : Realization, DelayScan or OrderScan, or model with one of them as its `fit`
    count : int, optional
        Number of values to show; an `OrderScan` has as many as its highest order.
    **kwargs
        Line properties of the values.

    Raises
    ------
    OptionError
        The model was not found by realization.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> k = np.arange(300)
    >>> pulse = np.r_[np.zeros(22), 0.9**k + 0.8**k]     # 21 samples, then two lags
    >>> cplt = cr.plots.singular_value_plot(cr.realize(pulse, 2, delay=21, dt=0.01), count=5)
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['order 2']
    """
    advice = "no singular values; use the result of realize, estimate_delay or scan_orders"
    result: Any = style.result_of(fit, (DelayScan, Realization, OrderScan), advice)
    if isinstance(result, OrderScan):
        values = result.singular_values[result.delay][:count]
    else:
        found = result.realization if isinstance(result, DelayScan) else result
        values = found.leading_singular_values(count)
    floor = None if isinstance(result, Realization) else result.noise_floor
    with style.canvas(ax, title=title, default_title=result.impulse.name) as (axes,):
        lines = _singular_values_on(axes, values, result.order, floor, **kwargs)
        return style.finished([axes], [lines])


@documented("sequence of two Axes")
def order_plot(
    scan: OrderScan, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the IAE over the delay for every order, and the singular values with the noise level.

    Parameters
    ----------
    scan : OrderScan
    **kwargs
        Line properties of the IAE curves.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> k = np.arange(300)
    >>> pulse = np.r_[np.zeros(22), 0.9**k + 0.8**k]     # 21 samples, then two lags
    >>> cplt = cr.plots.order_plot(cr.scan_orders(pulse, 3, max_delay=40, dt=0.01))
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['order 1: 22', 'order 2: 21', 'order 3: 20']
    """
    with style.canvas(
        ax, 2, title=title, default_title=scan.impulse.name,
        size=(8.0, 7.0), heights=(1.5, 1.0), sharex=False,
    ) as (upper, lower):  # fmt: skip
        misfits = _misfits_of_orders(upper, scan, kwargs)
        values = np.array([scan.last_singular_value(order) for order in scan.orders])
        orders = np.array(scan.orders)
        points = _singular_values_on(lower, values, scan.order, scan.noise_floor, at=orders)
        lower.set_ylabel("singular value\nat the best delay")
        return style.finished([upper, lower], [misfits, points], legends=(1,))


def _misfits_of_orders(axes: Axes, scan: OrderScan, asked: dict[str, Any]) -> list[Line2D]:
    """Draw an IAE curve for each order: higher orders darker, the chosen one in colour."""
    lines: list[Line2D] = []
    for position, (order, iae, delay) in enumerate(
        zip(scan.orders, scan.iae, scan.delays, strict=True)
    ):
        chosen = order == scan.order
        shade = 0.75 - 0.6 * position / max(len(scan.orders) - 1, 1)
        looks = {
            "color": style.MODEL if chosen else (shade, shade, shade),
            "linewidth": 2.6 if chosen else 1.2,
            "label": f"order {order}: {delay}",
            "zorder": 3 if chosen else 2,
            **asked,
        }
        finite = np.where(np.isfinite(iae), iae, np.nan)
        lines += axes.plot(np.arange(iae.size), finite, **looks)
        axes.plot([delay], [iae[delay]], "o", color=looks["color"], zorder=4)
    axes.legend(title="best delay", loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=10)
    _misfit_axes(axes)
    return lines


def _misfit_axes(axes: Axes) -> None:
    axes.set(xlabel="delay [samples]", ylabel="IAE [output / input]")
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _singular_values_on(
    axes: Axes, values: FloatArray, order: int, floor: float | None, at: Any = None, **kwargs: Any
) -> list[Line2D]:
    positions = np.arange(1, values.size + 1) if at is None else at
    positive = np.where(values > 0, values, np.nan)
    looks = {"color": style.MEASURED, "linestyle": "none", "marker": "o", "markersize": 7, **kwargs}
    inside = positions <= order
    lines = list(axes.plot(positions[inside], positive[inside], label=f"order {order}", **looks))
    rest = {**looks, "markerfacecolor": "none"}
    lines += axes.plot(positions[~inside], positive[~inside], **rest)
    if floor is not None and floor > 0:
        axes.axhline(floor, color=style.NOISE, linestyle="--", label="largest of pure noise")
    axes.set(yscale="log", xlabel="number" if at is None else "order", ylabel="singular value")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return lines
