#!/usr/bin/env python3
"""Run the tests against the built wheel in fresh environments; needs nothing but Python 3.11.

    python3 tools/matrix.py                            every row
    python3 tools/matrix.py oldest-3.11 slycot-3.11    only these
    python3 tools/matrix.py packages                   the rows of one group
    python3 tools/matrix.py --list                     which rows there are, and their Pythons
    python3 tools/matrix.py --quick                    without fuzz lane, notebooks, slow tests
    python3 tools/matrix.py kernels --tests tests/host tests/numerics

A row is a set of packages on one Python (group `packages`), a BLAS kernel or a number of threads
(`kernels`), or circumstances of a user: another order of tests, no administrator, a path with
blanks and umlauts, sources that cannot be written, a locale (`users`). The wheel is built once; the
package's sources are then taken out of the copy that holds the tests, so what passes is what a user
installs. Rows with the same packages share one environment. A Python is looked for on the path,
then among pyenv's; a row whose Python or locale is not there is skipped with that word. Fails if a
row fails.
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
FEATURES = """
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__
print(" ".join(name for name in __cpu_dispatch__ if __cpu_features__[name]), end="")
"""
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
    group: str = "packages"
    # Variables beside those that all rows have; ALL stands for what this machine has.
    variables: tuple[tuple[str, str], ...] = ()
    plugin: bool = False
    folder: str = "project"
    ordinary_user: bool = False
    read_only: bool = False

    @property
    def installation(self) -> tuple[object, ...]:
        """What rows with the same environment have in common."""
        return self.minor, self.extras, self.packages, self.folder, self.ordinary_user


def kernel(name: str, **variables: str) -> Row:
    return Row(name, 11, "[test]", group="kernels", variables=tuple(variables.items()))


def user(name: str, **more: object) -> Row:
    return Row(name, 11, "[test]", group="users", **more)


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
GERMAN = "de_DE.UTF-8"
ROWS = [
    *(
        Row(f"newest-3.{minor}", minor, extras="[test]", type_check=True)
        for minor in (11, 12, 13, 14)
    ),
    Row("slycot-3.11", 11, extras="[test,slycot]"),
    # nothing that is optional: the tests of the optional parts have to skip
    Row("plain-3.11", 11, packages=tuple(RUNNERS)),
    Row("oldest-3.11", 11, packages=(*RUNNERS, "-r", str(OLDEST))),
    # OpenBLAS takes the kernel that is named if the processor has its instructions.
    *(
        kernel(f"blas-{name.lower()}", OPENBLAS_CORETYPE=name)
        for name in ("Prescott", "Sandybridge", "Haswell", "SkylakeX", "Zen")
    ),
    kernel("numpy-baseline", NPY_DISABLE_CPU_FEATURES="ALL"),
    kernel("one-thread", **dict.fromkeys(THREADS, "1")),
    kernel("two-threads", **dict.fromkeys(THREADS, "2")),
    user("random-order", plugin=True, variables=(("TESTS_IN_ORDER_OF", "1"),)),
    user("ordinary-user", ordinary_user=True),
    user("blanks-umlauts", folder="Größe und Lage/Prüfstand ä"),
    user("read-only", ordinary_user=True, read_only=True),
    user("locale-c", plugin=True, variables=(("LC_ALL", "C"), ("TESTS_IN_LOCALE", "1"))),
    user("locale-german", plugin=True, variables=(("LC_ALL", GERMAN), ("TESTS_IN_LOCALE", "1"))),
]


@dataclass(frozen=True)
class Outcome:
    """What a row ended with: `word` is pass, FAIL or skip."""

    word: str
    text: str
    versions: tuple[str, ...] = ("",) * len(VERSIONS_OF)
    minutes: float = 0.0


def call(
    *command: object, cwd: Path, variables: dict[str, str] | None = None, ordinary: bool = False
) -> subprocess.CompletedProcess[str]:
    threads = dict.fromkeys(THREADS, "1")
    return subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env={**threads, **os.environ, "MPLBACKEND": "Agg", **(variables or {})},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        **(as_nobody() if ordinary else {}),
    )


def as_nobody() -> dict[str, object]:
    """Arguments that give up an administrator's rights; none where there are none to give up."""
    if not hasattr(os, "geteuid") or os.geteuid():
        return {}
    import pwd  # not on Windows

    nobody = pwd.getpwnam("nobody")
    return {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}


