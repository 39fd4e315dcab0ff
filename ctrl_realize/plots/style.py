"""Colours, axes and units that all plots share.

One colour means one thing in every figure. The colours are those of Okabe and Ito, which people
with any kind of colour vision tell apart; models are dashed as well, for print without colour.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from itertools import accumulate
from textwrap import wrap
from typing import Any
from unicodedata import east_asian_width

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from ..errors import OptionError
from ..numerics.arrays import FloatArray
from ..wording import UNITS, unit_for
from ..wording import in_time as in_time
from ..wording import interval_digits as interval_digits
from ..wording import interval_in_time as interval_in_time

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
"""INK, GRID and PAPER are used for nothing else, so that a report can swap them in the dark."""

HERTZ = 2 * np.pi
"""rad/s in one Hz."""

DASHES = ((0, (5, 1.6)), (0, (2, 1.2)), (0, (7, 1.5, 1.5, 1.5)), (0, (1, 1)), (0, (9, 2)))
"""Line styles of models, the first for the first model."""

_SETTINGS: Any = {
    "font.size": 12,
    "axes.labelsize": 12,
    "axes.titlesize": 13,
    "xtick.labelsize": 11,
    "ytick.labelsize": 11,
    "legend.fontsize": 11,
    "legend.frameon": True,
    "legend.facecolor": PAPER,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.75,
    "legend.borderaxespad": 0.3,
    "lines.linewidth": 2.0,
    "lines.markersize": 5.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.formatter.useoffset": False,
}

AxesLike = Any
"""None, Axes, a sequence of Axes, or a Figure to make them in."""


def plain(text: str, longest: int = 80) -> str:
    r"""Make a name that came with the data safe to draw.

    Dollar signs and a leading underscore are instructions to matplotlib; control characters have
    no glyph, nor have letters that the user's fonts do not know. `longest` counts letters of
    ordinary width: a row of "W" is cut sooner, before it leaves no room for the axes.

    Examples
    --------
    >>> from ctrl_realize.plots.style import plain
    >>> print(plain("_price in $\n"))
    price in \$?
    """
    known = _letters(tuple(mpl.rcParams["font.family"]), tuple(mpl.rcParams["font.sans-serif"]))
    shown = "".join(
        letter if letter.isprintable() and ord(letter) in known else "?"
        for letter in text[:1000].lstrip("_")
    )
    ends = list(accumulate(map(_width, shown)))
    if ends and ends[-1] > longest:
        shown = shown[: bisect_right(ends, longest - 1)] + "…"
    return shown.replace("$", r"\$") or "signal"


@cache
def _letters(families: tuple[str, ...], sans: tuple[str, ...]) -> frozenset[int]:
    """Code points that the fonts of these families can draw."""
    found: set[int] = set()
    for family in (name for one in families for name in (sans if one == "sans-serif" else (one,))):
        with suppress(ValueError):  # a font that is not on this machine
            path = findfont(FontProperties(family=family), fallback_to_default=False)
            found.update(get_font(path).get_charmap())
    return frozenset(found)


def _width(letter: str) -> float:
    if letter in "WMwm@%" or east_asian_width(letter) in "WF":
        return 1.7
    return 1.25 if letter.isupper() else 1.0


def wrapped(text: str, width: int) -> str:
    """Break a name into at most three short lines."""
    return "\n".join(wrap(plain(text), width)[:3])


def model_colour(number: int) -> str:
    """Return the colour of the model with this number, the first being 0."""
    return ((MODEL, *OTHERS))[number % (1 + len(OTHERS))]


@contextmanager
def context() -> Iterator[None]:
    """Use the toolbox's style inside the block; nothing of it stays."""
    # Not rc_context: it restores all settings, "interactive" too, which a notebook's backend
    # switches on when the first figure is made. No later figure would be shown.
    before = {key: mpl.rcParams[key] for key in _SETTINGS}
    mpl.rcParams.update(_SETTINGS)
    try:
        yield
    finally:
        mpl.rcParams.update(before)


def axes_for(
    ax: AxesLike,
    rows: int = 1,
    *,
    size: tuple[float, float] = (8.0, 4.6),
    heights: Sequence[float] | None = None,
    columns: int = 1,
    sharex: bool = True,
) -> list[Axes]:
    """Return the axes to draw in: those given, or new ones.

    Parameters
    ----------
    ax : None, Axes, sequence of Axes or Figure
        None makes a new figure with pyplot, as python-control does; a Figure gets the axes.
    rows, columns : int
        Axes needed.
    size : tuple of float
        Size of a new figure in inches.
    heights : sequence of float, optional
        Relative heights of the rows.
    sharex : bool, default True
        Whether the rows share their x axis.

    Raises
    ------
    OptionError
        Another number of axes than the plot needs.
    """
    needed = rows * columns
    if ax is None or isinstance(ax, FigureBase):
        figure = plt.figure(figsize=size, layout="constrained") if ax is None else ax
        made = figure.subplots(
            rows,
            columns,
            squeeze=False,
            sharex="col" if sharex else False,
            gridspec_kw=None if heights is None else {"height_ratios": heights},
        )
        return [axes for row in made for axes in row]
    given = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(given) != needed or not all(isinstance(axes, Axes) for axes in given):
        raise OptionError(
            f"ax holds {len(given)} object(s); this plot needs {needed} matplotlib Axes (or a "
            "Figure, or None)"
        )
    return given


