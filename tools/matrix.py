#!/usr/bin/env python3
"""Run the tests against the built wheel in fresh environments; needs nothing but Python 3.11.

    python3 tools/matrix.py                            every row
    python3 tools/matrix.py oldest-3.11 slycot-3.11    only these
    python3 tools/matrix.py --list                     which rows there are, and their Pythons
    python3 tools/matrix.py --quick                    without fuzz lane, notebooks, slow tests

A row is a set of packages on one Python. The wheel is built once; the package's sources are then
taken out of the copy that holds the tests, so what passes is what a user installs. A Python is
looked for on the path, then among pyenv's; a row whose Python is not there is skipped with that
word. Fails if a row fails.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
QUICK = ("-m", "not slow", "--ignore", "tests/fuzz", "--ignore", "tests/test_notebooks.py")
OLDEST = ROOT / "tools" / "oldest.txt"
RUNNERS = ["pytest>=8.2", "pytest-xdist", "hypothesis", "mpmath", "nbclient", "ipykernel"]
GENERATED = shutil.ignore_patterns(
    *(".git", ".venv*", ".*_cache", "__pycache__", "*.egg-info", "build", "dist"),
    *("_build", "generated"),
)
VERSIONS_OF = ("numpy", "scipy", "control", "matplotlib", "pandas", "slycot")
WHERE = "import ctrl_realize; print(ctrl_realize.__file__)"
VERSIONS = f"""
from importlib.metadata import PackageNotFoundError, version
for name in {VERSIONS_OF}:
    try:
        print(version(name))
    except PackageNotFoundError:
        print("-")
"""


@dataclass(frozen=True)
class Row:
    """One environment: `extras` of the wheel and `packages` beside it, on Python 3.`minor`."""

    name: str
    minor: int
    extras: str = ""
    packages: tuple[str, ...] = ()
    type_check: bool = False


ROWS = [
    *(Row(f"newest-3.{minor}", minor, extras="[test]", type_check=True) for minor in (11, 12, 13)),
    Row("slycot-3.11", 11, extras="[test,slycot]"),
    # nothing that is optional: the tests of the optional parts have to skip
    Row("plain-3.11", 11, packages=tuple(RUNNERS)),
    Row("oldest-3.11", 11, packages=(*RUNNERS, "-r", str(OLDEST))),
]


@dataclass(frozen=True)
class Outcome:
    """What a row ended with: `word` is pass, FAIL or skip."""

    word: str
    text: str
    versions: tuple[str, ...] = ("",) * len(VERSIONS_OF)
    minutes: float = 0.0


def call(*command: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env={**threads, **os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )


def interpreter(minor: int) -> str | None:
    """Find a Python 3.`minor` that runs and can make environments: on the path, then pyenv's."""
    name = f"python3.{minor}"
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    on_path = [Path(folder) / name for folder in os.get_exec_path()]
    of_pyenv = sorted(pyenv.glob(f"3.{minor}.*/bin/{name}"), reverse=True)
    for candidate in filter(Path.exists, [*on_path, *of_pyenv]):
        # pyenv's own links stand on the path for every version, and run for the chosen one only
        if call(candidate, "-c", "import ensurepip", cwd=ROOT).returncode == 0:
            return str(candidate)
    return None


def snapshot(folder: Path) -> tuple[Path, Path]:
    """Copy the project, build its wheel, take the sources away; return wheel and copy."""
    copy = folder / "project"
    shutil.copytree(ROOT, copy, ignore=GENERATED)
    shared = ROOT.parent / "shared"
    if shared.is_dir():
        (folder / "shared").symlink_to(shared)
    built = call(
        sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, copy, cwd=folder
    )
    if built.returncode:
        sys.exit(built.stderr)
    for left in ("ctrl_realize", "build", "ctrl_realize.egg-info"):
        shutil.rmtree(copy / left, ignore_errors=True)
    return next(folder.glob("*.whl")), copy