def interpreter(minor: int, ordinary: bool = False) -> str | None:
    """Find a Python 3.`minor` that runs and can make environments: on the path, then pyenv's."""
    name = f"python3.{minor}"
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    on_path = [Path(folder) / name for folder in os.get_exec_path()]
    of_pyenv = sorted(pyenv.glob(f"3.{minor}.*/bin/{name}"), reverse=True)
    for candidate in filter(Path.exists, [*on_path, *of_pyenv]):
        # pyenv's own links stand on the path for every version, and run for the chosen one only
        try:
            tried = call(candidate, "-c", "import venv", cwd=Path("/"), ordinary=ordinary)
        except PermissionError:
            continue
        if tried.returncode == 0:
            return str(candidate)
    return None


def snapshot(folder: Path) -> tuple[Path, Path]:
    """Copy the project, build its wheel, take the sources away; return wheel and copy."""
    copy = folder / "project"
    shutil.copytree(ROOT, copy, ignore=GENERATED)
    built = call(
        sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, copy, cwd=folder
    )
    if built.returncode:
        sys.exit(built.stderr)
    for left in ("ctrl_realize", "build", "ctrl_realize.egg-info"):
        shutil.rmtree(copy / left, ignore_errors=True)
    return next(folder.glob("*.whl")), copy


def install(row: Row, python: str, wheel: Path, folder: Path) -> tuple[Path, str]:
    """Make the row's environment, unless a row before it did; return its Python, and trouble."""
    inside = folder / "bin" / "python"
    if inside.exists():
        return inside, ""
    # The pip that runs this script serves all of them: Debian's Python has none to put there.
    made = call(python, "-m", "venv", "--without-pip", folder, cwd=wheel.parent)
    if made.returncode:
        return inside, made.stdout + made.stderr
    done = call(
        sys.executable, "-m", "pip", "--python", inside, "install", "--quiet",
        "--disable-pip-version-check", "--no-compile", f"{wheel}{row.extras}", *row.packages,
        cwd=wheel.parent,
    )  # fmt: skip
    return inside, done.stderr if done.returncode else ""


def environment_of(row: Row, base: Path) -> Path:
    """Folder of the row's environment, which rows with the same share."""
    if row.folder != "project":
        return (base / row.name / row.folder).parent / "environment"
    different = list(dict.fromkeys(other.installation for other in ROWS))
    return base / f"environment-{different.index(row.installation)}"


def place(row: Row, copy: Path, base: Path) -> Path:
    """Copy the tests to where the row wants them, with the measured records beside them."""
    where = base / row.name / row.folder
    shutil.copytree(copy, where)
    shared = ROOT.parent / "shared"
    if shared.is_dir():
        (where.parent / "shared").symlink_to(shared)
    if row.read_only:
        for path in [where, *where.rglob("*")]:
            path.chmod(0o555 if path.is_dir() else 0o444)
    elif row.ordinary_user and (rights := as_nobody()):
        for path in [where, *where.rglob("*")]:
            os.chown(path, int(rights["user"]), int(rights["group"]))
    return where


def conditions(row: Row, inside: Path, where: Path, base: Path) -> dict[str, str]:
    """Variables of the row; raises LookupError for what this machine has not."""
    variables = dict(row.variables)
    if row.plugin:
        variables["PYTHONPATH"] = str(where / "tools")
    if row.ordinary_user:
        home = base / f"home of {row.name}"
        home.mkdir(exist_ok=True)
        if rights := as_nobody():
            os.chown(home, int(rights["user"]), int(rights["group"]))
        variables["HOME"] = str(home)
    if variables.get("NPY_DISABLE_CPU_FEATURES") == "ALL":
        variables["NPY_DISABLE_CPU_FEATURES"] = call(inside, "-c", FEATURES, cwd=base).stdout
    if variables.get("LC_ALL") == GERMAN:
        (base / "locales").mkdir(exist_ok=True)
        made = call(
            "localedef", "-i", "de_DE", "-f", "UTF-8", base / "locales" / GERMAN, cwd=base
        ) if shutil.which("localedef") else None  # fmt: skip
        if made is None or made.returncode:
            raise LookupError(f"the locale {GERMAN} is absent")
        variables["LOCPATH"] = str(base / "locales")
    return variables


