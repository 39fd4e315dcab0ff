"""Programs as C, Python and Structured Text (IEC 61131-3)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .names import plain
from .program import If, Program, Statement, Variable, literal

C_TYPES = {"real": "double", "integer": "long", "boolean": "int"}
PYTHON_ZERO = {"real": "0.0", "integer": "0", "boolean": "False"}


class _Syntax(NamedTuple):
    """How a language writes conditions and assignments, and which of the names."""

    condition: str
    otherwise: str
    end: list[str]
    negation: str
    assignment: str
    names: Mapping[str, str]

    def lines(self, statements: Sequence[Statement], depth: int = 0) -> list[str]:
        """Write statements, indented by `depth`."""
        lines = []
        for each in statements:
            if isinstance(each, If):
                condition = (self.negation if each.negated else "") + self.named(each.condition)
                lines += [self.condition.format(condition), *self.lines(each.then, 1)]
                if each.otherwise:
                    lines += [self.otherwise, *self.lines(each.otherwise, 1)]
                lines += self.end
            else:
                both = self.named(each.target), self.named(each.expression)
                lines.append(self.assignment.format(*both))
        return [f"{'    ' * depth}{line}" for line in lines]

    def named(self, text: str) -> str:
        """Replace the names in an expression."""
        return re.sub(r"\b[a-z_]\w*\b", lambda found: self.names.get(found[0], found[0]), text)


def structured_text(program: Program, real: str = "LREAL") -> str:
    """Function block in Structured Text; `real` is the type of all numbers."""
    types = {"real": real, "integer": "DINT", "boolean": "BOOL"}

    def declared(word: str, variables: tuple[Variable, ...], *, values: bool = False) -> list[str]:
        if not variables:
            return []
        lines = [word]
        for each in variables:
            kind = types[each.kind]
            if each.length:
                kind = f"ARRAY[0..{each.length - 1}] OF {kind}"
            start = f" := {literal(each.value)}" if values else ""
            comment = f" (* {plain(each.words)} *)" if each.words else ""
            lines.append(f"    {each.name} : {kind}{start};{comment}")
        return [*lines, "END_VAR"]

    syntax = _Syntax("IF {} THEN", "ELSE", ["END_IF;"], "NOT ", "{} := {};", {"true": "TRUE"})
    lines = [f"(* {plain(line)} *)" for line in program.words]
    lines.append(f"FUNCTION_BLOCK {program.name}")
    lines += declared("VAR_INPUT", program.inputs)
    lines += declared("VAR_OUTPUT", program.outputs)
    lines += declared("VAR CONSTANT", program.constants, values=True)
    lines += declared("VAR", program.states + program.scratch)
    lines += ["", *syntax.lines(program.body)]
    return "\n".join([*lines, "END_FUNCTION_BLOCK", ""])


def c_header(program: Program) -> str:
    """Declarations for C."""
    guard = f"{program.name.upper()}_H"
    lines = [f"/* {plain(line)} */" for line in program.words]
    lines += [f"#ifndef {guard}", f"#define {guard}", "", "typedef struct {"]
    for each in program.states:
        size = f"[{each.length}]" if each.length else ""
        lines.append(f"    {C_TYPES[each.kind]} {each.name}{size}; /* {plain(each.words)} */")
    if not program.states:
        lines.append("    int unused; /* C has no empty structures */")
    # the sketch of an Arduino is C++
    begin, end = (["", "#ifdef __cplusplus", to, "#endif"] for to in ('extern "C" {', "}"))
    lines += [f"}} {program.name}_state;", *begin]
    lines += [f"void {program.name}_init({program.name}_state *s);", f"{_c_signature(program)};"]
    return "\n".join([*lines, *end, "", "#endif", ""])


def c_source(program: Program, header: str) -> str:
    """Definitions for C (C89); `header` is the name of the file of the declarations."""
    several = {each.name for each in program.outputs} if len(program.outputs) > 1 else set()
    upper = {each.name: each.name.upper() for each in program.constants}
    names = upper | {name: f"(*{name})" for name in several}
    names |= {each.name: f"s->{each.name}" for each in program.states} | {"true": "1"}
    syntax = _Syntax("if ({}) {{", "} else {", ["}"], "!", "{} = {};", names)
    lines = [f"/* {plain(line)} */" for line in program.words]
    lines += ["#include <string.h>", f'#include "{header}"', ""]
    for each in program.constants:
        comment = f" /* {plain(each.words)} */" if each.words else ""
        lines.append(f"static const double {upper[each.name]} = {literal(each.value)};{comment}")
    lines += ["", f"void {program.name}_init({program.name}_state *s)", "{"]
    lines += ["    memset(s, 0, sizeof *s);", "}", "", _c_signature(program), "{"]
    local = [*program.scratch, *(program.outputs if not several else ())]
    lines += [f"    {C_TYPES[each.kind]} {each.name};" for each in local]
    lines += ["", *syntax.lines(program.body, 1)]
    if not program.states:
        lines.append("    (void)s;")
    if not several:
        lines.append(f"    return {program.outputs[0].name};")
    return "\n".join([*lines, "}", ""])


def _c_signature(program: Program) -> str:
    given = [f"{program.name}_state *s"]
    given += [f"{C_TYPES[each.kind]} {each.name}" for each in program.inputs]
    if len(program.outputs) == 1:
        return f"double {program.name}_step({', '.join(given)})"
    given += [f"double *{each.name}" for each in program.outputs]
    return f"void {program.name}_step({', '.join(given)})"


def python_class(program: Program) -> str:
    """Class in plain Python, without further packages."""
    own = {each.name: f"self.{each.name}" for each in (*program.states, *program.constants)}
    syntax = _Syntax("if {}:", "else:", [], "not ", "{} = {}", own | {"true": "True"})
    first, *more = map(plain, program.words)
    lines = [f'"""{first}."""', "", "", f"class {program.name}:", f'    """{first}.', ""]
    lines += [*(f"    {line}" for line in more), '    """', ""]
    for each in program.constants:
        lines.append(f"    {each.name} = {literal(each.value)}  # {plain(each.words)}")
    lines += [*([""] if program.constants else []), "    def __init__(self):"]
    for each in program.states:
        start = f"[0.0] * {each.length}" if each.length else PYTHON_ZERO[each.kind]
        lines.append(f"        self.{each.name} = {start}")
    if not program.states:
        lines.append("        pass")
    given = [
        f"{each.name}={PYTHON_ZERO[each.kind]}" if each.name.startswith("manual") else each.name
        for each in program.inputs
    ]
    lines += ["", f"    def step(self, {', '.join(given)}):"]
    lines += [f'        """Return {", ".join(each.name for each in program.outputs)}."""']
    lines += syntax.lines(program.body, 2)
    lines.append(f"        return {', '.join(each.name for each in program.outputs)}")
    return "\n".join([*lines, ""])
