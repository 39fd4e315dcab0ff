"""Results as cards, systems in the requested representation, arrays as code with all digits."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

SHORT_LABEL = 16
"""Letters of a label up to which it is not wrapped."""


class Card(NamedTuple):
    """Title, label-value rows, choices and flags, as text or HTML."""

    title: str
    rows: Sequence[tuple[str, str]]
    choices: Sequence[str] = ()
    flags: Sequence[str] = ()

    def text(self) -> str:
        """Format the card as text.

        Examples
        --------
        >>> from ctrl_realize._shown import Card
        >>> rows = [("delay", "37 samples"), ("order", "3")]
        >>> print(Card("Delay", rows, flags=["look twice"]).text())
        Delay
          delay  37 samples
          order  3
          ! look twice
        """
        width = max((len(label) for label, _ in self.rows), default=0)
        lines = [self.title]
        lines += [f"  {label:<{width}}  {value}" for label, value in self.rows]
        lines += [f"  - {choice}" for choice in self.choices]
        lines += [f"  ! {flag}" for flag in self.flags]
        return "\n".join(lines)

    def html(self) -> str:
        """Format the card as a small HTML table; everything is escaped.

        Examples
        --------
        >>> from ctrl_realize._shown import Card
        >>> card = Card("Delay", [("delay", "37 samples")], flags=["look <twice>"]).html()
        >>> print(card[card.index("⚠"):])
        ⚠ look &lt;twice&gt;</div></div>
        """
        cell = "text-align:left;vertical-align:top"
        body = "".join(
            f"<tr><th style='{cell};font-weight:500;padding:2px 16px 2px 0;"
            # On a narrow screen the values wrap first.
            f"white-space:{'nowrap' if len(label) <= SHORT_LABEL else 'normal'}'>"
            f"{escape(label)}</th>"
            f"<td style='{cell};padding:2px 0'>{escape(value)}</td></tr>"
            for label, value in self.rows
        )
        said = [*self.choices, *(f"⚠ {flag}" for flag in self.flags)]
        lines = "".join(f"<div style='margin-top:4px'>{escape(text)}</div>" for text in said)
        return (
            "<div style='display:inline-block;border:1px solid #8886;border-radius:6px;"
            "padding:8px 14px;max-width:46em'>"
            f"<div style='font-weight:600;margin-bottom:4px'>{escape(self.title)}</div>"
            f"<table style='border-collapse:collapse;margin:0'>{body}</table>{lines}</div>"
        )


class ShownSystem:
    """How systems of this toolbox are shown, one line or a card, and how they are copied.

    python-control shows all matrices: of systems with delays too many, and as LaTeX, which not
    every page renders. Its systems hold closures, which can be neither stored nor shared by a copy:
    a copy is made anew by what made the system. Everything inside is read-only and may be shared.
    """

    _state_names: dict[str, int] | None = None
    _repr_format: str | None

    if TYPE_CHECKING:  # what a class adds

        def _made_by(self) -> tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]:
            """What makes an equal system, with its arguments."""

        def _line(self) -> str: ...

        def _card(self) -> Card: ...

    def __reduce__(self) -> tuple[Any, ...]:
        states = None if self._state_names is None else list(self._state_names)
        return _made_again, (*self._made_by(), states, self._repr_format)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        make, arguments = self.__reduce__()
        copy: Self = make(*arguments)
        return copy

    def __repr__(self) -> str:
        return as_asked(self)

    def __str__(self) -> str:
        return self._line()

    def _repr_info_(self, html: bool = False) -> str:
        line = self._line()
        return escape(line) if html else line

    def _repr_html_(self) -> str:
        return self._card().html()

    def _repr_markdown_(self) -> None:
        return None


def _made_again(
    make: Callable[..., Any],
    arguments: tuple[Any, ...],
    settings: dict[str, Any],
    states: Iterable[str] | None,
    repr_format: str | None,
) -> Any:
    return shown_alike(make(*arguments, **settings), states, repr_format)


def shown_alike(made: Any, states: Iterable[str] | None, repr_format: str | None) -> Any:
    """Give a system user-defined state names, if they fit, and a `repr_format`."""
    if states is not None and len(labels := list(states)) == made.nstates:
        made.set_states(labels)
    made.repr_format = repr_format
    return made


def as_asked(system: Any) -> str:
    """Represent a system as its `repr_format`, or python-control's setting, requires.

    python-control's default, "eval", lists every number. Systems of this toolbox use one line
    instead, and "eval" only if it was set on the system itself.

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
    """Write an array, or a python-control system, as code with all digits.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize._shown import as_code
    >>> print(as_code(np.array([1 / 3])))
    array([0.3333333333333333])
    """
    # an object of python-control or NumPy; only some classes of the former can write themselves
    # as code
    with np.printoptions(precision=17, floatmode="unique", threshold=sys.maxsize):
        return str(values._repr_eval_() if hasattr(values, "_repr_eval_") else repr(values))
