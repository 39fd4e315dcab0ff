"""What is written for assistants names what there is."""

import re
from pathlib import Path

import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main

DOCS = Path(__file__).parents[1] / "docs"
TEXTS = {
    name: (DOCS / "extra" / name).read_text(encoding="utf-8") for name in ("llms.txt", "skill.md")
}


@pytest.mark.parametrize("name", TEXTS)
def test_commands_options_forms_and_flags_exist(name, capsys):
    text = TEXTS[name]
    commands = set(re.findall(r"ctrl-realize ([a-z]+)\b", text))
    said = ""
    for command in commands:
        assert main([command, "--help"]) == 0
        said += capsys.readouterr().out
    assert {word for word in re.findall(r"--[a-z][a-z-]+", text) if word not in said} == set()
    words = set(re.findall(r"`([a-z]+_[a-z_]+)`", text))
    known = {*cr.design.pid_forms()["form"], *re.findall(r"^\[(\w+)\]", FLAGS, re.MULTILINE)}
    fields = set(re.findall(r'"(\w+)":', SCHEMA))
    assert words - known - fields == set()


FLAGS = (Path(cr.__file__).parent / "flags.toml").read_text(encoding="utf-8")
SCHEMA = (Path(cr.__file__).parent / "report" / "identification.schema.json").read_text()


def test_links_lead_to_pages_of_the_site():
    for target in re.findall(r"\]\(([^)]+)\)", TEXTS["llms.txt"]):
        page = DOCS / target.replace(".html", ".md")
        extra = DOCS / "extra" / target
        assert page.exists() or extra.exists() or target == "identification.schema.json", target


def test_python_names_exist():
    for dotted in re.findall(r"cr\.([\w.]+)\(", TEXTS["skill.md"]):
        value = cr
        for part in dotted.split("."):
            value = getattr(value, part)
