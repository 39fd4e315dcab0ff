"""The documentation names everything that is public, and names nothing that is not there."""

import ast
import importlib.util
import inspect
import re
import tomllib
from importlib import import_module
from pathlib import Path
from string import Formatter

import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from tests.sources import parsed

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path(cr.__file__).parent
DOCS = ROOT / "docs"
PAGES = sorted(
    path for path in DOCS.rglob("*.md") if not {"_build", "generated", "extra"} & set(path.parts)
)
OUTSIDE = sorted(ROOT.glob("*.md"))
"""README, CONTRIBUTING and the like, which are no pages of the site."""


def extension(name: str):
    spec = importlib.util.spec_from_file_location(name, DOCS / "_ext" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def reference() -> dict[str, str]:
    return extension("public_names").pages()


def listed(reference: dict[str, str]) -> set[str]:
    return set(re.findall(r"^   ~(ctrl_realize\.[\w.]+)$", "\n".join(reference.values()), re.M))


def test_every_public_name_has_an_entry(reference):
    entries = listed(reference)
    assert len(dir(cr)) > 40
    for name in dir(cr):
        if name.startswith("_") or inspect.ismodule(getattr(cr, name)):
            continue
        assert f"ctrl_realize.{name}" in entries
    for submodule in ("actuators", "design", "export", "plots", "bench", "paper", "valves"):
        module = import_module(f"ctrl_realize.{submodule}")
        for name in dir(module):
            value = getattr(module, name)
            home = str(getattr(value, "__module__", ""))
            if name.startswith("_") or not callable(value) or not home.startswith("ctrl_realize"):
                continue
            assert f"ctrl_realize.{submodule}.{name}" in entries


@pytest.mark.parametrize("page", [*PAGES, *OUTSIDE], ids=lambda path: str(path.relative_to(ROOT)))
def test_links_inside_the_project_lead_somewhere(page: Path, reference):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[\w-]+)?\)", text):
        if "://" in target or target.startswith("mailto:"):
            continue
        if "generated/api/" in target:  # made when the site is built
            assert target.split("generated/api/")[1] in reference, target
            continue
        path = target
        if "generated/notebooks/" in target:
            path = str(ROOT / "notebooks" / target.split("generated/notebooks/")[1])
        found = (page.parent / path).resolve()
        if found.is_relative_to(ROOT / PACKAGE.name):  # a wheel is installed elsewhere
            found = PACKAGE / found.relative_to(ROOT / PACKAGE.name)
        endings = ("", ".md", ".ipynb")
        assert any(found.with_name(found.name + ending).exists() for ending in endings), target


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(DOCS)))
def test_tests_that_a_page_names_exist(page: Path):
    for file, name in re.findall(r"(tests/[\w/]+\.py)(?:::(test_\w+))?", page.read_text()):
        assert (ROOT / file).exists(), file
        if name:
            assert f"def {name}(" in (ROOT / file).read_text(), f"{file}::{name}"


def test_names_of_stored_numbers_stand_outside_of_code_where_they_are_filled_in():
    quoted = [page.name for page in PAGES if "`{{" in page.read_text()]
    assert quoted == ["contributing.md"]  # which says how they are written


def test_files_that_the_architecture_names_exist():
    named = re.findall(r"`(ctrl_realize/[\w/]+\.py)`", (DOCS / "architecture.md").read_text())
    assert len(named) >= 10
    assert [path for path in named if not (PACKAGE.parent / path).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(DOCS)))
def test_cells_that_a_reader_sees_check_nothing_and_invent_no_data(page: Path):
    for options, code in re.findall(
        r"^```\{code-cell\} python\n((?::.*\n)*)(.*?)^```", page.read_text(), re.S | re.M
    ):
        if "remove-cell" not in options and "remove-input" not in options:
            assert not re.search(r"^\s*assert ", code, re.M), code
        simulates = "howto" in page.parts
        if simulates and not re.search("remove|hide-input", options):
            assert "default_rng" not in code, code


