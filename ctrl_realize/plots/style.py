"""Common style, axes, units and scales of all plots.

Each colour has one meaning in all figures. The colours are those of Okabe and Ito, which are
distinguishable with any kind of colour vision; models are dashed as well, for printing without
colour.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter
from numpy.typing import ArrayLike

from .. import _wording
from .._facts import facts
from ..delayed import DelayedStateSpace
from ..errors import OptionError
from ..numerics.arrays import FloatArray
from .names import plain

MEASURED = "#0072b2"
MODEL = "#d55e00"
TRUTH = "#009e73"
INPUT = "#5e646d"
NOISE = "#8c939c"
BAND = "#e69f00"
OTHERS = ("#cc79a7", "#009e73", "#e69f00", "#56b4e9")
INK = "#1f2328"
GRID = "#d9dde2"
PAPER = "#fefefe"
"""INK, GRID and PAPER have no other use, so that a report can exchange them in dark mode."""

DASHES = ((0, (5, 1.6)), (0, (2, 1.2)), (0, (7, 1.5, 1.5, 1.5)), (0, (1, 1)), (0, (9, 2)))
"""Line styles of models, the first for the first model."""

_LOOKS = facts("plots/style.toml")
_COLOURS = {"ink": INK, "grid": GRID, "paper": PAPER}
_SETTINGS: Any = _LOOKS["plain"] | {key: _COLOURS[name] for key, name in _LOOKS["colours"].items()}

Kind = TypeVar("Kind")

AxesLike = Any
"""None, Axes, a sequence of Axes, or a Figure."""


def model_colour(number: int) -> str:
    """Return the colour of a model by its number from 0."""
    return (MODEL, *OTHERS)[number % (1 + len(OTHERS))]


def model_looks(number: int = 0) -> dict[str, Any]:
    """Return colour and dashes of a model by its number from 0."""
    return {"color": model_colour(number), "linestyle": DASHES[number % len(DASHES)]}


@contextmanager
def context() -> Iterator[None]:
    """Use the toolbox's style inside the block; the settings are restored afterwards."""
    # Not rc_context: it restores all settings, including "interactive", which a notebook's backend
    # switches on with the first figure. No later figure would be shown.
    before = {key: mpl.rcParams[key] for key in _SETTINGS}
    mpl.rcParams.update(_SETTINGS)
    try:
        yield
    finally:
        mpl.rcParams.update(before)


@contextmanager
def canvas(
    ax: AxesLike,
    rows: int = 1,
    *,
    title: str | None = None,
    default_title: str = "",
    size: tuple[float, float] = (8.0, 4.6),
    heights: Sequence[float] | None = None,
    columns: int = 1,
    sharex: bool = True,
    beside: bool = False,
) -> Iterator[list[Axes]]:
    """Provide the axes to draw in, in the toolbox's style; a new figure gets its title at the end.

    Parameters
    ----------
    ax : None, Axes, sequence of Axes or Figure
        None makes a new figure with pyplot, as python-control does; in a Figure, axes are created.
    rows, columns : int
        Number of axes needed.
    title : str, optional
        Title given by the caller; an empty one for none.
    default_title : str
        Default title.
    size : tuple of float
        Size of a new figure in inches.
    heights : sequence of float, optional
        Relative heights of the rows.
    sharex : bool, default True
        Whether the rows share their x axis.
    beside : bool, default False
        Whether the last one stands beside the others.

    Raises
    ------
    OptionError
        A wrong number of axes for the plot.
    """
    with context():
        if ax is not None and not isinstance(ax, FigureBase):
            axes = list(np.ravel(np.asarray(ax, dtype=object)))
            if len(axes) != rows * columns or not all(isinstance(one, Axes) for one in axes):
                raise OptionError(
                    f"ax holds {len(axes)} object(s); this plot needs {rows * columns} matplotlib "
                    "Axes (or a Figure, or None)"
                )
        else:
            figure = plt.figure(figsize=size, layout="constrained") if ax is None else ax
            if beside:
                grid = figure.add_gridspec(rows - 1, 2)
                places = [*(grid[row, 0] for row in range(rows - 1)), grid[:, 1]]
                axes = [figure.add_subplot(place) for place in places]
            else:
                shape: Any = {"sharex": "col" if sharex else False, "height_ratios": heights}
                axes = list(figure.subplots(rows, columns, squeeze=False, **shape).flat)
        yield axes
        text = default_title if title is None else title
        if text and ax is None:
            axes[0].set_title(plain(text), loc="left")


