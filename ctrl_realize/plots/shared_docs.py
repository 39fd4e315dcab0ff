"""Common parts of the docstrings of all plots."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import Any, TypeVar, cast

from ..data.shown_units import in_shown_units

Plot = TypeVar("Plot", bound=Callable[..., object])

_TITLE = """title : str, optional
    Of a new figure; an empty one for none. Default: the name of what is drawn."""
_RETURNS = """Returns
-------
control.ControlPlot"""


def documented(axes: str = "Axes") -> Callable[[Plot], Plot]:
    """Add `ax`, `title` and the returned plot to the docstring of a plot function.

    Times on its axes have the unit of what is drawn.

    Parameters
    ----------
    axes : str
        Further types of `ax` beside a Figure, for plots with several axes.
    """
    shared = {"ax": f"ax : {axes} or Figure, optional\n    Default: a new figure.", "title": _TITLE}

    def complete(plot: Plot) -> Plot:
        function: Any = in_shown_units(plot)
        if function.__doc__ is None:  # python -OO
            return cast("Plot", function)
        arguments = inspect.signature(function).parameters
        text = inspect.cleandoc(function.__doc__)
        head, rest = re.split(r"\n\n(?=Raises\n-|Examples\n-)", text, maxsplit=1)
        head, keywords, looks = head.partition("\n**kwargs")
        entries = [entry for name, entry in shared.items() if name in arguments]
        head = "\n".join([head, *entries]) + keywords + looks
        function.__doc__ = "\n\n".join([head, _RETURNS, rest]) + "\n"
        return cast("Plot", function)

    return complete