def run(
    row: Row, python: str, wheel: Path, copy: Path, options: tuple[object, ...], log: Path | None
) -> Outcome:
    """Install the wheel, check that it is the one that is imported, run pytest with options."""
    started = time.monotonic()
    base = wheel.parent
    environment = environment_of(row, base)
    environment.parent.mkdir(parents=True, exist_ok=True)
    inside, trouble = install(row, python, wheel, environment)
    if trouble:
        return Outcome("FAIL", trouble[-2000:])
    where = place(row, copy, base)
    try:
        variables = conditions(row, inside, where, base)
    except LookupError as error:
        return Outcome("skip", str(error))
    how = {"cwd": where, "variables": variables, "ordinary": row.ordinary_user}
    versions = tuple(call(inside, "-c", VERSIONS, **how).stdout.split())
    imported = call(inside, "-c", WHERE, **how).stdout
    if not Path(imported).is_relative_to(environment):
        return Outcome("FAIL", f"imported from {imported}", versions)
    done = call(
        inside, "-m", "pytest", "-q", "--dist", "worksteal", "--durations", "25",
        "-p", "no:cacheprovider", *(("-p", "conditions") if row.plugin else ()), *options, **how,
    )  # fmt: skip
    if log is not None:
        log.mkdir(parents=True, exist_ok=True)
        (log / f"{row.name}.txt").write_text(done.stdout + done.stderr)
    lines = [line for line in done.stdout.splitlines() if line.strip()] or [done.stderr[-500:]]
    broken = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    good = done.returncode == 0
    if row.type_check:
        checked = call(inside, "-m", "mypy", "tests/typing/user.py", **how)
        good = good and checked.returncode == 0
        broken += checked.stdout.splitlines() if checked.returncode else []
    counts = re.sub(r"^=+ | in [\d.]+s.*$", "", lines[-1])
    counts += ", types checked" if row.type_check else ""
    if row.read_only:
        for path in [where, *where.rglob("*")]:
            path.chmod(0o755)
    shutil.rmtree(base / row.name)
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
    parser.add_argument("rows", nargs="*", help="names of rows or groups; all without")
    parser.add_argument("--list", action="store_true", help="name the rows and their Pythons")
    parser.add_argument("--quick", action="store_true", help="leave the longest tests out")
    parser.add_argument("--tests", nargs="+", help="only these files or folders, no doctests")
    parser.add_argument("--workers", type=int, default=2, help="test processes (2)")
    parser.add_argument("--log", type=Path, help="folder for the full output of each row")
    asked = parser.parse_args()
    names = {word for row in ROWS for word in (row.name, row.group)}
    if strange := set(asked.rows) - names:
        parser.error(f"no row {', '.join(sorted(strange))}; there are {', '.join(sorted(names))}")
    rows = [row for row in ROWS if not asked.rows or {row.name, row.group} & set(asked.rows)]
    kinds = {(row.minor, row.ordinary_user) for row in rows}
    pythons = {kind: interpreter(*kind) for kind in sorted(kinds)}
    if asked.list:
        for row in rows:
            python = pythons[row.minor, row.ordinary_user] or "absent"
            print(f"{row.group:9} {row.name:15} {python}")
        return
    options = (
        *("-n", asked.workers),
        *(QUICK if asked.quick else ()),
        *(asked.tests or ("tests", "--pyargs", "ctrl_realize")),
    )
    outcomes: dict[str, Outcome] = {}
    with tempfile.TemporaryDirectory() as temporary:
        os.chmod(temporary, 0o755)  # for the rows of an ordinary user
        wheel, copy = snapshot(Path(temporary))
        for at, row in enumerate(rows):
            python = pythons[row.minor, row.ordinary_user]
            if python is None:
                outcomes[row.name] = Outcome("skip", f"Python 3.{row.minor} is absent")
            else:
                outcomes[row.name] = run(row, python, wheel, copy, options, asked.log)
            print(f"{outcomes[row.name].word}  {row.name}: {outcomes[row.name].text}", flush=True)
            if all(other.installation != row.installation for other in rows[at + 1 :]):
                shutil.rmtree(environment_of(row, Path(temporary)), ignore_errors=True)
    print(f"\n{table(outcomes)}")
    sys.exit(any(outcome.word == "FAIL" for outcome in outcomes.values()))


if __name__ == "__main__":
    main()
