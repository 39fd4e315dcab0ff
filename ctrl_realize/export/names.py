"""Names and comments that every language accepts."""

from __future__ import annotations

import keyword
import os
import re
import unicodedata
from collections.abc import Container
from pathlib import Path

from .._facts import facts
from ..errors import OptionError

_WORDS = {kind: words.split() for kind, words in facts("export/reserved.toml").items()}
RESERVED = frozenset(
    [word for words in _WORDS.values() for word in words]
    + [word.lower() for word in (*keyword.kwlist, *keyword.softkwlist, "type")]
)
"""Words of any of the languages that are no names (in lower case)."""
_TYPES = "|".join(_WORDS["types"])
CONVERSION = re.compile(rf"({_TYPES}|bcd|)_?to_({_TYPES}|bcd)")
"""Names of the standard's conversion functions, such as ``real_to_int`` and ``to_int``."""
LONGEST = 48
"""Characters of a name: MATLAB cuts a variable at 63, and the scripts add up to 14."""


def identifier(name: str, fallback: str, taken: Container[str] = ()) -> str:
    """Turn a name into an identifier that all languages accept.

    Parameters
    ----------
    name, fallback : str
        `fallback` is used where no letter of `name` remains, and before a leading digit.
    taken : container of str, optional
        Further names that are in use.

    Examples
    --------
    >>> from ctrl_realize.export.names import identifier
    >>> identifier("FIC 101.OP", "plant"), identifier("für", "plant"), identifier("TON", "plant")
    ('FIC_101_OP', 'fur', 'TON_1')
    """
    if not isinstance(name, str):
        raise OptionError(f"name={name!r}; expected a string")
    # IEC 61131-3 allows ASCII letters, digits and single underscores.
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9]+", "_", ascii_only).strip("_") or fallback
    if text[0].isdigit():
        text = f"{fallback}_{text}"
    text = text[:LONGEST].rstrip("_")
    lower = text.lower()
    refused = lower in RESERVED or text in taken or CONVERSION.fullmatch(lower)
    return f"{text}_1" if refused else text


def one_line(text: str) -> str:
    r"""Text for a label, or a comment to the end of its line: ASCII, no control characters.

    Examples
    --------
    >>> from ctrl_realize.export.names import one_line
    >>> one_line("first\r\nsecond für")
    'first  second f?r'
    """
    return re.sub(r"[\x00-\x1f\x7f]", " ", text.encode("ascii", "replace").decode())


def plain(text: str) -> str:
    """Text for a comment on one line that no language ends early.

    Examples
    --------
    >>> from ctrl_realize.export.names import plain
    >>> plain("first */ second *) third")
    'first ? second ? third'
    """
    return re.sub(r"\*\)|\*/|/\*|\(\*|\"\"\"|\\", "?", one_line(text))


def ending(path: str | os.PathLike[str], suffix: str) -> Path:
    """Path of a file whose name ends in a suffix."""
    target = Path(path)
    if target.suffix != suffix:
        raise OptionError(f"path={str(target)!r}; expected a name that ends in {suffix}")
    return target
