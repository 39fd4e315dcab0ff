"""Plots of impulse responses, measured, estimated and of models, and of the step response."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import control as ct
import numpy as np

from .._checks import check_type, positive
from ..data import ImpulseResponse
from ..data.impulse_estimate import ImpulseEstimate
from ..delayed import DelayedStateSpace
from ..errors import DataError
from ..identification.realization.mimo import MimoRealization
from ..numerics.arrays import FloatArray
from . import style
from .delays import mark_dead_time
from .names import plain
from .records import draw_signals
from .shared_docs import documented
from .style import axis_time_unit


@documented("Axes, array of Axes (outputs x inputs)")
def impulse_plot(
    impulse: ImpulseResponse,
    systems: DelayedStateSpace | Sequence[DelayedStateSpace] = (),
    *,
    ax: style.AxesLike = None,
    until: float | None = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw a measured impulse response and those of models (figure 7).

    The responses are drawn as densities, to an impulse of unit area.

    Parameters
    ----------
    impulse : ImpulseResponse
    systems : DelayedStateSpace or sequence of them, optional
        Models, drawn dashed.
    until : float, optional
        Last time to show, in s. Default: when the response has decayed.
    **kwargs
        Line properties of the measured response.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cplt = cr.plots.impulse_plot(cr.ImpulseResponse([0.0, 0.5, 0.25, 0.125], dt=0.1))
    >>> cplt.axes[0, 0].get_ylabel()
    'impulse response [1/s]'
    """
    check_type(
        impulse, ImpulseResponse, "impulse", "an ImpulseResponse, followed by the models. To plot "
        "the response of a model alone use control.impulse_response(...).plot()",
    )  # fmt: skip
    models: list[DelayedStateSpace]
    models = [systems] if isinstance(systems, DelayedStateSpace) else list(systems)
    for model in models:
        if (model.noutputs, model.ninputs) != (impulse.noutputs, impulse.ninputs):
            raise DataError(
                f"the model has {model.noutputs} x {model.ninputs} channels, the impulse "
                f"response {impulse.noutputs} x {impulse.ninputs}"
            )
    rows, columns = impulse.noutputs, impulse.ninputs
    size = (8.0, 4.6) if rows * columns == 1 else (4.0 * columns + 1, 2.6 * rows + 1)
    density = impulse.density.reshape(rows * columns, -1)
    last = _settled(density) if until is None else int(until / impulse.dt) + 1
    count = min(max(last, 8), impulse.n_samples)
    with style.canvas(
        ax, rows, columns=columns, size=size, title=title, default_title=impulse.name
    ) as axes:
        factor, unit = axis_time_unit(count * impulse.dt, axes[-1])
        lines = []
        for index, (one, values) in enumerate(zip(axes, density, strict=True)):
            looks = {"color": style.MEASURED, "linewidth": 1.5, "label": "measured", **kwargs}
            drawn = one.plot(factor * impulse.time[:count], values[:count], **looks)
            for number, model in enumerate(models):
                samples = max(int(np.ceil(count * impulse.dt / model.dt)), 2)
                markov = np.reshape(model.markov(samples), (-1, samples))[index]
                label = "model" if len(models) == 1 else plain(model.name)
                time, looks = factor * model.dt * np.arange(samples), style.model_looks(number)
                drawn += one.plot(time, markov / model.dt, label=label, **looks)
            lines.append(drawn)
            if rows * columns > 1:
                way = f"input {index % columns} to output {index // columns}"
                one.set_title(way, loc="right", fontsize=11)
            if index >= (rows - 1) * columns:
                one.set_xlabel(f"time [{unit}]")
            if index % columns == 0:
                one.set_ylabel("impulse response [1/s]")
        if impulse.filter is not None:
            axes[-1].set_xlabel(f"time [{unit}]\n(in the data: {impulse.filter})")
        return style.finished(axes, lines, columns=columns)


