"""Samples that are marked bad by a column of their quality, and cells without a value.

Words: ``Bad...``, and the states that historians write in place of a value. Numbers are told by the
codes that a column has (`_bad_codes`):

* OPC UA, Part 4, section 7.39 [1]_: 32 bits, of which the highest is set for bad ones; so are the
  codes of Ignition 8, with or without sign.
* OPC DA 3.0, section 6.8 [2]_: the lower byte is below 64 for bad ones and 192 or above for good
  ones; the higher byte is the vendor's. Ignition 7 has codes of its own from 256 on, all of them
  bad [3]_ (500: stale); so with a higher byte only the plain codes 192 and 216 count as good.
* AVEVA PI: the number of a system digital state that stands in place of a value, 0 for none [4]_.

References
----------
.. [1] OPC Foundation, OPC 10000-4: OPC Unified Architecture, Part 4: Services, 1.05, 2022.
.. [2] OPC Foundation, Data Access Custom Interface Standard, version 3.00, 2003; the same in OPC
   10000-8, annex A.3.2.3.
.. [3] Inductive Automation, Ignition User Manual 7.9 and 8.1, Quality Codes and Overlays.
.. [4] AVEVA, AF SDK Reference, AFSystemStateCode.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from typing import Any

import numpy as np

from ...errors import DataError, OptionError, warn_caller
from ...numerics.arrays import BoolArray, FloatArray
from ..cells import BAD_VALUES, number_of
from ..columns import find_column
from ..tables import Table
from ..units import split_unit
from .names import NAMES

_GOOD, _FORCED, _UNCERTAIN = 192, 216, 64
_SYSTEM_STATES = 220  # of PI, those that are no good code of OPC DA
Rows = np.ndarray[Any, np.dtype[np.intp]]
_QUALITY = re.compile(rf"(?:^| )({'|'.join(map(re.escape, NAMES['quality']))})$")
"""At the end of a name; of several words the longest, which begins first."""
_FLAGS = {"true": False, "false": True}


@dataclass(frozen=True)
class Rules:
    """What counts as a missing value.

    ``missing`` are words and numbers besides the usual ones; ``quality`` selects the column of the
    quality, ``good`` its good values; ``keep`` makes missing values NaN instead of an error.
    """

    keep: bool
    missing: tuple[str, ...] = ()
    quality: str | int | None = "auto"
    good: tuple[str, ...] = ()

    def columns(self, table: Table) -> list[int]:
        """Columns that hold qualities."""
        if self.quality is None:
            return []
        if self.quality != "auto":
            return [find_column(table, self.quality, "quality")]
        return list(_qualities(table))

    def values(self, table: Table, index: int, rows: Rows) -> FloatArray:
        """Return some rows of a column as numbers, with NaN where a value is missing or bad.

        Raises
        ------
        DataError
            A cell is no number, or a value is missing and is not to be kept.

        Warns
        -----
        DataWarning
            Numbers are left out for their quality, or codes are not known.
        """
        # the codes are told by those of the whole column
        marked = self._marked(table, index)[rows]
        table = table.rows(rows, [index])
        if marked.any() and not self.keep:
            row = int(np.argmax(marked))
            raise DataError(
                f"{table.at(index, row)}: its quality is bad; missing='keep' leaves such "
                f"samples out ({np.sum(marked)} here), quality=None ignores the quality"
            )
        values = table.numbers(
            index, keep_missing=self.keep, words=frozenset(self.missing), ignored=marked
        )
        if marked.any():
            first = table.place(int(np.argmax(marked)))
            warn_caller(
                f"{table.at(index)}: {np.sum(marked)} of {marked.size} samples are left out, since "
                f"their quality is bad, the first in {first}; quality=None keeps them"
            )
        return values

    def _marked(self, table: Table, index: int) -> BoolArray:
        """Rows in which the quality of a column is bad."""
        import pandas as pd

        out = np.zeros(table.columns[index].cells.size, dtype=bool)
        if not (qualities := self.columns(table)):
            return out
        own, tags = _tags(table.columns[index].name), _qualities(table)
        everyone = {tag for one in table.columns for tag in _tags(one.name)}
        for column in qualities:
            tag = "" if self.quality != "auto" else tags[column]
            # TIC101.quality is that of TIC101.PV where there is no TIC101 itself
            if tag and tag not in own and (tag in everyone or not own[0].startswith(f"{tag} ")):
                continue
            cells = table.columns[column].cells
            if cells.size == out.size:
                name = table.columns[column].name.lower()
                place, kinds = pd.factorize(cells, use_na_sentinel=False)
                bad = self._bad_kinds([str(kind).strip().casefold() for kind in kinds], name)
                if bad is not None:
                    out |= bad[place]
                elif kinds.size > 1 and "status" not in name:
                    warn_caller(
                        f"{table.path}: the codes of {table.title(column)} are not known, such as "
                        f"{cells[0]}; good= tells the good ones, quality=None ignores them"
                    )
        return out

    def _bad_kinds(self, words: list[str], name: str) -> BoolArray | None:
        """Which words in a column are bad; None if they say nothing."""
        codes = np.array([_code(word) for word in words])
        if self.good:
            good = [word.casefold() for word in self.good]
            numbers = [_code(word) for word in good]
            fine = np.isin(codes, numbers) | np.array([word in good for word in words], dtype=bool)
            return np.asarray(~fine)
        flags = {} if "status" in name else _FLAGS
        bad = np.array([flags.get(word, _is_bad(word)) for word in words], dtype=bool)
        if np.isnan(codes).all():
            return bad
        by_code = codes == 0 if "good" in name else _bad_codes(codes)
        if by_code is None:
            return bad if bad.any() else None
        return np.asarray(by_code | bad)


def rules_of(keep: bool, na_values: object, quality: str | int | None, good: object) -> Rules:
    """Check the arguments of a reading function.

    Raises
    ------
    OptionError
    """
    if quality is not None and (isinstance(quality, bool) or not isinstance(quality, str | int)):
        raise OptionError(
            f"quality={quality!r}; expected the name or number of a column, 'auto' or None"
        )
    return Rules(keep, _words(na_values, "na_values"), quality, _words(good, "good"))


@lru_cache(maxsize=4096)  # each column of a file asks for the names of all others
def _plain(name: str) -> str:
    """Reduce a tag for comparison: all of its parts, without marks between them."""
    return " ".join(re.sub(r"[^\w%°]|_", " ", name.lower()).split())


def _tags(name: str) -> list[str]:
    """Names of a signal, with and without its unit and the word value at its end."""
    return [re.sub(r" (value|val)$", "", _plain(one)) for one in (split_unit(name)[0], name)]


def _qualities(table: Table) -> dict[int, str]:
    """Columns of qualities and the signal of each: "" for all of them."""
    found: dict[int, str] = {}
    for k, column in enumerate(table.columns):
        name = _plain(column.name)
        if (ending := _QUALITY.search(name)) is not None:
            found[k] = name[: ending.start()].strip()
    bare = [k for k, tag in found.items() if not tag]
    if len(bare) > 1:
        # each stands at the right of its signal
        found |= {k: _tags(table.columns[max(k - 1, 0)].name)[0] for k in bare}
    return found


def _code(word: str) -> float:
    """Number of a code, decimal or hexadecimal; NaN if it is none."""
    if re.fullmatch(r"0x[0-9a-f]{1,8}", word):
        return float(int(word, 16))
    return number_of(word, ".")


def _bad_codes(codes: FloatArray) -> BoolArray | None:
    """Which codes are bad, by the system that has such codes; None if there is none."""
    if not np.all(np.isnan(codes) | (np.trunc(codes) == codes) & (np.abs(codes) < 2**32)):
        return None
    whole = np.nan_to_num(codes).astype(np.int64)
    if np.any(np.abs(whole) >= 2**16):
        return np.asarray(whole >> 31 & 1 == 1)
    low = whole & 0xFF
    if np.any((whole > 0) & (low >= _GOOD) & (low < _SYSTEM_STATES)):
        vendors = (whole > 0xFF) & (low != _GOOD) & (low != _FORCED)
        return np.asarray(~np.isnan(codes) & ((whole < _UNCERTAIN) | vendors))
    return np.asarray(whole != 0) if np.any(whole >= _SYSTEM_STATES) else None


def _is_bad(word: str) -> bool:
    return word in BAD_VALUES or word.startswith(("bad", "error"))


def _words(given: object, name: str) -> tuple[str, ...]:
    if given is None:
        return ()
    if isinstance(given, str | Real):
        several: tuple[Any, ...] = (given,)
    else:
        several = tuple(given) if isinstance(given, Iterable) else (None,)
    if not all(isinstance(word, str | Real) for word in several):
        raise OptionError(f"{name}={given!r}; expected a word or number, or several")
    return tuple(word if isinstance(word, str) else f"{float(word):.17g}" for word in several)