def install(row: Row, python: str, wheel: Path, folder: Path) -> tuple[Path, str]:
    """Make the row's environment; return its Python, and what went wrong."""
    inside = folder / "bin" / "python"
    made = call(python, "-m", "venv", folder, cwd=wheel.parent)
    if made.returncode:
        return inside, made.stdout + made.stderr
    done = call(
        inside, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile",
        f"{wheel}{row.extras}", *row.packages, cwd=wheel.parent,
    )  # fmt: skip
    return inside, done.stderr if done.returncode else ""


def run(
    row: Row, python: str, wheel: Path, copy: Path, options: tuple[object, ...], log: Path | None
) -> Outcome:
    """Install the wheel, check that it is the one that is imported, run pytest with options."""
    started = time.monotonic()
    environment = wheel.parent / row.name
    inside, trouble = install(row, python, wheel, environment)
    if trouble:
        return Outcome("FAIL", trouble[-2000:])
    versions = tuple(call(inside, "-c", VERSIONS, cwd=copy).stdout.split())
    where = call(inside, "-c", WHERE, cwd=copy).stdout
    if not Path(where).is_relative_to(environment):
        return Outcome("FAIL", f"imported from {where}", versions)
    done = call(
        inside, "-m", "pytest", "-q", *options, "--dist", "worksteal", "--durations", "25",
        "-p", "no:cacheprovider", "tests", "--pyargs", "ctrl_realize", cwd=copy,
    )  # fmt: skip
    if log is not None:
        log.mkdir(parents=True, exist_ok=True)
        (log / f"{row.name}.txt").write_text(done.stdout + done.stderr)
    lines = [line for line in done.stdout.splitlines() if line.strip()] or [done.stderr[-500:]]
    broken = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    good = done.returncode == 0
    if row.type_check:
        checked = call(inside, "-m", "mypy", "tests/typing/user.py", cwd=copy)
        good = good and checked.returncode == 0
        broken += checked.stdout.splitlines() if checked.returncode else []
    counts = re.sub(r"^=+ | in [\d.]+s.*$", "", lines[-1])
    counts += ", types checked" if row.type_check else ""
    shutil.rmtree(environment)
    minutes = (time.monotonic() - started) / 60
    return Outcome("pass" if good else "FAIL", "\n    ".join([counts, *broken]), versions, minutes)


def table(outcomes: dict[str, Outcome]) -> str:
    head = ("row", "", *VERSIONS_OF, "minutes", "tests")
    lines = [head, ("---",) * len(head)]
    for name, outcome in outcomes.items():
        first = outcome.text.splitlines()[0]
        lines.append((name, outcome.word, *outcome.versions, f"{outcome.minutes:.0f}", first))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", help="names of rows; all without")
    parser.add_argument("--list", action="store_true", help="name the rows and their Pythons")
    parser.add_argument("--quick", action="store_true", help="leave the longest tests out")
    parser.add_argument("--workers", type=int, default=2, help="test processes (2)")
    parser.add_argument("--log", type=Path, help="folder for the full output of each row")
    asked = parser.parse_args()
    names = {row.name for row in ROWS}
    if strange := set(asked.rows) - names:
        parser.error(f"no row {', '.join(sorted(strange))}; there are {', '.join(sorted(names))}")
    pythons = {minor: interpreter(minor) for minor in sorted({row.minor for row in ROWS})}
    rows = [row for row in ROWS if not asked.rows or row.name in asked.rows]
    if asked.list:
        for row in rows:
            print(f"{row.name:12} {pythons[row.minor] or 'absent'}")
        return
    options = ("-n", asked.workers, *(QUICK if asked.quick else ()))
    outcomes: dict[str, Outcome] = {}
    with tempfile.TemporaryDirectory() as temporary:
        wheel, copy = snapshot(Path(temporary))
        for row in rows:
            python = pythons[row.minor]
            if python is None:
                outcomes[row.name] = Outcome("skip", f"Python 3.{row.minor} is absent")
            else:
                outcomes[row.name] = run(row, python, wheel, copy, options, asked.log)
            print(f"{outcomes[row.name].word}  {row.name}: {outcomes[row.name].text}", flush=True)
    print(f"\n{table(outcomes)}")
    sys.exit(any(outcome.word == "FAIL" for outcome in outcomes.values()))


if __name__ == "__main__":
    main()
