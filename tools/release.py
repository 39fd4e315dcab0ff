#!/usr/bin/env python3
"""Check what a release needs and build it; publishes nothing.

    python -m pip install --group release     build, twine, check-wheel-contents (pip 25.1 or newer)
    python3 tools/release.py                  before the tag: every item, done or open
    python3 tools/release.py --tagged         on the tag, as the release workflow does

Wheel and source distribution are left in dist/, built twice with the time of the last commit
(SOURCE_DATE_EPOCH) and equal to the bit. Ends with 1 if an item is open.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
Item = tuple[str, str]
"""What is asked, and what is open; an empty text if it is done."""


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def call(*command: object, **more: str) -> tuple[int, str]:
    done = subprocess.run(
        [str(part) for part in command], cwd=ROOT, env={**os.environ, **more},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout.strip()


def version() -> str:
    """Return the version; it stands nowhere else."""
    found = re.search(r'^__version__ = "(.+)"$', read("ctrl_realize/__init__.py"), re.M)
    if found is None:
        sys.exit("ctrl_realize/__init__.py has no line __version__ = ...")
    return found[1]


def texts(release: str) -> Iterator[Item]:
    well_formed = re.fullmatch(r"\d+\.\d+\.\d+((a|b|rc)\d+)?", release)
    yield (
        f"version {release}",
        "" if well_formed else "expected a version such as 1.2.3 or 1.2.3rc1",
    )
    cited = re.search(r"^version: (.+)$", read("CITATION.cff"), re.M)
    same = cited is not None and cited[1].strip("\"'") == release
    yield "CITATION.cff has that version", "" if same else f"it has {cited and cited[1]}"
    newest = re.search(r"^## (.+)$", read("CHANGELOG.md"), re.M)
    heading = newest[1] if newest else ""
    dated = re.fullmatch(rf"{re.escape(release)} \(\d{{4}}-\d\d-\d\d\)", heading)
    wanted = f"its first heading is {heading!r}; expected '{release} (year-month-day)'"
    yield "the changelog begins with that version and its date", "" if dated else wanted
    urls = tomllib.loads(read("pyproject.toml"))["project"].get("urls", {})
    filled = urls and all(address.startswith("https://") for address in urls.values())
    yield "addresses of the project", "" if filled else "fill in [project.urls] in pyproject.toml"


def repository(release: str, tagged: bool) -> Iterator[Item]:
    code, changed = call("git", "status", "--porcelain")
    yield "nothing but what is committed", changed if code or changed else ""
    tag = f"v{release}"
    code, there = call("git", "tag", "--list", tag)
    if tagged:
        here = call("git", "tag", "--points-at", "HEAD")[1].split()
        yield f"this commit has the tag {tag}", "" if tag in here else f"it has {here or 'none'}"
    else:
        free = code == 0 and not there
        yield f"the tag {tag} is free", "" if free else there or "git does not answer"


def _left_out(files: list[Path]) -> str:
    """Files of the repository that the source distribution has not, or has beyond it."""
    source = next(path for path in files if path.name.endswith(".tar.gz"))
    with tarfile.open(source) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()} - {"PKG-INFO"}
    code, said = call("git", "ls-files")
    if code:
        return said
    kept = {name for name in said.splitlines() if not name.startswith(".ci/")}
    differ = [f"no {name}" for name in sorted(kept - inside)] + sorted(inside - kept)
    return ", ".join(differ)


def built(release: str) -> Iterator[Item]:
    """Build twice, keep the first, and look into it."""
    code, seconds = call("git", "log", "-1", "--format=%ct")
    epoch = seconds if code == 0 and seconds.isdigit() else "315532800"
    shutil.rmtree(DIST, ignore_errors=True)
    with tempfile.TemporaryDirectory() as again:
        for folder in (DIST, Path(again)):
            code, said = call(
                sys.executable, "-m", "build", "--outdir", folder, SOURCE_DATE_EPOCH=epoch
            )
            if code:
                yield "wheel and source distribution", said[-1500:]
                return
        sums = [
            {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}
            for folder in (DIST, Path(again))
        ]
    names = sorted(sums[0])
    wanted = [f"ctrl_realize-{release}-py3-none-any.whl", f"ctrl_realize-{release}.tar.gz"]
    yield "wheel and source distribution", "" if names == wanted else f"got {names}"
    yield "two builds are equal to the bit", "" if sums[0] == sums[1] else f"{sums}"
    files = sorted(DIST.iterdir())
    code, said = call(sys.executable, "-m", "twine", "check", "--strict", *files)
    yield "twine check --strict", said if code else ""
    wheel = next(path for path in files if path.suffix == ".whl")
    code, said = call(sys.executable, "-m", "check_wheel_contents", wheel)
    yield "check-wheel-contents", said if code else ""
    with zipfile.ZipFile(wheel) as archive:
        inside = archive.namelist()
    foreign = [name for name in inside if not name.startswith(("ctrl_realize/", "ctrl_realize-"))]
    lacking = {"ctrl_realize/py.typed", "ctrl_realize/__init__.pyi"} - set(inside)
    wrong = ", ".join([*foreign, *(f"no {name}" for name in lacking)])
    yield "the wheel holds the package, typed, and nothing else", wrong
    yield "the source distribution holds what git holds", _left_out(files)
    for name, digest in sums[0].items():
        print(f"        {digest}  {name}")


def main() -> int:
    words = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    words.add_argument("--tagged", action="store_true", help="ask for the tag on this commit")
    chosen = words.parse_args()
    release, left = version(), 0
    for part in (texts(release), repository(release, chosen.tagged), built(release)):
        for asked, trouble in part:
            print(f"{'open' if trouble else 'done'}    {asked}", flush=True)
            if trouble:
                left += 1
                print("        " + trouble.replace("\n", "\n        "))
    print(f"\n{left} open" if left else "\nready: docs/releasing.md says what to do with it")
    return 1 if left else 0


if __name__ == "__main__":
    raise SystemExit(main())
