"""Plot of a delay that was seen in several ways."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from matplotlib.lines import Line2D

from ..identification.delay_check import DelayCheck
from ..wording import time_unit
from . import style


def delay_check_plot(
    check: DelayCheck, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the intervals of a delay that was seen in several ways, and what they agree on.

    Parameters
    ----------
    check : DelayCheck
    ax : Axes or Figure, optional
    title : str, optional
    **kwargs
        Line properties of the intervals.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.delayed_ss(ct.tf([2.0], [0.3, 1]), dead_time=0.125, dt=0.01)
    >>> rng = np.random.default_rng(0)
    >>> u = np.repeat(rng.choice([-1.0, 1.0], 60), 15)
    >>> y = plant.simulate(u) + 0.05 * rng.standard_normal(u.size)
    >>> check = cr.check_delay(cr.Record(0.01 * np.arange(u.size), u, y), order=1)
    >>> cplt = plots.delay_check_plot(check)
    >>> cplt.figure.axes[0].get_xlabel()
    'dead time, or bound ◂ [ms]'
    """
    size = (8.0, 1.6 + 0.5 * len(check.views))
    factor, unit = time_unit(max(view.high for view in check.views))
    with style.canvas(ax, title=title, size=size) as (axes,):
        lines: list[Line2D] = []
        for place, view in enumerate(reversed(check.views)):
            bound = view.kind == "upper bound"
            looks = {"color": style.NOISE if bound else style.MODEL, "linewidth": 3.0, **kwargs}
            if view.doubt:  # it does not count
                looks = {**looks, "alpha": 0.35}
            lines += axes.plot(factor * np.array([view.low, view.high]), [place, place], **looks)
            mark = "<" if bound else "o"
            points = {"color": looks["color"], "alpha": looks.get("alpha"), "markersize": 8}
            axes.plot(factor * view.value, place, mark, **points)
        if check.common is not None:
            low, high = (factor * edge for edge in check.common)
            axes.axvspan(low, high, color=style.BAND, alpha=0.3, label="all agree", linewidth=0)
        names = [
            f"{view.method}\n({view.source}{', in doubt' if view.doubt else ''})"
            for view in reversed(check.views)
        ]
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(-0.6, len(names) - 0.4)
        axes.set_xlabel(f"dead time, or bound ◂ [{unit}]")
        return style.finished([axes], [lines], loc="above")
