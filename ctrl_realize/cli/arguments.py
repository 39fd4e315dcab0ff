"""Keyword arguments of functions as options, from their signatures and numpydoc texts.

The text of a module is read, not the module: importing it takes seconds, see `signatures`.
"""

from __future__ import annotations

import ast
import pkgutil
import re
from collections.abc import Sequence
from enum import Enum
from typing import Annotated, Any

import typer

SPELLED = {
    "output": "--output-column", "start": "--from", "stop": "--to", "header": "--no-header",
    "band_hz": "--band", "fit": "--no-fit",
}  # fmt: skip
"""Options that are not spelled like their argument: ``--output`` is the folder."""
_MORE = {"output": ["--response"]}
_METAVARS = {
    "rest": "INPUT OUTPUT", "band_hz": "LOW HIGH", "command_range": "CLOSED OPEN",
    "travel_range": "CLOSED OPEN", "dead_time": "LOW HIGH", "measured_range": "LOW HIGH",
    "output_range": "LOW HIGH",
}  # fmt: skip
_TYPES = (
    (r"Selector|Structures|Sequence\[str", list[str]), ("Sequence|tuple", tuple[float, float]),
    ("float", float), ("^int", int),
)  # fmt: skip
"""Patterns of annotations -> type of the option; others are text."""


def option_of(argument: str) -> str:
    """Option of an argument."""
    return SPELLED.get(argument, f"--{argument.replace('_', '-')}")


def options_of(file: str, function: str, left_out: str = "") -> dict[str, Any]:
    """Options for the keyword arguments of a function in a file of the package.

    Those that are `left_out`, separated by blanks, have none. An argument that is true by default
    becomes an option that begins with ``no``.

    Examples
    --------
    >>> from ctrl_realize.cli.arguments import options_of
    >>> options = options_of("io/frf.py", "read_frf")
    >>> options["phase_unit"].__metadata__[0].help
    'deg or rad.'
    """
    text = (pkgutil.get_data("ctrl_realize", file) or b"").decode("utf-8")
    node = next(
        part
        for part in ast.walk(ast.parse(text))
        if isinstance(part, ast.FunctionDef) and part.name == function
    )
    said = _descriptions(ast.get_docstring(node) or "")
    options = {}
    for argument, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True):
        name, kind = argument.arg, ast.unparse(argument.annotation or ast.Constant(None))
        if name not in left_out.split():
            value = ast.unparse(default or ast.Constant(None))
            denied = kind.startswith("bool") and value != "False"
            options["no_" * denied + name] = _option(name, kind, *said.get(name, ((), "")))
    return options


def _option(name: str, kind: str, choices: Sequence[str], said: str) -> Any:
    found: Any = next((type_ for pattern, type_ in _TYPES if re.search(pattern, kind)), str)
    if kind.startswith("bool"):
        found = bool
    elif choices:
        found = _choice(choices)
    return Annotated[
        found if found is bool else found | None,
        typer.Option(
            *(option_of(name), *_MORE.get(name, ())),
            help=f"{said.rstrip('.')}; repeatable." if found == list[str] else said,
            min=0 if found is int else None,
            metavar=_METAVARS.get(name),
        ),
    ]


def _choice(values: Sequence[str]) -> Any:
    return Enum("Choice", {value: value for value in values}, type=str)


def _descriptions(docstring: str) -> dict[str, tuple[list[str], str]]:
    """Choices and first sentence for each parameter, without the marks of numpydoc.

    Choices stand in braces; None is the word "none".
    """
    section = re.search(r"\nParameters\n-+\n(.*?)\n\n\w+\n---", docstring, re.DOTALL)
    said = {}
    for names, kind, text in re.findall(
        r"^(\w[\w, ]*)(?: : (.*))?\n((?:    .*\n?)+)", section[1] if section else "", re.MULTILINE
    ):
        braces = re.match(r"\{.*?\}", kind)
        choices = ast.literal_eval(f"[{braces[0][1:-1]}]") if braces else []
        sentence = re.split(r"(?<=\.)\s", " ".join(text.split()))[0]
        plain = sentence.replace('``"', "").replace('"``', "").replace("`", "")
        for name in names.split(", "):
            said[name] = [value or "none" for value in choices], plain.removeprefix("False: ")
    return said
