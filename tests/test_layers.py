"""Folders are floors, their wings are named by topic: imports go strictly down."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import ctrl_realize as cr

PACKAGE = Path(cr.__file__).parent
MOST_MODULES = 16

# From the ground up. Folders on one floor do not import one another.
FLOORS = [
    {"errors"},
    {"_checks", "_shown", "numerics"},
    {"_wording", "paper"},
    {"_parameters"},
    {"results"},
    {"data"},
    {"delayed", "actuators"},
    {"frequency", "bench"},
    {"identification"},
    {"design", "validation"},
    {"io"},
    {"valves", "datasets"},
    {"plots", "export"},
    {"report"},
    {"cli"},
    {"__main__", "__init__"},
]
FLOOR = {name: floor for floor, names in enumerate(FLOORS) for name in names}
# The one way up is `Result.plot`, which loads the plots by name when somebody asks for one.

MODULES = sorted(PACKAGE.rglob("*.py"))


def parts_of(path: Path) -> tuple[str, ...]:
    return path.relative_to(PACKAGE).with_suffix("").parts


def imported(path: Path) -> set[tuple[str, ...]]:
    """Modules of the package that a file imports, at top level or inside functions."""
    package = ["ctrl_realize", *path.relative_to(PACKAGE).parent.parts]
    known = {parts_of(module) for module in MODULES}
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            base += node.module.split(".") if node.module else []
            names = [[*base, alias.name] for alias in node.names]
        for name in names:
            if name[0] != "ctrl_realize":
                continue
            rest = tuple(name[1:])
            targets = (rest, (*rest, "__init__"), rest[:-1], (*rest[:-1], "__init__"))
            found |= {next((target for target in targets if target in known), ("__init__",))}
    return found


IMPORTED = {path: imported(path) for path in MODULES}


def test_imports_between_folders_only_go_down():
    offenders = [
        ("/".join(parts_of(path)), "/".join(target))
        for path, targets in IMPORTED.items()
        for target in targets
        if target[0] != parts_of(path)[0] and FLOOR[target[0]] >= FLOOR[parts_of(path)[0]]
    ]
    assert offenders == []


def wing(parts: tuple[str, ...]) -> str:
    """Folder of a module below a folder of the first floor; a module of its own otherwise."""
    return "/".join(parts[:2])


def test_wings_of_a_folder_do_not_import_one_another_in_a_circle():
    for folder in {parts_of(path)[0] for path in MODULES if len(parts_of(path)) > 1}:
        graph: dict[str, set[str]] = {}
        for path, targets in IMPORTED.items():
            here = parts_of(path)
            if here[0] == folder:
                below = {wing(target) for target in targets if target[0] == folder}
                graph.setdefault(wing(here), set()).update(below - {wing(here)})
        try:
            list(TopologicalSorter(graph).static_order())
        except CycleError as error:
            raise AssertionError(f"{folder}: {' <- '.join(error.args[1])}") from None


def test_modules_do_not_import_one_another_in_a_circle():
    graph = {parts_of(path): targets for path, targets in IMPORTED.items()}
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        raise AssertionError(" <- ".join("/".join(parts) for parts in error.args[1])) from None


def test_a_folder_holds_at_most_sixteen_modules():
    crowded = {
        str(folder.relative_to(PACKAGE.parent)): count
        for folder in {path.parent for path in MODULES}
        if (count := sum(p.name != "__init__.py" for p in folder.glob("*.py"))) > MOST_MODULES
    }
    assert crowded == {}


def test_numerics_know_only_arrays():
    strangers = {"control", "matplotlib", "pandas", "pathlib", "joblib"}
    for path in (PACKAGE / "numerics").rglob("*.py"):
        roots = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                roots |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                roots.add(node.module.split(".")[0])
        assert not roots & strangers, path.name
