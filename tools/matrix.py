#!/usr/bin/env python3
"""Run the tests against the built wheel in fresh environments: oldest and newest, with slycot.

    python3 tools/matrix.py                 every environment, every Python 3.11+ that is found
    python3 tools/matrix.py oldest newest   only these

The source tree is not on the path: the tests are copied beside the installed wheel. Prints one
line for each environment and fails if one of them does.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RUNNERS = ["pytest>=8.2", "pytest-xdist", "hypothesis", "mpmath", "nbclient", "ipykernel"]
ENVIRONMENTS = {
    "oldest": ["-r", str(ROOT / "tools" / "oldest.txt")],
    "newest": [],
    "slycot": ["slycot"],
    "extras": ["slycot", "pyarrow", "dask[distributed]"],
}


def pythons() -> list[str]:
    """Find the Pythons 3.11 and newer on the path."""
    names = [f"python3.{minor}" for minor in range(11, 20)]
    found = [name for name in names if shutil.which(name)]
    return found or [sys.executable]


def call(*command: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env={**os.environ, "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1", **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def build_wheel(folder: Path) -> Path:
    done = call(
        sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, ROOT, cwd=folder
    )
    if done.returncode:
        sys.exit(done.stderr)
    return next(folder.glob("*.whl"))


def run(python: str, packages: list[str], wheel: Path, folder: Path) -> tuple[bool, str]:
    """Make an environment, install the wheel, run the tests from a copy."""
    if call(python, "-m", "venv", folder / "venv", cwd=folder).returncode:
        return False, f"{python} cannot make a virtual environment"
    inside = folder / "venv" / "bin" / "python"
    installed = call(
        inside, "-m", "pip", "install", "--quiet", wheel, *RUNNERS, *packages, cwd=folder
    )
    if installed.returncode:
        return False, installed.stderr[-500:]
    shutil.copytree(ROOT / "tests", folder / "tests")
    shutil.copytree(ROOT / "notebooks", folder / "notebooks")
    shutil.copy(ROOT / "pyproject.toml", folder)
    shared = ROOT.parent / "shared"
    if shared.is_dir():
        (folder.parent / "shared").unlink(missing_ok=True)
        (folder.parent / "shared").symlink_to(shared)
    done = call(inside, "-m", "pytest", "-q", "-n", "2", "tests", cwd=folder)
    lines = [line for line in done.stdout.splitlines() if line.strip()]
    failures = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    return done.returncode == 0, "\n    ".join([lines[-1] if lines else done.stderr, *failures])


def main(wanted: list[str]) -> None:
    strange = set(wanted) - set(ENVIRONMENTS)
    if strange:
        sys.exit(f"unknown: {', '.join(strange)}; there are {', '.join(ENVIRONMENTS)}")
    good = True
    with tempfile.TemporaryDirectory() as temporary:
        wheel = build_wheel(Path(temporary))
        for python in pythons():
            for name in wanted or ENVIRONMENTS:
                folder = Path(temporary) / f"{python.rsplit('/', 1)[-1]}-{name}"
                folder.mkdir()
                passed, summary = run(python, ENVIRONMENTS[name], wheel, folder)
                good = good and passed
                print(f"{'pass' if passed else 'FAIL'}  {python}  {name}: {summary}", flush=True)
                shutil.rmtree(folder)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main(sys.argv[1:])