@documented("array of Axes (outputs x inputs)")
def mimo_realization_plot(
    fit: MimoRealization, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the responses of all channels, with their delays.

    Parameters
    ----------
    fit : MimoRealization
    **kwargs
        Passed on to `impulse_plot`.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[0.0, 0.8 ** np.arange(80)]
    >>> late = [np.r_[np.zeros(d), pulse][:60] for d in (3, 7)]
    >>> system = cr.identification.realize_mimo(np.array(late)[:, None, :], 1, dt=0.1)
    >>> cplt = cr.plots.mimo_realization_plot(system.fit)
    >>> [axes.get_title(loc="right") for axes in cplt.figure.axes]
    ['input 0 to output 0', 'input 0 to output 1']
    """
    drawn = impulse_plot(fit.impulse, ax=ax, title=title, **kwargs)
    factor, _ = axis_time_unit(1.0, drawn.axes[-1, 0])
    for place, axes in np.ndenumerate(drawn.axes):
        if fit.delays[place] >= 0:
            end = factor * fit.delays[place] * fit.impulse.dt
            axes.axvline(end, color=style.TRUTH, linestyle=":")
    return drawn


@documented()
def impulse_estimate_plot(estimate: ImpulseEstimate, *args: Any, **kwargs: Any) -> ct.ControlPlot:
    """Draw an estimated impulse response with its band of two standard deviations.

    Parameters
    ----------
    estimate : ImpulseEstimate
    *args, **kwargs
        As for `impulse_plot`.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 2000))
    >>> y = 3.0 * np.roll(u, 5) + 0.1 * noise
    >>> estimate = cr.impulse_from_io(cr.Record(0.01 * np.arange(2000), u, y), 20)
    >>> cplt = cr.plots.impulse_estimate_plot(estimate)
    >>> cplt.figure.axes[0].get_ylabel()
    'impulse response [1/s]'
    """
    drawn = impulse_plot(estimate, *args, **kwargs)
    factor, _ = axis_time_unit(1.0, drawn.axes[-1, 0])
    time = factor * estimate.time
    density = estimate.density.reshape(*drawn.axes.shape, -1)
    spread = 2 * (estimate.std / estimate.dt).reshape(density.shape)
    for place, axes in np.ndenumerate(drawn.axes):
        window, middle, wide = axes.get_xlim(), density[place], spread[place]
        axes.fill_between(
            time, middle - wide, middle + wide, color=style.BAND, alpha=0.3, linewidth=0
        )
        axes.set_xlim(window)
    return drawn


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

    The responses of every output to a step of every input are drawn. The cost does not depend on
    the delay.

    Parameters
    ----------
    system : DelayedStateSpace
    until : float, optional
        End of the plot in s; default: when the response has settled, as in `step_response` of
        `system`.
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
    check_type(system, DelayedStateSpace, "system", "a DelayedStateSpace")
    if until is None:
        end = float(np.ravel(system.step_response().time)[-1])
    else:
        end = positive(until, "until", "time in s")
    count = max(int(np.ceil(end / system.dt)) + 1, 2)
    response = np.reshape(system.step(count), (-1, count))
    with style.canvas(ax, title=title, default_title=str(system.name)) as (axes,):
        factor, unit = axis_time_unit(end, axes)
        time = factor * system.dt * np.arange(count)
        channels = product(system.output_labels, system.input_labels)
        names = [f"{output} after {input}" for output, input in channels]
        looks = {"linewidth": 2.0, "first": style.MODEL, **kwargs}
        lines = draw_signals(axes, time, response, ["model"] if system.issiso() else names, **looks)
        if system.issiso():
            mark_dead_time(axes, system, factor)
        axes.set(xlabel=f"time after the step [{unit}]", ylabel="unit step response")
        return style.finished([axes], [lines], loc="lower right")


def _settled(density: FloatArray) -> int:
    """Find the time after which 95 % of the area has passed, plus a third."""
    area = np.cumsum(np.abs(density).sum(axis=0))
    if area[-1] <= 0:
        return int(density.shape[1])
    enough = int(np.searchsorted(area, 0.95 * float(area[-1])))
    return int(1.33 * enough) + 1
