"""Plot of closed loops: how the output follows the set-point and rejects a load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control as ct
import numpy as np

from ..checks import positive
from ..delayed import DelayedStateSpace
from ..design.performance import lasting, loop_time, settled_responses, step_responses
from . import style
from .names import plain
from .scales import time_unit


def closed_loop_plot(
    plant: DelayedStateSpace,
    controllers: Mapping[str, Any],
    *,
    span: float | None = None,
    ax: style.AxesLike = None,
    title: str | None = None,
) -> ct.ControlPlot:
    """Draw the output after a step of set-point and of load for several controllers.

    Parameters
    ----------
    plant : DelayedStateSpace
    controllers : mapping of str to system
        Name -> controller of the plant's sample time; each must make a stable loop.
    span : float, optional
        Time to show in s. Default: a quarter more than all responses take to stay within 2 % of
        where they end.
    ax : sequence of two Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot

    Raises
    ------
    UnsuitableSystemError
        Without `span`, a loop that is not stable.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> loops = {rule: cr.design.pid(plant, rule) for rule in ("simc", "amigo")}
    >>> cplt = plots.closed_loop_plot(plant, loops)
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['output, set-point step', 'output, load step']
    """
    if span is None:
        span = _span(plant, controllers)
    count = int(np.ceil(positive(span, "span", "time in s") / plant.dt)) + 1
    # Twice the span is computed: what wraps around shows at the end.
    length = 2 ** int(np.ceil(np.log2(2 * count)))
    drawn: list[list[Any]] = [[], []]
    with style.canvas(ax, 2, title=title, default_title="Closed loop", size=(8.0, 6.5)) as axes:
        factor, unit = time_unit(span, axes[1])
        time = np.arange(count) * plant.dt * factor
        for number, (name, controller) in enumerate(controllers.items()):
            for where, response in enumerate(step_responses(plant, controller, length)):
                drawn[where] += axes[where].plot(
                    time,
                    response[:count],
                    color=style.model_colour(number),
                    linestyle="-" if number == 0 else style.DASHES[number % len(style.DASHES)],
                    label=plain(name),
                )
        axes[0].axhline(1, color=style.INPUT, linewidth=1)
        axes[1].axhline(0, color=style.INPUT, linewidth=1)
        axes[0].set_ylabel("output, set-point step")
        axes[1].set(ylabel="output, load step", xlabel=f"time [{unit}]")
        # The set-point response ends at 1: the corner below it is free.
        return style.finished(axes, drawn, loc="lower right")


def _span(plant: DelayedStateSpace, controllers: Mapping[str, Any]) -> float:
    """Time in s until the slowest of the loops has settled, and a quarter more."""
    samples = 8
    for name, controller in controllers.items():
        time = loop_time(plant, controller, name)
        setpoint, load, _ = settled_responses(plant, controller, time)
        samples = max(samples, lasting(setpoint, load))
    return 1.25 * samples * float(plant.dt)
