"""Plot of a system with dead time by itself: its step response."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from .._checks import positive
from ..delayed import DelayedStateSpace
from ..errors import DataError
from . import style
from .delays import mark_dead_time
from .names import plain
from .shared_docs import documented
from .style import axis_time_unit


@documented()
def system_plot(
    system: DelayedStateSpace,
    *,
    until: float | None = None,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the response of a system to a unit step, with its dead time.

    Every output answers a step of every input by itself. The cost does not grow with the delay.

    Parameters
    ----------
    system : DelayedStateSpace
    until : float, optional
        End of the plot in s; default: when the response has settled, as `control.step_response`
        chooses it for the core, after the longest dead time.
    **kwargs
        Line properties.

    Raises
    ------
    DataError
        `system` is not a `DelayedStateSpace`.
    OptionError
        `until` is not a positive time.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> cplt = cr.DelayedStateSpace(core, 37).plot(until=1.0)
    >>> cplt.axes[0, 0].get_xlabel()
    'time after the step [s]'
    """
    if not isinstance(system, DelayedStateSpace):
        raise DataError(f"got a {type(system).__name__}; expected a DelayedStateSpace")
    end = _settled(system) if until is None else positive(until, "until", "time in s")
    count = max(int(np.ceil(end / system.dt)) + 1, 2)
    response = system.step(count).reshape(system.noutputs, system.ninputs, count)
    with style.canvas(ax, title=title, default_title=str(system.name)) as (axes,):
        factor, unit = axis_time_unit(end, axes)
        time = factor * system.dt * np.arange(count)
        lines = []
        for i, output in enumerate(system.output_labels):
            for j, input in enumerate(system.input_labels):
                position = i * system.ninputs + j
                first = {"color": style.MODEL} if position == 0 else {}
                looks: dict[str, Any] = {
                    "color": style.OTHERS[(position - 1) % len(style.OTHERS)],
                    "label": "model" if system.issiso() else plain(f"{output} after {input}"),
                    **first,
                    **kwargs,
                }
                lines += axes.plot(time, response[i, j], **looks)
        if system.issiso():
            mark_dead_time(axes, system, factor)
        axes.set(xlabel=f"time after the step [{unit}]", ylabel="unit step response")
        return style.finished([axes], [lines], loc="lower right")


def _settled(system: DelayedStateSpace) -> float:
    longest = max(system.input_delays) + max(system.output_delays)
    core = ct.step_response(system.delay_free)
    return float(np.ravel(core.time)[-1]) + longest * float(system.dt)