def test_sample_files_are_those_that_the_program_beside_them_writes():
    module = extension("sample_files")
    written = dict(module.files())
    assert set(written) == {path.name for path in module.STORED.iterdir()}
    for name, text in written.items():
        stored = (module.STORED / name).read_text(encoding="utf-8")
        number = r"-?\d+[.,]\d+"
        assert re.split(number, stored) == re.split(number, text)
        pairs = zip(re.findall(number, stored), re.findall(number, text), strict=True)
        # rounding may fall the other way on another processor: one unit of the last digit
        assert all(
            abs(float(a.replace(",", ".")) - float(b.replace(",", ".")))
            < 1.5 * 10.0 ** -len(re.split("[.,]", a)[1])
            for a, b in pairs
        )


def test_code_on_pages_is_python_and_uses_names_that_exist():
    """Cells run when the site is built; other blocks run nowhere."""
    unknown, blocks = [], 0
    for page in [*PAGES, *OUTSIDE]:
        fences = r"^ *```(?:\{code-cell\} ?i?python3?|python)\n(.*?)^ *```$"
        found = re.findall(fences, page.read_text(), re.S | re.M)
        blocks += len(found)
        for block in found:
            tree = ast.parse(re.sub(r"\A(?::[\w-]+:.*\n)+", "", block))
            chains = (ast.unparse(n) for n in ast.walk(tree) if isinstance(n, ast.Attribute))
            for chain in filter(re.compile(r"cr(\.\w+)+").fullmatch, chains):
                value: object = cr
                for part in chain.split(".")[1:]:
                    if not hasattr(value, part):
                        unknown.append((page.name, chain))
                        break
                    value = getattr(value, part)
    assert unknown == []
    assert blocks > 100


def test_command_lines_on_pages_use_options_that_exist(capsys):
    lines = [
        line
        for page in [*PAGES, *OUTSIDE]
        for line in page.read_text().replace("\\\n", " ").splitlines()
        if re.match(r"(\$ )?ctrl-realize [a-z]", line)
    ]
    assert len(lines) > 5
    for line in lines:
        command, *_ = line.removeprefix("$ ").split()[1:]
        assert main([command, "--help"]) == 0
        offered = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", capsys.readouterr().out))
        words = re.sub(r"\$\(.*?\)", "", line.partition("  #")[0])
        used = set(re.findall(r"(?<!\S)--?[a-z][\w-]*", words))
        assert used <= offered, line


def test_glossary_terms_that_pages_use_are_defined():
    glossary = (DOCS / "glossary.md").read_text()
    defined = set(re.findall(r"^([A-Za-z][^\n]*)\n  \S", glossary, re.M))
    for page in PAGES:
        for term in re.findall(r"\{term\}`([^`]+)`", page.read_text()):
            assert term in defined or term.lower() in {each.lower() for each in defined}, term


def test_every_page_is_linked_from_a_table_of_contents():
    contents = "\n".join(
        "\n".join(re.findall(r"```\{toctree\}.*?```", page.read_text(), re.S)) for page in PAGES
    )
    for page in PAGES:
        if page == DOCS / "index.md" or page.name.endswith("_table.md"):
            continue
        assert page.stem in contents, page


def test_every_public_name_shows_how_it_is_used(reference):
    silent = []
    for entry in sorted(listed(reference)):
        module, _, name = entry.rpartition(".")
        value = getattr(import_module(module), name)
        # An error is raised, not called; the functions that raise it say when. Constants show
        # their value.
        error = inspect.isclass(value) and issubclass(value, Exception)
        if error or not callable(value):
            continue
        # A class inherits the words of its parent, but not a use.
        own = vars(value).get("__doc__") if inspect.isclass(value) else value.__doc__
        # Python 3.13 takes the indentation off by itself
        if ">>>" not in inspect.cleandoc(own or "").partition("Examples\n--------")[2]:
            silent.append(entry)
    assert not silent


def test_every_entry_leads_to_a_page_of_the_guide(reference):
    related = extension("related")
    chosen = {entry: related.pages(entry) for entry in listed(reference)}
    assert not [entry for entry, pages in chosen.items() if not pages]
    pages = {page for several in related.PAGES.values() for page in several}
    assert not [page for page in pages if not (DOCS / f"{page}.md").exists()]
    # no pattern is behind one that takes all its names
    assert set(chosen.values()) == set(related.PAGES.values())