def finished(
    axes: Sequence[Axes],
    lines: Sequence[Sequence[Line2D]],
    *,
    columns: int = 1,
    legends: Sequence[int] = (0,),
    loc: str = "upper right",
) -> ct.ControlPlot:
    """Add the legends, and return a plot object as python-control does.

    `loc` is one of matplotlib's locations, or one for curves that leave no space inside: "above" is
    outside, at the right; "over" is above the curves, in space added to the value axis, if a title
    needs the space outside.
    """
    for position in legends:
        if axes[position].get_legend_handles_labels()[1]:
            _legend(axes[position], loc, 3 // columns)
    shape = (len(axes) // columns, columns)
    return ct.ControlPlot(
        _objects([list(drawn) for drawn in lines]).reshape(shape),
        _objects(axes).reshape(shape),
        axes[0].figure,
        legend=_objects([one.get_legend() for one in axes]).reshape(shape),
    )


def no_curve(axes: Axes, reason: str) -> None:
    """Write in empty axes why they have no curve."""
    axes.text(0.5, 0.5, reason, ha="center", va="center", transform=axes.transAxes)


def _objects(things: Sequence[Any]) -> np.ndarray[Any, np.dtype[np.object_]]:
    """Make an array of objects that may be lists themselves."""
    array = np.empty(len(things), dtype=object)
    array[:] = things
    return array


def _legend(axes: Axes, loc: Any, columns: int) -> None:
    if loc == "above":
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns)
    elif loc == "over":
        _legend_over(axes)
    else:
        axes.legend(loc=loc)


def _legend_over(axes: Axes) -> None:
    """Put the legend above all curves, in space added to the value axis."""
    count = len(axes.get_legend_handles_labels()[1])
    assert axes.figure is not None
    inches = axes.get_window_extent().transformed(axes.figure.dpi_scale_trans.inverted())
    columns = count if inches.width > 1.9 * count else 1
    share = (0.15 + 0.25 * count / columns) / inches.height
    low, high = axes.get_ylim()
    axes.set_ylim(low, low + (high - low) / (1.0 - min(share, 0.6)))
    axes.legend(loc="upper center", ncols=columns)


def result_of(given: Any, kinds: type[Kind] | tuple[type[Kind], ...], advice: str) -> Kind:
    """Return a result of a kind: what was given, or the fit of the model that was."""
    result = given.fit if isinstance(given, DelayedStateSpace) else given
    if not isinstance(result, kinds):
        raise OptionError(f"got {given!r}, which has {advice}")
    return result


HERTZ = 2 * np.pi
"""rad/s in one Hz."""


def axis_time_unit(largest: float, axes: Axes) -> tuple[float, str]:
    """Choose s, ms or µs for times up to `largest` s; returns (units per second, name).

    Axes whose label already contains a unit of time keep it.
    """
    for name, factor in _wording.UNITS.items():
        if axes.get_xlabel().endswith(f"[{name}]"):
            return factor, name
    return _wording.time_unit(largest)


def decibel(magnitude: ArrayLike) -> FloatArray:
    """Return 20 log10 of a magnitude; zeros give no point."""
    values = np.abs(np.asarray(magnitude))
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(values)
    return np.where(np.isfinite(level), level, np.nan)


def frequency_axis(axes: Axes, *, label: bool = True) -> None:
    """Make the x axis logarithmic in Hz with plain numbers."""
    axes.set_xscale("log")
    plain_logarithms(axes.xaxis)
    if label:
        axes.set_xlabel("frequency [Hz]")


def plain_logarithms(axis: Axis) -> None:
    """Write plain numbers at a logarithmic axis."""
    low, high = axis.get_view_interval()
    # Less than two decades contain too few powers of ten for reading a value.
    few = high / max(low, 1e-300) < 100
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def phase_ticks(axes: Axes) -> None:
    """Put ticks of a phase in degrees at multiples of 45, 90, 180, ... ."""
    low, high = axes.get_ylim()
    step = next((s for s in (45, 90, 180, 360, 720, 1440) if (high - low) / s <= 6), None)
    if step is not None and high - low > 90:
        axes.yaxis.set_major_locator(MultipleLocator(step))
