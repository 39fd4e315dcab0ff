"""Figures as inline SVG: small, and in the colours of the page."""

from __future__ import annotations

import io
import json
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FixedLocator

from ..numerics.arrays import FloatArray
from ..plots import style

POINTS = 1200
"""Largest number of points of a line; more than the columns of a screen are not visible."""

_COLOURS = ("INK", "GRID", "PAPER", "MEASURED", "MODEL", "TRUTH", "INPUT", "NOISE", "BAND")
_VARIABLES = {getattr(style, name): f"var(--{name.lower()})" for name in _COLOURS}


def laid_out(draw: Callable[[Figure], Any], size: tuple[float, float]) -> Figure:
    """Draw a figure and fix its layout, so that it can be saved quickly.

    Parameters
    ----------
    draw : callable
        Draws into a new figure, unknown to pyplot.
    size : tuple of float
        Width and height in inches of 72 points.
    """
    figure = Figure(figsize=size)  # without an engine, for which saving would draw once more
    with missing_glyphs_allowed():
        draw(figure)
        thin_lines(figure)
        ConstrainedLayoutEngine().execute(figure)
    return figure


@contextmanager
def missing_glyphs_allowed() -> Iterator[None]:
    """Draw letters that the font does not contain as boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from", category=UserWarning)
        yield


def thin_lines(figure: Figure, points: int = POINTS) -> None:
    """Replace long lines of a figure by their envelope, which looks the same."""
    for axes in figure.axes:
        logarithmic = axes.get_xscale() == "log"
        for line in axes.get_lines():
            x, y = (np.asarray(one, dtype=np.float64) for one in line.get_data())
            if x.size > points:
                line.set_data(*thinned(x, y, points, logarithmic=logarithmic))


def thinned(
    x: FloatArray, y: FloatArray, points: int, *, logarithmic: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Points of a long line that look the same: its envelope, or those of its path."""
    rising = (np.diff(x) >= 0).all()
    return envelope(x, y, points, logarithmic=logarithmic) if rising else path_of(x, y)


