"""The command line with files and arguments that nobody meant."""

from __future__ import annotations

import contextlib
import io
import shutil
from pathlib import Path

import pytest
from hypothesis import event, given
from hypothesis import strategies as st

from ctrl_realize.cli import main
from tests.fuzz.lane import fuzz, good_end
from tests.fuzz.test_text_files import mutations, tables

WORDS = st.one_of(
    st.sampled_from(
        ["", "-", "--", "-x", "0", "-1", "1e999", "nan", "999999999999", "auto", "ms", "..", "a b",
         "--method", "scan", "paper", "--help", "--version", "identify", "compare", "\ud800",
         "{x}", "%s", "$HOME", "*.csv", "record.csv", "model.json", "/dev/zero", "\0", "ü" * 300]
    ),
    st.text(max_size=6),
)  # fmt: skip
OPTIONS = st.lists(
    st.one_of(
        st.tuples(st.just("--method"), st.sampled_from(["scan", "paper", "none"])),
        st.tuples(st.just("--order"), st.sampled_from(["1", "0", "-3", "50", "x", "1.5"])),
        st.tuples(st.just("--max-delay"), st.sampled_from(["1", "0", "99999", "-1", "inf"])),
        st.tuples(st.just("--dt"), st.sampled_from(["1", "0", "-1", "nan", "1e-320", "inf"])),
        st.tuples(st.just("--time"), WORDS),
        st.tuples(st.just("--input"), WORDS),
        st.tuples(st.just("--delimiter"), WORDS),
        st.tuples(st.just("--decimal"), WORDS),
        st.tuples(st.just("--skip-rows"), st.sampled_from(["0", "3", "10000000000"])),
        st.tuples(st.just("--jobs"), st.sampled_from(["1", "0", "x"])),
        st.tuples(st.just("--frf"), st.sampled_from(["record.csv", "nothing.csv", "."])),
        st.tuples(st.just("--resample")),
        st.tuples(st.just("--separate")),
    ),
    max_size=3,
)


def run(arguments: list[str]) -> tuple[int, str]:
    """Run the command line as a user would; return exit code and what it complained."""
    complaints = io.StringIO()
    with contextlib.redirect_stderr(complaints), contextlib.redirect_stdout(io.StringIO()):
        code = main(arguments)
    return code, complaints.getvalue()


def check(code: int, complaints: str, output: Path) -> None:
    event(f"exit code {code}")
    assert code in (0, 1, 2)
    assert "Traceback" not in complaints
    if code == 2:
        assert complaints.strip()
        assert len(complaints) < 5000
        # nothing is written half
        assert not output.exists()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cli")


@fuzz(40)
@given(st.one_of(tables(), mutations(), st.binary(max_size=60)), OPTIONS)
def test_identify_ends_in_an_exit_code_and_one_complaint(folder, content, options):
    (folder / "record.csv").write_bytes(content)
    output = folder / "out"
    shutil.rmtree(output, ignore_errors=True)
    arguments = [word for option in options for word in option]
    with contextlib.chdir(folder), good_end(seconds=60) as ends:
        method = [] if "--method" in arguments else ["--method", "scan"]
        ends.append(run(["identify", "record.csv", "-o", "out", *method, *arguments]))
    assert ends, "an error was not caught"
    check(*ends[0], output)
    assert {path.name for path in folder.iterdir()} <= {"record.csv", "out"}


@fuzz(40)
@given(st.binary(max_size=80), st.binary(max_size=80), st.lists(WORDS, max_size=3))
def test_compare_ends_in_an_exit_code_and_one_complaint(folder, model, frf, words):
    (folder / "model.json").write_bytes(model)
    (folder / "frf.csv").write_bytes(frf)
    with contextlib.chdir(folder), good_end(seconds=60) as ends:
        ends.append(run(["compare", "model.json", "frf.csv", *words]))
    assert ends, "an error was not caught"
    assert ends[0][0] in (0, 2)
    for name in ("model.json", "frf.csv"):
        (folder / name).unlink()


@fuzz(60)
@given(st.lists(WORDS, max_size=4))
def test_any_words_end_in_an_exit_code(folder, words):
    # "demo" is not among the words: it has nothing to refuse, and takes its time
    with contextlib.chdir(folder), good_end(seconds=60) as ends:
        ends.append(run(words))
    assert ends, "an error was not caught"
    assert ends[0][0] in (0, 2)
