#!/usr/bin/env python3
"""Measure the size of the package, and of the path of one identification through it.

    python tools/house.py            print the figures beside the stored ones
    python tools/house.py --store    store them, after they have fallen

Code lines are those without docstrings, comments, blank lines and imports. The path is that of
``identify`` of one simulated step record: modules and functions that are entered, types of the
package that are passed as arguments, and named constants of those modules. ``tests/test_house.py``
lets the stored figures fall and never rise.
"""

from __future__ import annotations

import ast
import io
import json
import re
import sys
import tokenize
from functools import cache
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "ctrl_realize"
STORED = Path(__file__).with_name("house.json")
WINGS = (
    "numerics/engine", "numerics/output_error", "numerics/actuated", "numerics/rational",
    "numerics/joint", "numerics/families", "identification/output_error", "identification/joint",
    "frequency/frf_fit.py", "frequency/frf_selection.py",
)  # fmt: skip
"""Folders and files of the estimates that have one engine in common, or will have."""
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*$")
_SILENT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
           tokenize.ENCODING, tokenize.ENDMARKER}  # fmt: skip


@cache
def code_lines(path: Path) -> int:
    """Lines of a file that hold code."""
    text = path.read_text(encoding="utf-8")
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _SILENT:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        words = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            words and isinstance(node.value.value, str)
        ):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def constants(path: Path) -> int:
    """Named numbers on the first level of a module."""
    found = 0
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
        numbers = any(
            isinstance(n, ast.Constant) and isinstance(n.value, int | float) for n in ast.walk(node)
        )
        found += sum(bool(CONSTANT.match(name)) for name in names) if numbers else 0
    return found


def path_of_identify() -> dict[str, int]:
    """Follow one step record through the package."""
    import ctrl_realize as cr

    record = cr.bench.valve().step_record(16, rng=5)
    cr.identify(record)  # whatever is loaded at the first use is loaded
    modules: set[str] = set()
    functions: set[tuple[str, int]] = set()
    types: set[type] = set()

    def entered(frame: FrameType, event: str, _: object) -> None:
        file = frame.f_code.co_filename
        if event != "call" or not file.startswith(str(PACKAGE)):
            return
        modules.add(file)
        if frame.f_code.co_name.startswith("<"):
            return
        functions.add((file, frame.f_code.co_firstlineno))
        code = frame.f_code
        for name in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]:
            kind = type(frame.f_locals.get(name))
            if kind.__module__.startswith("ctrl_realize"):
                types.add(kind)

    sys.settrace(entered)  # of calls alone
    try:
        cr.identify(record)
    finally:
        sys.settrace(None)
    return {
        "modules on the path of identify": len(modules),
        "functions on the path of identify": len(functions),
        "types passed on the path of identify": len(types),
        "constants on the path of identify": sum(constants(Path(m)) for m in modules),
    }


def sizes() -> dict[str, int]:
    """Code lines of the package and of the estimates."""
    files = sorted(PACKAGE.rglob("*.py"))
    wings = [f for f in files if f.relative_to(PACKAGE).as_posix().startswith(WINGS)]
    return {
        "code lines": sum(map(code_lines, files)),
        "code lines of the estimates": sum(map(code_lines, wings)),
        "modules": sum(f.name != "__init__.py" for f in files),
    }


def main() -> None:
    found = {**sizes(), **path_of_identify()}
    stored = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    for name, value in found.items():
        print(f"{name:40}{value:8}   stored {stored.get(name, '-')}")
    if "--store" in sys.argv:
        STORED.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
