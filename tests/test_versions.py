"""What pyproject.toml promises of versions is what the matrix tries."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
OLDEST = (ROOT / "tools" / "oldest.txt").read_text("utf-8")


def release(version: str) -> tuple[int, ...]:
    numbers = tuple(int(part) for part in version.split("."))
    return numbers + (0,) * (3 - len(numbers))


def versions(lines: list[str], sign: str) -> dict[str, tuple[int, ...]]:
    found = [re.fullmatch(rf"([\w\-\[\]]+){sign}([\d.]+)", line) for line in lines]
    assert all(found), lines
    return {each[1]: release(each[2]) for each in found}


def test_lower_bounds_are_the_oldest_releases_that_are_tried():
    extras = PROJECT["optional-dependencies"]
    promised = PROJECT["dependencies"] + extras["parquet"] + extras["cluster"]
    tried = [line for line in OLDEST.splitlines() if not line.startswith("#")]
    oldest = versions(tried, "==")
    assert {name: oldest.get(name) for name in versions(promised, ">=")} == versions(promised, ">=")


def test_every_python_that_is_promised_has_a_row():
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    matrix = (ROOT / "tools" / "matrix.py").read_text("utf-8")
    minors = re.search(r"for minor in \(([\d, ]+)\)", matrix)[1]
    assert [f"3.{minor.strip()}" for minor in minors.split(",")] == named
    assert PROJECT["requires-python"] == f">={named[0]}"