def finished(
    axes: Sequence[Axes],
    lines: Sequence[Sequence[Line2D]],
    *,
    columns: int = 1,
    legends: Sequence[int] = (0,),
    title: str | None = None,
    own_figure: bool = False,
    loc: str = "upper right",
) -> ct.ControlPlot:
    """Put legends and title on, and bundle everything as python-control's plots do.

    The place `loc` is one of matplotlib's, or "above": outside, at the right, where curves that
    go everywhere leave no place inside.
    """
    for position in legends:
        labelled = axes[position].get_legend_handles_labels()[1]
        if labelled:
            _legend(axes[position], loc)
    if title and own_figure:
        axes[0].set_title(plain(title), loc="left")
    shape = (len(axes) // columns, columns)
    line_array = np.empty(len(axes), dtype=object)
    legend_array = np.empty(len(axes), dtype=object)
    axes_array = np.empty(len(axes), dtype=object)
    for index, (one, drawn) in enumerate(zip(axes, lines, strict=True)):
        line_array[index] = list(drawn)
        legend_array[index] = one.get_legend()
        axes_array[index] = one
    return ct.ControlPlot(
        line_array.reshape(shape),
        axes_array.reshape(shape),
        axes[0].figure,
        legend=legend_array.reshape(shape),
    )


def _legend(axes: Axes, loc: Any) -> None:
    if loc == "above":
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    else:
        axes.legend(loc=loc)


def in_one(
    ax: AxesLike,
    title: str,
    draw: Callable[[Axes], Sequence[Line2D]],
    *,
    loc: str = "upper right",
) -> ct.ControlPlot:
    """Draw a plot that needs a single pair of axes: those given, or new ones.

    Parameters
    ----------
    ax : None, Axes or Figure
    title : str
        Put on only where the figure is new.
    draw : callable
        Takes the axes and returns the lines of the plot.
    loc : str, optional
        Place of the legend.
    """
    with context():
        (axes,) = axes_for(ax)
        return finished([axes], [draw(axes)], title=title, own_figure=ax is None, loc=loc)


def time_unit(largest: float, axes: Axes | None = None) -> tuple[float, str]:
    """Choose s, ms or µs for times up to `largest` s; returns (units per second, name).

    Axes that already carry a time unit keep it.

    Examples
    --------
    >>> from ctrl_realize.plots.style import time_unit
    >>> time_unit(3.0), time_unit(0.029)
    ((1.0, 's'), (1000.0, 'ms'))
    """
    label = "" if axes is None else axes.get_xlabel()
    for name, factor in UNITS.items():
        if label.endswith(f"[{name}]"):
            return factor, name
    name = unit_for(largest)
    return UNITS[name], name


def decibel(magnitude: ArrayLike) -> FloatArray:
    """Return 20 log10 of a magnitude; zeros give no point."""
    values = np.abs(np.asarray(magnitude))
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(values)
    return np.where(np.isfinite(level), level, np.nan)


def frequency_axis(axes: Axes, *, label: bool = True) -> None:
    """Make the x axis a logarithmic one in Hz with plain numbers."""
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    # Less than two decades hold too few powers of ten to read a frequency off.
    few = high / max(low, 1e-300) < 100
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    if label:
        axes.set_xlabel("frequency [Hz]")


def phase_ticks(axes: Axes) -> None:
    """Put ticks of a phase in degrees at multiples of 45, 90, 180, ... ."""
    low, high = axes.get_ylim()
    step = next((s for s in (45, 90, 180, 360, 720, 1440) if (high - low) / s <= 6), None)
    if step is not None and high - low > 90:
        axes.yaxis.set_major_locator(mpl.ticker.MultipleLocator(step))


def room_above(axes: Axes, share: float = 0.12) -> None:
    """Widen the y axis upwards, for a legend or a note above the curves."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + share * (high - low))


def note(axes: Axes, text: str, height: float = 0.7) -> None:
    """Write a remark at the right edge, at this share of the axes' height."""
    axes.text(
        0.985, height, text, transform=axes.transAxes, ha="right", va="top", fontsize=10,
        color=INK,
    )  # fmt: skip
