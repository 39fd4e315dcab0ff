#!/usr/bin/env python3
"""Set up the project and run one of its tasks; needs nothing but Python 3.11 or newer.

    python3 tools/dev.py demo     the simulated valve, end to end, with report, in demo-output/
    python3 tools/dev.py test     lint, type check, spelling, tests, doctests and notebooks
    python3 tools/dev.py lint     lint, type check and spelling only
    python3 tools/dev.py docs     build the documentation into docs/_build/html
    python3 tools/dev.py setup    make .venv and install, nothing else

Everything is installed into .venv in the project's folder. Further arguments go to the task:
``python3 tools/dev.py test -k delayed``.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
VENV = Path(os.environ.get("CTRL_REALIZE_VENV", ROOT / ".venv"))
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
EXTRAS = {"demo": "", "docs": "[test,docs]", "setup": "[test]", "test": "[test]", "lint": "[test]"}


def started(*command: object, **options: Any) -> subprocess.Popen[str]:
    # One BLAS thread: the matrices are small, and two cores then serve two test workers.
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    environment = {**threads, **os.environ, "MPLBACKEND": "Agg"}
    # Tests start dozens of processes, of which each would compile the package again.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    parts = [str(part) for part in command]
    return subprocess.Popen(parts, cwd=ROOT, env=environment, text=True, **options)


def run(*command: object) -> None:
    code = started(*command).wait()
    if code:
        sys.exit(code)


def make_environment() -> None:
    try:
        venv.create(VENV, with_pip=True)
    except subprocess.CalledProcessError:
        # Debian's Python comes without ensurepip; its own pip can install into the environment.
        venv.create(VENV, with_pip=False, clear=True)


def pip() -> list[object]:
    """Find the pip that installs into the environment: its own, or that of this Python."""
    for command in ([PYTHON, "-m", "pip"], [sys.executable, "-m", "pip", "--python", PYTHON]):
        asked = [str(part) for part in [*command, "--version"]]
        if subprocess.run(asked, capture_output=True, check=False).returncode == 0:
            return list(command)
    sys.exit(
        "this Python has neither ensurepip nor pip; on Debian install python3-venv, then again"
    )


def set_up(extras: str) -> None:
    """Make the virtual environment and install the project, unless both are as they should be."""
    project = hashlib.sha256((ROOT / "pyproject.toml").read_bytes()).hexdigest()
    stamp = VENV / "installed.txt"
    done = stamp.read_text().splitlines() if stamp.exists() else []
    names = set(extras.strip("[]").split(","))
    there = [line.removeprefix(project).strip("[]") for line in done if line.startswith(project)]
    if PYTHON.exists() and any(names <= {"", *one.split(",")} for one in there):
        return
    if not PYTHON.exists():
        print(f"making {VENV}", flush=True)
        make_environment()
    print("installing ctrl_realize and what it needs", flush=True)
    run(*pip(), "install", "--quiet", "--disable-pip-version-check", "--editable", f".{extras}")
    stamp.write_text("\n".join([*done, project + extras]))


def lint() -> None:
    run(PYTHON, "-m", "ruff", "check", ".")
    run(PYTHON, "-m", "ruff", "format", "--check", ".")
    run(PYTHON, "-m", "codespell_lib")


def main(arguments: list[str]) -> None:
    if sys.version_info < (3, 11):  # noqa: UP036 - any Python may be asked to run this file
        sys.exit(f"Python 3.11 or newer is needed, this is {sys.version.split()[0]}")
    task, *rest = arguments or ["help"]
    if task not in EXTRAS:
        print(__doc__)
        sys.exit(0 if task in ("help", "-h", "--help") else 2)
    set_up(EXTRAS[task])
    if task == "demo":
        run(PYTHON, "examples/demo.py", *rest)
    elif task == "docs":
        site = ["-W", "--keep-going", "-b", "html", "docs", "docs/_build/html"]
        run(PYTHON, "-m", "sphinx", *(rest or site))
    elif task == "lint":
        lint()
        run(PYTHON, "-m", "mypy")
    elif task == "test":
        if not rest:
            lint()
            print("mypy runs beside the tests, and is heard of if it finds something", flush=True)
            mypy = started(PYTHON, "-m", "mypy", stdout=subprocess.PIPE)
        # As many as processors: 633 tests took 65 s of 2 processors with 2 workers, 83 with 3.
        count = min(os.cpu_count() or 1, 8)
        workers = ["-n", str(count), "--dist", "worksteal"] if not rest else []
        code = started(PYTHON, "-m", "pytest", *workers, *rest).wait()
        if not rest:
            said = mypy.communicate()[0]
            if mypy.returncode:
                print(said, end="")
                code = code or mypy.returncode
        sys.exit(code)


if __name__ == "__main__":
    main(sys.argv[1:])
