"""Read values from JSON with unknown content."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import is_dataclass
from itertools import chain
from typing import Any, cast, get_args, get_type_hints

import numpy as np

from ..actuators import Actuator
from ..actuators.plain import from_plain
from ..errors import FileFormatError
from ..numerics.arrays import FloatArray

MAX_TEXT = 1000


def parsed(text: str) -> Any:
    """Parse JSON; infinite numbers, NaN and keys that occur twice are a ValueError."""
    return json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique_keys)


def field(content: Mapping[str, Any], key: str, kind: Any) -> Any:
    """Return ``content[key]`` if it has the requested type."""
    value = content.get(key)
    if isinstance(value, bool):  # numbers in Python
        raise FileFormatError(f"{key!r} is true or false; expected another type")
    if not isinstance(value, kind) or (isinstance(value, str) and not _is_text(value)):
        raise FileFormatError(f"{key!r} is missing or has the wrong type")
    return value


def of_kind(value: Any, kind: Any) -> Any:
    """Return plain content as the kind that a type annotation names.

    A number is finite, or one of the texts inf, -inf and nan, which JSON has no numbers for; a
    dataclass is the list of its fields in their order, and an `Actuator` that of `to_plain`.

    Raises
    ------
    ValueError, TypeError
        Something else.

    Examples
    --------
    >>> from ctrl_realize.io.json_content import of_kind
    >>> of_kind([1, "inf"], tuple[float, float])
    (1.0, inf)
    """
    parts = get_args(kind)
    if isinstance(value, list | tuple) and is_dataclass(kind):
        made, kinds = cast("Any", kind), [*get_type_hints(kind).values()][: len(value)]
        return made(*(of_kind(one, each) for one, each in zip(value, kinds, strict=True)))
    if isinstance(value, list | tuple) and parts:
        kinds = [parts[0]] * len(value) if parts[-1] is ... else [*parts]
        return tuple(of_kind(one, each) for one, each in zip(value, kinds, strict=True))
    if kind is Actuator:
        return from_plain(value)
    if kind is float and (_is_number(value) or value in ("inf", "-inf", "nan")):
        return float(value)
    if value in parts or type(value) is kind:
        return value
    raise ValueError(f"got {value!r:.80}; expected {getattr(kind, '__name__', kind)}")


def texts(content: Mapping[str, Any], key: str) -> list[str]:
    """Return a list of distinct texts."""
    values: list[Any] = field(content, key, list)
    if not all(isinstance(value, str) and _is_text(value) for value in values):
        raise FileFormatError(f"{key!r} contains something that is not text")
    if len(set(values)) != len(values):
        raise FileFormatError(f"{key!r} contains a name twice")
    return values


def whole_numbers(content: Mapping[str, Any], key: str, count: int) -> list[int]:
    """Return `count` whole numbers, none negative."""
    values: list[Any] = field(content, key, list)
    good = all(type(value) is int and value >= 0 for value in values)
    if not good or len(values) != count:
        raise FileFormatError(f"{key!r} must contain {count} non-negative whole numbers")
    return values


def finite_numbers(content: Mapping[str, Any], key: str) -> list[float]:
    """Return a list of finite numbers, none negative."""
    values: list[Any] = field(content, key, list)
    if not all(_is_number(value) and value >= 0 for value in values):
        raise FileFormatError(f"{key!r} must contain non-negative finite numbers")
    return values


def matrix(content: Mapping[str, Any], key: str, shape: tuple[int, int]) -> FloatArray:
    """Return a matrix of finite numbers from a list of its rows."""
    rows: list[Any] = field(content, key, list)
    good = all(isinstance(row, list) and len(row) == shape[1] for row in rows)
    if not good or len(rows) != shape[0] or not all(map(_is_number, chain(*rows))):
        raise FileFormatError(f"{key!r} must be {shape[0]} rows of {shape[1]} finite numbers")
    return np.array(rows, dtype=np.float64).reshape(shape)


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number; a whole one may exceed the range of doubles."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def _is_text(value: str) -> bool:
    """Refuse very long names, and lone surrogates, which cannot be printed or written."""
    return len(value) <= MAX_TEXT and not any("\ud800" <= letter <= "\udfff" for letter in value)


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a finite number")


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        raise ValueError("a key occurs twice")
    return content
