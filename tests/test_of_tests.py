"""A test of the tests: they hold the package to its answers, and know nothing of its inside."""

import ast
import importlib.util
import sys
from functools import cache
from pathlib import Path

import ctrl_realize as cr

TESTS = Path(__file__).parent
FAULTS = {
    "ctrl_realize.cli.identify_command.identify_record",  # interrupted by Ctrl-C
    "ctrl_realize.cli.results.report.write_campaign",  # the disk is full
    "ctrl_realize.io.store.write_text",  # the disk is full
    "ctrl_realize.report.build.versions",  # an error within a report
    # no figures: seconds at every call
    "ctrl_realize.report.build.identification_sketches",
    "ctrl_realize.report.build.campaign_sketches",
}
"""Public names that are replaced: faults that cannot be had otherwise."""


@cache
def parsed():
    """Path of a test, and the nodes of its tree."""
    paths = sorted(TESTS.rglob("*.py"))
    trees = ((path.relative_to(TESTS), ast.parse(path.read_text("utf-8"))) for path in paths)
    return [(path, list(ast.walk(tree))) for path, tree in trees]


def private(name):
    """A part of it begins with an underscore, but for words that stand in every report."""
    name = name.removeprefix("ctrl_realize._wording")
    return any(part.startswith("_") and not part.startswith("__") for part in name.split("."))


def test_no_test_imports_a_private_name():
    found = []
    for path, nodes in parsed():
        ours = set()
        for node in nodes:
            if isinstance(node, ast.Import):
                found += [(path, a.name) for a in node.names if private(a.name)]
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ctrl_realize"):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
                found += [(path, name) for name in names if private(name)]
                ours |= {alias.asname or alias.name for alias in node.names}
        for node in nodes:
            if isinstance(node, ast.Attribute) and private(node.attr):
                owner = getattr(node.value, "id", "")
                # a method of a result may be what IPython asks for
                if owner in ours and not node.attr.startswith("_repr_"):
                    found.append((path, f"{owner}.{node.attr}"))
    assert found == []


def test_no_test_replaces_a_part_of_the_package():
    found = []
    for path, nodes in parsed():
        if path.parts[0] == "fuzz":  # leaves out figures, and fits that it has made before
            continue
        ours = {
            alias.asname or alias.name
            for node in nodes
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ctrl_realize")
            for alias in node.names
        } | {"cr", "ctrl_realize"}
        for node in nodes:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                modules = [getattr(node, "module", None) or "", *(a.name for a in node.names)]
                found += [(path, "mock") for name in modules if name.split(".")[-1] == "mock"]
            if not (isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "setattr"):
                continue
            first = node.args[0]
            if isinstance(first, ast.Constant):
                told = str(first.value)
                if told.startswith("ctrl_realize") and told not in FAULTS:
                    found.append((path, told))
            elif {name.id for name in ast.walk(first) if isinstance(name, ast.Name)} & ours:
                found.append((path, ast.unparse(node)))
    assert found == []


def test_every_deliberate_defect_has_its_place_and_tests_that_concern_it():
    path = TESTS.parent / "tools" / "defects.py"
    spec = importlib.util.spec_from_file_location("defects", path)
    sys.modules[spec.name] = tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    package = "\n".join(each.read_text("utf-8") for each in Path(cr.__file__).parent.rglob("*.py"))
    names = " ".join(path.name for path, _ in parsed())
    assert [d.name for d in tool.DEFECTS if package.count(d.old) != 1] == []
    assert [d.name for d in tool.DEFECTS if not any(w in names for w in d.where[0].split())] == []
