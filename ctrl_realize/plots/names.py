"""Names from the data, made safe for drawing."""

from __future__ import annotations

from bisect import bisect_right
from contextlib import suppress
from functools import cache
from itertools import accumulate
from textwrap import wrap
from unicodedata import east_asian_width

import matplotlib as mpl
from matplotlib.font_manager import FontProperties, findfont, get_font


def plain(text: str, longest: int = 80) -> str:
    r"""Make a name from the data safe for drawing.

    Dollar signs and a leading underscore have a meaning for matplotlib; control characters and
    letters that the user's fonts do not contain have no glyph. `longest` counts letters of ordinary
    width: a row of "W" is shortened further, so that the axes keep their space.

    Examples
    --------
    >>> from ctrl_realize.plots.names import plain
    >>> print(plain("_price in $\n"))
    price in \$?
    """
    return _shown(text, longest).replace("$", r"\$")


def _shown(text: str, longest: int) -> str:
    """Return the drawable letters of a name, at most `longest`."""
    known = _letters(tuple(mpl.rcParams["font.family"]), tuple(mpl.rcParams["font.sans-serif"]))
    shown = "".join(
        letter if letter.isprintable() and ord(letter) in known else "?"
        for letter in text[:1000].lstrip("_")
    )
    ends = list(accumulate(map(_width, shown)))
    if ends and ends[-1] > longest:
        shown = shown[: bisect_right(ends, longest - 1)] + "…"
    return shown or "signal"


def with_unit(label: str, unit: str) -> str:
    """Add a unit to the name of a signal, unless it contains it already.

    Examples
    --------
    >>> from ctrl_realize.plots.names import with_unit
    >>> with_unit("T", "degC"), with_unit("T [degC]", "degC"), with_unit("u", "")
    ('T [degC]', 'T [degC]', 'u')
    """
    return f"{label} [{unit}]" if unit and f"[{unit}]" not in label else label


@cache
def _letters(families: tuple[str, ...], sans: tuple[str, ...]) -> frozenset[int]:
    """Code points that the fonts of these families contain."""
    found: set[int] = set()
    for family in (name for one in families for name in (sans if one == "sans-serif" else (one,))):
        with suppress(ValueError):  # a font that is not installed
            path = findfont(FontProperties(family=family), fallback_to_default=False)
            found.update(get_font(path).get_charmap())
    return frozenset(found)


def _width(letter: str) -> float:
    if letter in "WMwm@%" or east_asian_width(letter) in "WF":
        return 1.7
    return 1.25 if letter.isupper() else 1.0


def wrapped(text: str, width: int) -> str:
    """Break a name into at most three short lines."""
    # dollar signs last: a line must not end between one and its backslash
    lines = wrap(_shown(text, 80), width)[:3] or ["signal"]
    return "\n".join(lines).replace("$", r"\$")
