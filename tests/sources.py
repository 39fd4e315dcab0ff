"""Modules of the package as syntax trees, which several tests read: parsed once a process."""

import ast
from functools import cache
from pathlib import Path

import ctrl_realize as cr

PACKAGE = Path(cr.__file__).parent


@cache
def parsed() -> dict[Path, ast.Module]:
    """Path below the package -> its tree."""
    return {
        path.relative_to(PACKAGE): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }
