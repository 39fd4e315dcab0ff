"""Programs as C, Python and Structured Text (IEC 61131-3)."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from .names import plain
from .program import If, Program, Statement, Variable, literal

C_TYPES = {"real": "double", "integer": "long", "boolean": "int"}
PYTHON_ZERO = {"real": "0.0", "integer": "0", "boolean": "False"}


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

    def written(statement: Statement) -> list[str]:
        if isinstance(statement, If):
            condition = ("NOT " if statement.negated else "") + statement.condition
            lines = [f"IF {condition} THEN", *_block(statement.then, written)]
            if statement.otherwise:
                lines += ["ELSE", *_block(statement.otherwise, written)]
            return [*lines, "END_IF;"]
        return [f"{statement.target} := {statement.expression.replace('true', 'TRUE')};"]

    lines = [f"(* {plain(line)} *)" for line in program.words]
    lines.append(f"FUNCTION_BLOCK {program.name}")
    lines += declared("VAR_INPUT", program.inputs)
    lines += declared("VAR_OUTPUT", program.outputs)
    lines += declared("VAR CONSTANT", program.constants, values=True)
    lines += declared("VAR", program.states)
    lines += declared("VAR", program.scratch)
    lines += ["", *[line for each in program.body for line in written(each)]]
    return "\n".join([*lines, "END_FUNCTION_BLOCK", ""])


def c_header(program: Program) -> str:
    """Declarations for C."""
    guard = f"{program.name.upper()}_H"
    lines = [f"/* {plain(line)} */" for line in program.words]
    lines += [f"#ifndef {guard}", f"#define {guard}", "", "typedef struct {"]
    for each in program.states:
        size = f"[{each.length}]" if each.length else ""
        comment = f" /* {plain(each.words)} */" if each.words else ""
        lines.append(f"    {C_TYPES[each.kind]} {each.name}{size};{comment}")
    if not program.states:
        lines.append("    int unused; /* C has no empty structures */")
    lines += [f"}} {program.name}_state;", ""]
    lines += [f"void {program.name}_init({program.name}_state *s);", f"{_c_signature(program)};"]
    return "\n".join([*lines, "", "#endif", ""])


def c_source(program: Program, header: str) -> str:
    """Definitions for C (C89); `header` is the name of the file of the declarations."""
    state = {each.name for each in program.states}
    several = {each.name for each in program.outputs} if len(program.outputs) > 1 else set()
    upper = {each.name: each.name.upper() for each in program.constants}

    def places(text: str) -> str:
        def place(found: re.Match[str]) -> str:
            word = found.group()
            if word == "true":
                return "1"
            if word in state:
                return f"s->{word}"
            return f"(*{word})" if word in several else upper.get(word, word)

        return re.sub(r"\b[a-z_]\w*\b", place, text)

    def written(statement: Statement) -> list[str]:
        if isinstance(statement, If):
            condition = ("!" if statement.negated else "") + places(statement.condition)
            lines = [f"if ({condition}) {{", *_block(statement.then, written)]
            if statement.otherwise:
                lines += ["} else {", *_block(statement.otherwise, written)]
            return [*lines, "}"]
        return [f"{places(statement.target)} = {places(statement.expression)};"]

    lines = [f"/* {plain(line)} */" for line in program.words]
    lines += ["#include <string.h>", f'#include "{header}"', ""]
    for each in program.constants:
        comment = f" /* {plain(each.words)} */" if each.words else ""
        lines.append(f"static const double {upper[each.name]} = {literal(each.value)};{comment}")
    lines += ["", f"void {program.name}_init({program.name}_state *s)", "{"]
    lines += ["    memset(s, 0, sizeof *s);", "}", "", _c_signature(program), "{"]
    local = [*program.scratch, *(program.outputs if not several else ())]
    lines += [f"    {C_TYPES[each.kind]} {each.name};" for each in local]
    lines += ["", *_block(program.body, written)]
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
    own = {each.name for each in (*program.states, *program.constants)}

    def places(text: str) -> str:
        def place(found: re.Match[str]) -> str:
            word = found.group()
            if word == "true":
                return "True"
            return f"self.{word}" if word in own else word

        return re.sub(r"\b[a-z_]\w*\b", place, text)

    def written(statement: Statement) -> list[str]:
        if isinstance(statement, If):
            condition = ("not " if statement.negated else "") + places(statement.condition)
            lines = [f"if {condition}:", *_block(statement.then, written)]
            if statement.otherwise:
                lines += ["else:", *_block(statement.otherwise, written)]
            return lines
        return [f"{places(statement.target)} = {places(statement.expression)}"]

    lines = [f'"""{plain(program.words[0])}."""', "", "", f"class {program.name}:"]
    lines += [f'    """{plain(program.words[0])}.', ""]
    lines += [f"    {plain(line)}" for line in program.words[1:]]
    lines += ['    """', ""]
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
    lines += _block(_block_lines(program.body, written), lambda line: [line], 2)
    lines.append(f"        return {', '.join(each.name for each in program.outputs)}")
    return "\n".join([*lines, ""])


def _block_lines(
    statements: tuple[Statement, ...], written: Callable[[Statement], list[str]]
) -> tuple[str, ...]:
    return tuple(line for each in statements for line in written(each))


def _block(
    statements: tuple[Any, ...], written: Callable[[Any], list[str]], depth: int = 1
) -> list[str]:
    return [f"{'    ' * depth}{line}" for each in statements for line in written(each)]
