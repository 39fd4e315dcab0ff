"""What pyproject.toml promises of versions is what the matrix tries."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import ctrl_realize as cr

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


def test_the_recipe_for_conda_asks_for_what_the_package_asks_for():
    recipe = (ROOT / "recipe" / "recipe.yaml").read_text("utf-8")
    run = re.search(r"^  run:\n((?:    - .*\n)+)", recipe.replace("-base", ""), re.M)[1]
    asked = dict(re.findall(r"- ([\w-]+) >=([\d.]+)$", run, re.M))
    assert asked == dict(line.split(">=") for line in PROJECT["dependencies"])
    assert f'python_min: "{PROJECT["requires-python"][2:]}"' in recipe
    assert f"license: {PROJECT['license']}\n" in recipe


def test_the_package_its_citation_and_its_changelog_name_one_version():
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert re.search(r"^## (\S+)", changelog, re.M)[1] == cr.__version__
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.search(r"^version: \W?([\w.]+)", citation, re.M)[1] == cr.__version__
    assert metadata.version("ctrl-realize") == cr.__version__


def test_the_extra_all_holds_every_extra_that_users_need_and_no_compiler():
    extras = PROJECT["optional-dependencies"]
    (everything,) = extras["all"]
    named = set(re.search(r"\[(.+)\]", everything)[1].split(","))
    assert named == set(extras) - {"all", "slycot", "test", "docs"}
