"""What all results have in common: a card in a notebook, the same card as text, a plot.

A result is a frozen dataclass. It names itself (`_title`), lists its numbers with their units
(`_rows`), and may carry `choices`, what was chosen for the caller and why, and `flags`, the
things that one should know before trusting it.
"""

from __future__ import annotations

import html
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

SHORT_LABEL = 16
"""Letters of a label that is never broken."""


@dataclass(frozen=True)
class Flag:
    """Something one should know before trusting a result.

    Attributes
    ----------
    code : str
        Short fixed name, for programs: ``"delay_at_bound"``.
    message : str
        What was seen, with its numbers, and what to try.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[np.zeros(38), 0.1 * 0.9 ** np.arange(300)]
    >>> for flag in cr.estimate_delay(pulse, 1, max_delay=37, dt=0.01).fit.flags:
    ...     print(f"{flag.code}: {flag}")
    delay_at_bound: the best delay is max_delay=37; try a larger one
    """

    code: str
    message: str

    def __str__(self) -> str:
        return self.message


class Drawable:
    """What has a picture among `ctrl_realize.plots`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.results import Drawable
    >>> issubclass(cr.Record, Drawable)
    True
    """

    __slots__ = ()

    def plot(self, **kwargs: Any) -> Any:
        """Draw it; returns a `control.ControlPlot`.

        Keyword arguments go to the function of `ctrl_realize.plots` that draws this kind of
        object.
        """
        # The one way up in the layers: drawing is looked up when somebody asks for it, so that
        # computing needs no matplotlib.
        return import_module("ctrl_realize.plots").draw(self, **kwargs)


class Result(Drawable):
    """Mixin of all results: `report`, `plot` and the card that a notebook shows.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from ctrl_realize.results import Result
    >>> @dataclass(frozen=True)
    ... class Weight(Result):
    ...     kilograms: float
    ...     def _rows(self):
    ...         return [("mass", f"{self.kilograms:g} kg")]
    >>> print(Weight(4.2).report())
    Weight
      mass  4.2 kg
    """

    def _title(self) -> str:
        return type(self).__name__

    def _rows(self) -> list[tuple[str, str]]:
        raise AssertionError(f"{type(self).__name__} does not list its numbers")

    def _choices(self) -> list[str]:
        choices: tuple[str, ...] = getattr(self, "choices", ())
        return list(choices)

    def _notes(self) -> list[str]:
        flags: tuple[Flag, ...] = getattr(self, "flags", ())
        return [str(flag) for flag in flags]

    def report(self) -> str:
        """Tell the result as plain text, choices and flags included."""
        return text_card(self._title(), self._rows(), self._choices(), self._notes())

    def _repr_html_(self) -> str:
        return html_card(self._title(), self._rows(), self._choices(), self._notes())


def text_card(
    title: str,
    rows: Sequence[tuple[str, str]],
    choices: Sequence[str] = (),
    flags: Sequence[str] = (),
) -> str:
    """Lay out label-value rows as text, choices and flags below them.

    Parameters
    ----------
    title : str
    rows : sequence of (label, value)
    choices, flags : sequence of str, optional

    Returns
    -------
    str

    Examples
    --------
    >>> from ctrl_realize.results import text_card
    >>> print(text_card("Delay", [("delay", "37 samples"), ("order", "3")], (), ["look twice"]))
    Delay
      delay  37 samples
      order  3
      ! look twice
    """
    width = max((len(label) for label, _ in rows), default=0)
    lines = [title]
    lines += [f"  {label:<{width}}  {value}" for label, value in rows]
    lines += [f"  - {choice}" for choice in choices]
    lines += [f"  ! {flag}" for flag in flags]
    return "\n".join(lines)


def html_card(
    title: str,
    rows: Sequence[tuple[str, str]],
    choices: Sequence[str] = (),
    flags: Sequence[str] = (),
) -> str:
    """Lay out label-value rows as a small HTML table; everything is escaped.

    Parameters
    ----------
    title, rows, choices, flags
        As for `text_card`.

    Returns
    -------
    str

    Examples
    --------
    >>> from ctrl_realize.results import html_card
    >>> card = html_card("Delay", [("delay", "37 samples")], flags=["look <twice>"])
    >>> print(card[card.index("⚠"):])
    ⚠ look &lt;twice&gt;</div></div>
    """
    cell = "text-align:left;vertical-align:top"
    body = "".join(
        f"<tr><th style='{cell};font-weight:500;padding:2px 16px 2px 0;"
        # On a phone the values wrap first.
        f"white-space:{'nowrap' if len(label) <= SHORT_LABEL else 'normal'}'>"
        f"{html.escape(label)}</th>"
        f"<td style='{cell};padding:2px 0'>{html.escape(value)}</td></tr>"
        for label, value in rows
    )
    lines = "".join(f"<div style='margin-top:4px'>{html.escape(text)}</div>" for text in choices)
    lines += "".join(f"<div style='margin-top:4px'>⚠ {html.escape(text)}</div>" for text in flags)
    return (
        "<div style='display:inline-block;border:1px solid #8886;border-radius:6px;"
        "padding:8px 14px;max-width:46em'>"
        f"<div style='font-weight:600;margin-bottom:4px'>{html.escape(title)}</div>"
        f"<table style='border-collapse:collapse;margin:0'>{body}</table>{lines}</div>"
    )


def as_asked(system: Any) -> str:
    """Write a system as its `repr_format`, or that of python-control's settings, asks for.

    What python-control takes where nothing was set, "eval", lists every number. Systems of this
    toolbox show their one line there, and "eval" only where it was set on the system itself.

    Parameters
    ----------
    system : control.InputOutputSystem

    Returns
    -------
    str

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> valve = cr.delayed_ss(ct.ss([], [], [], [[2.0]], 0.1), 3, name="valve")
    >>> valve
    <DelayedStateSpace 'valve': u -> y, order 0, z^-3 (0.3 s), dt = 0.1 s>
    >>> valve.repr_format = "latex"
    >>> repr(valve)[:4]
    '<div'
    """
    asked = system.repr_format
    if asked == "eval" and system._repr_format is not None:
        return str(system._repr_eval_())
    if asked not in ("eval", "info", "latex"):
        raise ValueError(f"format {asked!r} unknown")
    html_text = system._repr_html_() if asked == "latex" else None
    return str(html_text or system._repr_info_())


def as_code(values: Any) -> str:
    """Write an array, or a system of python-control, as code that has all its digits.

    Parameters
    ----------
    values : array_like or control.InputOutputSystem

    Returns
    -------
    str

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.results import as_code
    >>> print(as_code(np.array([1 / 3])))
    array([0.3333333333333333])
    """
    with np.printoptions(precision=17, floatmode="unique", threshold=sys.maxsize):
        return str(values._repr_eval_() if hasattr(values, "_repr_eval_") else repr(values))
