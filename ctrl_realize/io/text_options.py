"""Options for reading a text table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

from .._checks import integer
from ..errors import OptionError

_IN_NUMBERS = {"delimiter": frozenset("0123456789eE"), "comment": frozenset("0123456789eE.,+-")}
_THOUSANDS = ("", ",", ".", "'", " ")


@dataclass(frozen=True)
class TextOptions:
    """Options for reading a text table; ``"auto"`` is determined from the file."""

    delimiter: str = "auto"
    decimal: str = "auto"
    encoding: str = "auto"
    comment: str | None = "auto"
    header: bool | str = "auto"
    skip_rows: int = 0
    thousands: str | None = "auto"

    @classmethod
    def among(cls, given: Mapping[str, Any]) -> Self:
        """Return those among the arguments of a reading function."""
        return cls(**{one.name: given[one.name] for one in fields(cls) if one.name in given})

    @property
    def notations(self) -> list[str]:
        """Notations of numbers that are tried, see `cells.NUMBER`."""
        decimals = ".," if self.decimal == "auto" else self.decimal
        marks = _THOUSANDS if self.thousands == "auto" else (self.thousands or "",)
        return [sign + mark for mark in marks for sign in decimals if mark != sign]

    def __post_init__(self) -> None:
        for name in ("delimiter", "decimal", "encoding"):
            if not isinstance(getattr(self, name), str):
                raise OptionError(f"{name}={getattr(self, name)!r}; expected text, such as 'auto'")
        if self.decimal not in ("auto", ".", ","):
            raise OptionError(f"decimal={self.decimal!r} must be '.', ',' or 'auto'")
        known = (*_THOUSANDS, "auto", None)
        if self.thousands not in known or self.thousands == self.decimal != "auto":
            raise OptionError(
                f"thousands={self.thousands!r}; expected ',', '.', ' ' or \"'\", another sign than "
                "the decimal one, 'auto' or None"
            )
        for name, mark in (("delimiter", self.delimiter), ("comment", self.comment)):
            single = isinstance(mark, str) and len(mark) == 1 and mark not in "\r\n\"'"
            if not single and mark not in (("auto", None) if name == "comment" else ("auto",)):
                raise OptionError(f"{name}={mark!r} must be one character or 'auto'")
            if str(mark) in _IN_NUMBERS[name]:
                raise OptionError(f"{name}={mark!r} would split numbers")
        if self.header not in (True, False, "auto"):
            raise OptionError(f"header={self.header!r} must be True, False or 'auto'")
        integer(self.skip_rows, "skip_rows", 0)
        if self.encoding != "auto":
            try:
                # also refuses Python's codecs other than text encodings: zlib, rot13
                b"1".decode(self.encoding)
            except UnicodeError:
                pass
            except (LookupError, ValueError, TypeError) as error:
                raise OptionError(f"encoding={self.encoding!r} is not known") from error
