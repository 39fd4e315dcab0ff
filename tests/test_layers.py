"""Folders are floors, their wings are named by topic: imports go strictly down."""

import ast
from collections import Counter
from functools import cache
from graphlib import CycleError, TopologicalSorter
from typing import Any

import pytest

from tests.sources import parsed

MOST_MODULES = 16

# From the ground up. Folders on one floor do not import one another.
FLOORS = [
    {"errors"},
    {"_checks", "_facts", "_shown", "numerics"},
    {"_wording", "paper"},
    {"_parameters", "_flags"},
    {"results"},
    {"data"},
    {"delayed", "actuators"},
    {"frequency", "bench"},
    {"identification"},
    {"design", "validation"},
    {"io"},
    {"experiment"},
    {"valves", "datasets"},
    {"plots", "export"},
    {"report"},
    {"interactive"},
    {"cli"},
    {"__main__", "__init__"},
]
FLOOR = {name: floor for floor, names in enumerate(FLOORS) for name in names}
# The one way up is `Result.plot`, which loads the plots by name when somebody asks for one.


Parts = tuple[str, ...]


@cache
def sources() -> dict[Parts, list[ast.stmt]]:
    """Imports of every module, at top level or inside functions, by the parts of its name."""
    return {
        path.with_suffix("").parts: [
            node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)
        ]
        for path, tree in parsed().items()
    }


def imported(module: Parts) -> set[Parts]:
    """Modules of the package that a module imports."""
    package, known, found = ["ctrl_realize", *module[:-1]], sources(), set()
    for node in known[module]:
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        else:
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


@pytest.fixture(scope="module")
def graph() -> dict[Parts, set[Parts]]:
    """What every module of the package imports of it."""
    return {module: imported(module) for module in sources()}


def test_imports_between_folders_only_go_down(graph):
    offenders = [
        ("/".join(module), "/".join(target))
        for module, targets in graph.items()
        for target in targets
        if target[0] != module[0] and FLOOR[target[0]] >= FLOOR[module[0]]
    ]
    assert offenders == []


def wing(parts: Parts) -> str:
    """Folder of a module below a folder of the first floor; a module of its own otherwise."""
    return "/".join(parts[:2])


def ordered(graph: dict[Any, set[Any]]) -> str:
    """Say where imports go round in a circle."""
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        return " <- ".join(str(one) for one in error.args[1])
    return ""


def test_wings_of_a_folder_do_not_import_one_another_in_a_circle(graph):
    for folder in {module[0] for module in graph if len(module) > 1}:
        wings: dict[str, set[str]] = {}
        for module, targets in graph.items():
            if module[0] == folder:
                below = {wing(target) for target in targets if target[0] == folder}
                wings.setdefault(wing(module), set()).update(below - {wing(module)})
        assert ordered(wings) == "", folder


def test_modules_do_not_import_one_another_in_a_circle(graph):
    assert ordered(graph) == ""


def test_a_folder_holds_at_most_sixteen_modules():
    count = Counter(module[:-1] for module in sources() if module[-1] != "__init__")
    assert {folder: n for folder, n in count.items() if n > MOST_MODULES} == {}


def test_numerics_know_only_arrays():
    strangers = {"control", "matplotlib", "pandas", "pathlib", "joblib"}
    for module, nodes in sources().items():
        names = []
        for node in nodes if module[0] == "numerics" else []:
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif node.module and not node.level:
                names.append(node.module)
        assert not {name.split(".")[0] for name in names} & strangers, module