def path_of(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thin out a curve that turns back, such as a loop: points closer than the width of a line.

    Parameters
    ----------
    x, y : ndarray, shape (N,)

    Returns
    -------
    x, y : ndarray
        A selection of the given points, in their order; each that is left out is within 1/400 of
        the ranges of one that is kept.
    """
    scaled = [400 * (one - np.nanmin(one)) / max(np.ptp(one), 1e-300) for one in (x, y)]
    kept, last = [0], 0
    across, up = (one.tolist() for one in scaled)
    for k in range(1, x.size):
        if abs(across[k] - across[last]) > 1 or abs(up[k] - up[last]) > 1:
            # the sample before is the corner, if the curve rested there
            kept += [k - 1, k] if k - 1 > last else [k]
            last = k
    chosen = np.unique([*kept, x.size - 1])
    return x[chosen], y[chosen]


def envelope(
    x: FloatArray, y: FloatArray, points: int, *, logarithmic: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Keep the smallest and the largest value in each of points / 2 sections of x.

    Parameters
    ----------
    x : ndarray, shape (N,), rising
    y : ndarray, shape (N,)
        Gaps are NaN; a section with nothing else remains a gap.
    points : int
        Approximate number of points to keep.
    logarithmic : bool, default False
        Sections of equal ratio instead of equal length.

    Returns
    -------
    x, y : ndarray
        A selection of the given points, in their order.
    """
    scale = np.log(np.maximum(x, np.finfo(float).tiny)) if logarithmic else x
    stretches = max(points // 2, 1)
    edges = np.linspace(scale[0], scale[-1], stretches + 1)[1:-1]
    starts = np.unique(np.concatenate([[0], np.searchsorted(scale, edges)]))
    starts = starts[starts < x.size]
    section = np.repeat(np.arange(starts.size), np.diff([*starts, x.size]))
    kept = [starts[np.isnan(np.fmin.reduceat(y, starts))]]  # sections that are gaps
    for reduce in (np.fmin.reduceat, np.fmax.reduceat):
        at = np.flatnonzero(y == reduce(y, starts)[section])
        kept.append(at[np.unique(section[at], return_index=True)[1]])
    chosen = np.unique(np.concatenate([[0], *kept, [x.size - 1]])).astype(int)
    return x[chosen], y[chosen]


def inline_svg(figure: Figure, key: str, description: str) -> str:
    """Return a figure as an ``<svg>`` element whose colours are variables of the page.

    Parameters
    ----------
    figure : Figure
    key : str
        Letters and digits, different for each figure of a page; prefix of all ids.
    description : str
        Alternative text for screen readers.
    """
    buffer = io.StringIO()
    settings: Any = {"svg.fonttype": "none", "svg.hashsalt": key}
    with mpl.rc_context(settings), missing_glyphs_allowed():
        figure.savefig(
            buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None}
        )
    return _at_home(buffer.getvalue(), key, description, scales(figure))


def scales(figure: Figure) -> str:
    """Return positions and ranges of the axes of a figure as JSON, for reading off values.

    For each axes its box (left, top, width, height in points), and for x and y the values at the
    ends, whether the scale is logarithmic, and the unit; None if an axis has names instead of
    values.
    """
    wide, high = 72 * figure.get_figwidth(), 72 * figure.get_figheight()
    found = []
    for axes in figure.axes:
        part = axes.get_position()
        box = (part.x0 * wide, (1 - part.y1) * high, part.width * wide, part.height * high)
        across = axes.get_shared_x_axes().get_siblings(axes)
        x = _scale(axes.xaxis, axes.get_xlim(), [one.get_xlabel() for one in across])
        y = _scale(axes.yaxis, axes.get_ylim(), [axes.get_ylabel()])
        found.append({"box": [round(float(length), 2) for length in box], "x": x, "y": y})
    return json.dumps(found)


def _scale(axis: Axis, ends: tuple[float, float], labels: list[str]) -> list[Any] | None:
    if isinstance(axis.get_major_locator(), FixedLocator):
        return None
    units = [re.search(r"\[([^\]]*)\]$", label) for label in labels]
    # in a label a backslash keeps matplotlib from interpreting formulas between dollar signs
    unit = next((found[1].replace(r"\$", "$") for found in units if found), "")
    low, high = (float(f"{end:.9g}") for end in ends)
    return [low, high, axis.get_scale() == "log", unit]


def _at_home(document: str, key: str, description: str, data: str) -> str:
    aria, axes = escape(description), escape(data)
    body = document[document.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", body, count=1, flags=re.DOTALL)
    # Between the tags there are names from the data, which may be like "#0072b2" or 'id="'.
    body = re.sub(r"<[^>]*>", lambda tag: _tag_at_home(tag[0], key), body)
    body = re.sub(r"\s*\n\s*", " ", body)
    head = f'<svg role="img" aria-label="{aria}" class="plot" data-axes="{axes}" '
    # By functions, not templates: a name in the data may contain a backslash.
    size = r'<svg (?:xmlns:xlink="[^"]*" )?width="[^"]*" height="[^"]*" '
    body = re.sub(size, lambda _: head, body, count=1)
    return body.replace('xmlns="http://www.w3.org/2000/svg" ', "", 1)


def _tag_at_home(tag: str, key: str) -> str:
    """Adapt a tag to the page: its id is unique, its colours are variables."""
    tag = re.sub(r'\bid="', f'id="{key}-', tag)
    tag = tag.replace("url(#", f"url(#{key}-").replace('href="#', f'href="#{key}-')
    tag = re.sub(r"font-family: [^;\"]*", "font-family: inherit", tag)
    tag = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font: \1 inherit", tag)
    for colour, variable in _VARIABLES.items():
        tag = tag.replace(colour, variable)
    # Hundredths of a point are finer than any printer.
    return re.sub(r'(?<= )(d|x|y|transform)="[^"]*"', _rounded, tag)


def _rounded(match: re.Match[str]) -> str:
    return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", match[0])
