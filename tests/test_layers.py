"""Folders are floors: imports only go down."""

from __future__ import annotations

import ast
from pathlib import Path

import ctrl_realize as cr

PACKAGE = Path(cr.__file__).parent

FLOORS = {
    "errors": 0,
    "checks": 0,
    "wording": 1,
    "numerics": 1,
    "results": 2,
    "signals": 3,
    "delayed": 3,
    "identification": 4,
    "frequency": 4,
    "design": 5,
    "bench": 5,
    "paper": 5,
    "io": 5,
    "plots": 6,
    "report": 7,
    "cli": 8,
    "__main__": 9,
    "__init__": 9,
}

MODULES = sorted(PACKAGE.rglob("*.py"))


def floor_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[0]


def imported_names(path: Path) -> set[str]:
    """Every module that a file imports, at top level or inside functions, as absolute names."""
    package = ["ctrl_realize", *path.relative_to(PACKAGE).parent.parts]
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            if node.module:
                names.add(module)
            names |= {f"{module}.{alias.name}" for alias in node.names}
    return names


def test_imports_only_go_down():
    assert {floor_name(path) for path in MODULES} <= set(FLOORS)
    up = []
    for path in MODULES:
        for parts in (name.split(".") for name in imported_names(path)):
            if (
                parts[0] == "ctrl_realize"
                and FLOORS.get("".join(parts[1:2]), 0) > FLOORS[floor_name(path)]
            ):
                up.append(f"{path.relative_to(PACKAGE)} imports {'.'.join(parts)}")
    assert up == []


def test_numerics_know_only_arrays():
    above = {"control", "matplotlib", "pandas", "pathlib", "joblib"}
    for path in sorted((PACKAGE / "numerics").rglob("*.py")):
        roots = {name.split(".")[0] for name in imported_names(path)}
        assert not roots & above, path.name


def test_only_the_package_face_re_exports_everything():
    # A module that imports from the package's face would hide an upward import.
    offenders = [
        path
        for path in MODULES
        if floor_name(path) not in ("__init__", "__main__", "cli")
        and any(name == "ctrl_realize" for name in imported_names(path))
    ]
    assert offenders == []