def test_every_flag_has_its_words_on_the_page_of_flags():
    module = extension("flag_table")
    listed_flags = module.flags(Path(cr.__file__).parent)
    assert len({code for code, _, _ in listed_flags}) > 40
    assert [code for code, _, words in listed_flags if words.strip("… :") == ""] == []
    for _, function, _ in listed_flags:
        home, _, name = f"ctrl_realize.{function}".rpartition(".")
        assert callable(getattr(import_module(home), name)), function


def test_every_flag_is_raised_with_the_values_that_its_words_ask_for():
    keys = extension("flag_table").keys
    package = Path(cr.__file__).parent
    table = tomllib.loads((package / "flags.toml").read_text(encoding="utf-8"))
    raised = set()
    for tree in parsed().values():
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "flagged":
                given = {value.arg for value in call.keywords}
                for key in keys(call):
                    code, _, case = key.partition(".")
                    words = table[code][case or "words"]
                    asked = {name for _, name, _, _ in Formatter().parse(words) if name}
                    assert asked <= given, key
                    raised.add((code, case or "words"))
    assert raised == {(c, case) for c, row in table.items() for case in row if case != "marks"}


def test_every_choice_is_told_with_the_values_that_its_words_ask_for():
    keys = extension("flag_table").keys
    words = tomllib.loads((Path(cr.__file__).parent / "choices.toml").read_text(encoding="utf-8"))
    told = set()
    for tree in parsed().values():
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "chosen":
                given = {value.arg for value in call.keywords}
                for topic, _, choice in (key.partition(".") for key in keys(call)):
                    parts = Formatter().parse(words[topic][choice])
                    assert {name for _, name, _, _ in parts if name} <= given, (topic, choice)
                    told.add((topic, choice))
    assert told == {(topic, choice) for topic, row in words.items() for choice in row}


def test_docstrings_of_everything_public_are_those_of_numpydoc(reference):
    validate = pytest.importorskip("numpydoc.validate", reason="numpydoc checks them").validate
    rules = extension("docstring_rules")
    faults = []
    for entry in sorted(listed(reference)):
        module, _, name = entry.rpartition(".")
        if re.search(rules.CONSTANTS, entry):
            continue
        function = inspect.isroutine(getattr(import_module(module), name))
        left_out = set(rules.NOT_ASKED) - set(rules.ASKED_OF_FUNCTIONS if function else ())
        faults += [(entry, *e) for e in validate(entry)["errors"] if e[0] not in left_out]
    assert not faults


def test_the_lines_of_the_readme_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    for block in re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S):
        exec(block, scope)
    truth = cr.datasets.load("simulated_valve").info.dead_time_band[0]
    low, high = scope["sys"].fit.interval
    assert low < truth < high


def test_every_source_that_the_code_names_is_on_the_page_of_references():
    page = (DOCS / "references.md").read_text().replace("–", "-")
    missing = []
    for path, tree in parsed().items():
        documented = ast.AsyncFunctionDef, ast.FunctionDef, ast.ClassDef, ast.Module
        nodes = [node for node in ast.walk(tree) if isinstance(node, documented)]
        words = "\n".join(ast.get_docstring(node) or "" for node in nodes)
        for entry in re.findall(r"^\.\. \[\d+\] (.*(?:\n   \S.*)*)", words, re.M):
            # Authors and title begin alike; section and digits may differ from place to place.
            start = " ".join(entry.split())[:40]
            dois = re.findall(r"doi:(\S+?)\.?$", entry)
            if f"- {start}" not in page or any(f"[doi:{doi}]" not in page for doi in dois):
                missing.append((path.name, start))
    assert not missing
    entries = re.findall(r"^- .*$", page, re.M)
    assert len(entries) == len(set(entries)) > 50


def test_every_module_of_the_numerical_floor_names_its_sources_or_says_that_it_is_our_own():
    plumbing = {"__init__.py", "arrays.py", "blas_threads.py"}
    silent = []
    for path, tree in parsed().items():
        words = ast.get_docstring(tree) or ""
        if path.parts[0] != "numerics" or path.name in plumbing:
            continue
        if not re.search(r"^References$|[Oo]ur own", words, re.M):
            silent.append(str(path))
    assert not silent
