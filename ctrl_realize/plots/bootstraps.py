"""Plot of a bootstrap: what the models of all draws have in common."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..identification.bootstrap import Bootstrap
from . import style
from .scales import time_unit


def bootstrap_plot(
    result: Bootstrap,
    *,
    ax: style.AxesLike = None,
    samples: int | None = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the dead times of all draws and the band of their unit step responses.

    Parameters
    ----------
    result : Bootstrap
    ax : sequence of two Axes, or Figure, optional
    samples : int, optional
        Length of the step responses; default: until the model has settled.
    title : str, optional
    **kwargs
        Line properties of the step response of the data's own model.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> from functools import partial
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> t = 0.01 * np.arange(300)
    >>> u = np.where(t < 0.5, 0.0, 2.0)
    >>> y = np.where(t < 0.625, 0.0, 6 * -np.expm1(-(t - 0.625) / 0.4))
    >>> record = cr.Record(t, u, y + 0.01 * np.random.default_rng(1).standard_normal(t.size))
    >>> again = cr.bootstrap(record, partial(cr.fit_delay, structures=[(1, 1)]), repeats=30)
    >>> cplt = plots.bootstrap_plot(again)
    >>> [axes.get_xlabel() for axes in cplt.figure.axes]
    ['time [s]', 'dead time [ms]']
    """
    count = _settled(result) if samples is None else samples
    low, high = result.step_band(count)
    own = np.cumsum(np.ravel(result.system.markov(count)))
    dt = float(result.system.dt)
    with style.canvas(ax, 2, title=title, size=(8.0, 6.0), sharex=False) as (upper, lower):
        factor, unit = time_unit(count * dt, upper)
        time = factor * dt * np.arange(count)
        upper.fill_between(time, low, high, color=style.BAND, alpha=0.4, label="95 % of the draws")
        looks = {"color": style.MODEL, "label": "model of the data", **kwargs}
        lines = upper.plot(time, own, **looks)
        upper.set_xlabel(f"time [{unit}]")
        upper.set_ylabel("unit step\nresponse")
        factor, unit = time_unit(float(result.dead_times.max()), lower)
        lower.hist(factor * result.dead_times, bins="auto", color=style.MEASURED, alpha=0.6)
        for limit in result.interval:
            lower.axvline(factor * limit, color=style.INK, linewidth=1.0)
        lower.set_xlabel(f"dead time [{unit}]")
        lower.set_ylabel("draws")
        return style.finished([upper, lower], [lines, []], loc="lower right")


def _settled(result: Bootstrap) -> int:
    """Samples until the slowest mode has decayed to 1 %, at most 20 000."""
    slowest = float(np.abs(np.linalg.eigvals(result.system.delay_free.A)).max())
    lasting = np.log(0.01) / np.log(min(max(slowest, 1e-6), 0.9998))
    return int(np.clip(result.system.delay + lasting, 10, 20_000))
