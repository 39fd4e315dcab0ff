"""A difference equation as a program for every language: declarations and statements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["real", "integer", "boolean"]


@dataclass(frozen=True)
class Variable:
    """A variable of a program; `length` > 0 for an array, `words` for the comment beside it."""

    name: str
    words: str = ""
    kind: Kind = "real"
    value: float = 0.0
    length: int = 0


@dataclass(frozen=True)
class Assign:
    """``target := expression``; both in the notation that all languages share."""

    target: str
    expression: str


@dataclass(frozen=True)
class If:
    """Statements under a condition: a boolean, its negation, or a comparison of two numbers."""

    condition: str
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()
    negated: bool = False


Statement = Assign | If


@dataclass(frozen=True)
class Program:
    """One step of a difference equation.

    Attributes
    ----------
    name : str
        Identifier in all languages.
    words : tuple of str
        Lines of the comment at its head.
    inputs, outputs, states : tuple of Variable
        `states` keep their values from call to call.
    body : tuple of Statement
    constants, scratch : tuple of Variable
    """

    name: str
    words: tuple[str, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    states: tuple[Variable, ...]
    body: tuple[Statement, ...]
    constants: tuple[Variable, ...] = ()
    scratch: tuple[Variable, ...] = ()


def literal(value: float) -> str:
    """Write a number with all digits, as C, Python and IEC 61131-3 all read it.

    Examples
    --------
    >>> from ctrl_realize.export.program import literal
    >>> literal(2), literal(1e-5), literal(-0.1)
    ('2.0', '1.0E-05', '-0.1')
    """
    mantissa, _, exponent = repr(float(value)).partition("e")
    if "." not in mantissa:
        mantissa += ".0"
    return f"{mantissa}E{exponent}" if exponent else mantissa


def weighted_sum(weights: list[float], names: list[str]) -> str:
    """Write ``w1 * x1 + w2 * x2 - ...`` without the terms of weight zero.

    Examples
    --------
    >>> from ctrl_realize.export.program import weighted_sum
    >>> weighted_sum([-2, 0, 0.5], ["a", "b", "c"])
    '-2.0 * a + 0.5 * c'
    """
    text = ""
    for weight, name in zip(weights, names, strict=True):
        if weight == 0:
            continue
        sign = (" - " if weight < 0 else " + ") if text else ("-" if weight < 0 else "")
        text += f"{sign}{literal(abs(weight))} * {name}"
    return text or "0.0"
