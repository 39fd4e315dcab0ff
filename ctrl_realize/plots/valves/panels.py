"""Panels of a result: one alone, or all four."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import control as ct
from matplotlib.lines import Line2D

from ..._checks import one_of
from .. import style


class Panel(NamedTuple):
    """What draws a panel into axes, its title (without one that of all), legend and size."""

    draw: Callable[..., list[Line2D]]
    title: str
    loc: str = "best"
    size: tuple[float, float] = (8.0, 4.7)


def draw_panels(
    panels: Mapping[str, Panel],
    result: Any,
    panel: str | None,
    looks: dict[str, Any],
    *,
    ax: style.AxesLike,
    title: str | None,
    name: str,
) -> ct.ControlPlot:
    """Draw one panel of a result, or all of them; `name` is the title of all."""
    if panel is not None:
        one = panels[one_of(panel, "panel", tuple(panels))]
        with style.canvas(ax, title=title, default_title=one.title or name, size=one.size) as axes:
            return style.finished(axes, [one.draw(axes[0], result, looks)], loc=one.loc)
    with style.canvas(
        ax, 2, columns=2, sharex=False, size=(11.0, 8.0), title=title, default_title=name
    ) as axes:
        lines = [
            one.draw(axis, result, looks) for axis, one in zip(axes, panels.values(), strict=True)
        ]
        return style.finished(axes, lines, columns=2, legends=range(4), loc="best")
