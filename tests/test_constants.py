"""Every tuned constant of the fits says where it comes from; every rule is asked somewhere."""

import ast
import re
from pathlib import Path

import ctrl_realize
from ctrl_realize.numerics.rules import Rule

PACKAGE = Path(ctrl_realize.__file__).parent
NUMERICS = [
    "engine", "families", "output_error", "joint", "signals", "validation", "hankel",
    "internal_delays",
    "loops", "rational", "regression", "state_space",
]  # fmt: skip
FITS = [".", "output_error", "joint", "state_space_fit", "step"]
FOLDERS = [f"numerics/{name}" for name in NUMERICS] + [f"identification/{name}" for name in FITS]
MODULES = [path for folder in FOLDERS for path in sorted((PACKAGE / folder).glob("*.py"))]


def constants(tree: ast.Module) -> list[tuple[int, ast.Assign | ast.AnnAssign]]:
    """Assignments of numbers to names in capitals, and where they stand in the module."""
    found = []
    for i, node in enumerate(tree.body):
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [
                n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)
            ]
            numbers = [
                n
                for n in ast.walk(node.value)
                if isinstance(n, ast.Constant) and isinstance(n.value, int | float)
            ]
            if numbers and all(name.isupper() for name in names):
                found.append((i, node))
    return found


def test_every_constant_of_the_fits_is_explained():
    bare = []
    for path in MODULES:
        text = path.read_text(encoding="utf-8")
        tree, lines = ast.parse(text), text.splitlines()
        for i, node in constants(tree):
            after = tree.body[i + 1] if i + 1 < len(tree.body) else None
            told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            near = lines[node.lineno - 2 : node.end_lineno]
            if not told and not any("#" in line for line in near):
                bare.append(f"{path.relative_to(PACKAGE)}:{node.lineno}: {lines[node.lineno - 1]}")
    assert not bare, "\n".join(bare)


def test_rules_that_constants_name_are_in_the_table():
    names = {rule.value for rule in Rule}
    unknown = []
    for path in MODULES:
        text = re.sub(r"\s*\n#?\s*", " ", path.read_text(encoding="utf-8"))
        for said in re.findall(r"[Aa]blation(?: of all of them)?: ([^.\";]{3,60})", text):
            if not any(said.startswith(name) for name in names):
                unknown.append(f"{path.name}: {said}")
    assert not unknown, unknown


def test_every_rule_is_asked_somewhere_in_the_package_and_has_a_name_of_its_own():
    source = "\n".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    asked = set(re.findall(r"\bRule\.([A-Z_]+)\.on\b", source))
    assert asked == set(Rule.__members__)
    assert len(Rule) == len(Rule.__members__)  # two of the same value would be one
