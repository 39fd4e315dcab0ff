"""Plots of impulse responses, measured and of models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..delayed import DelayedStateSpace
from ..errors import DataError
from ..numerics.arrays import FloatArray
from ..signals import ImpulseResponse
from . import style


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
    ax : Axes, array of Axes (outputs x inputs) or Figure, optional
    until : float, optional
        Last time to show, in s. Default: where the response has died away.
    title : str, optional
    **kwargs
        Line properties of the measured response.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> cplt = plots.impulse_plot(cr.ImpulseResponse([0.0, 0.5, 0.25, 0.125], dt=0.1))
    >>> cplt.axes[0, 0].get_ylabel()
    'impulse response [1/s]'
    """
    models = [systems] if isinstance(systems, DelayedStateSpace) else list(systems)
    for model in models:
        if (model.noutputs, model.ninputs) != (impulse.n_outputs, impulse.n_inputs):
            raise DataError(
                f"the model has {model.noutputs} x {model.ninputs} channels, the impulse "
                f"response {impulse.n_outputs} x {impulse.n_inputs}"
            )
    rows, columns = impulse.n_outputs, impulse.n_inputs
    with style.context():
        size = (8.0, 4.6) if rows * columns == 1 else (4.0 * columns + 1, 2.6 * rows + 1)
        axes = style.axes_for(ax, rows, columns=columns, size=size)
        density = impulse.density.reshape(rows * columns, -1)
        last = _settled(density) if until is None else int(until / impulse.dt) + 1
        count = min(max(last, 8), impulse.n_samples)
        factor, unit = style.time_unit(count * impulse.dt, axes[-1])
        lines = []
        for index, (one, values) in enumerate(zip(axes, density, strict=True)):
            drawn = _one(one, impulse, values[:count], factor, **kwargs)
            for number, model in enumerate(models):
                drawn += _model(one, model, index, count * impulse.dt, factor, number, len(models))
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
        name = impulse.name if title is None else title
        return style.finished(
            axes, lines, columns=columns, title=name, own_figure=ax is None, loc="upper right"
        )


def _one(
    axes: Axes, impulse: ImpulseResponse, density: FloatArray, factor: float, **kwargs: Any
) -> list[Line2D]:
    looks = {"color": style.MEASURED, "linewidth": 1.5, "label": "measured", **kwargs}
    return list(axes.plot(factor * impulse.time[: density.size], density, **looks))


def _model(
    axes: Axes,
    model: DelayedStateSpace,
    channel: int,
    until: float,
    factor: float,
    number: int,
    models: int,
) -> list[Line2D]:
    count = max(int(np.ceil(until / model.dt)), 2)
    markov = np.asarray(model.markov(count)).reshape(-1, count)[channel]
    return list(
        axes.plot(
            factor * model.dt * np.arange(count),
            markov / model.dt,
            color=style.model_colour(number),
            linestyle=style.DASHES[number % len(style.DASHES)],
            label="model" if models == 1 else style.plain(model.name),
        )
    )


def _settled(density: FloatArray) -> int:
    """Find the time in which 95 % of the area has passed, and add a third."""
    area = np.cumsum(np.abs(density).sum(axis=0))
    if area[-1] <= 0:
        return int(density.shape[1])
    enough = int(np.searchsorted(area, 0.95 * float(area[-1])))
    return int(1.33 * enough) + 1
