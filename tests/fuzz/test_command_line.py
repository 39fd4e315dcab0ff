"""The command line with files and arguments that nobody meant."""

import contextlib
import csv
import io
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import control as ct
import numpy as np
import pytest
from matplotlib.figure import Figure

import ctrl_realize as cr
from ctrl_realize.cli import commands, main
from ctrl_realize.report import sketches
from tests.fuzz.draws import any_bytes, any_name, any_text, generator, some, sometimes
from tests.fuzz.lane import ends, fuzz, good_end
from tests.fuzz.test_text_files import any_table, frf_table, mutated

ODD_WORDS = (
        ["", "-", "--", "-x", "0", "-1", "1e999", "nan", "999999999999", "auto", "ms", "..", "a b",
         "--method", "scan", "paper", "--help", "--version", "identify", "compare", "\ud800",
         "{x}", "%s", "$HOME", "*.csv", "record.csv", "model.json", "/dev/zero", "\0", "ü" * 300]
)  # fmt: skip


def any_word(rng):
    return rng.choice(ODD_WORDS) if rng.randrange(2) else any_text(rng, 6)


OPTIONS = [
    lambda rng: ("--method", rng.choice(["scan", "paper", "none"])),
    lambda rng: ("--order", rng.choice(["1", "0", "-3", "50", "x", "1.5"])),
    lambda rng: ("--max-delay", rng.choice(["1", "0", "99999", "-1", "inf"])),
    lambda rng: ("--dt", rng.choice(["1", "0", "-1", "nan", "1e-320", "inf"])),
    lambda rng: ("--time", any_word(rng)),
    lambda rng: ("--input", any_word(rng)),
    lambda rng: ("--delimiter", any_word(rng)),
    lambda rng: ("--decimal", any_word(rng)),
    lambda rng: ("--skip-rows", rng.choice(["0", "3", "10000000000"])),
    lambda rng: ("--jobs", rng.choice(["1", "0", "x"])),
    lambda rng: ("--frf", rng.choice(["record.csv", "nothing.csv", "."])),
    lambda rng: ("--resample",),
    lambda rng: ("--separate",),
    lambda rng: ("--overwrite",),
]


def run(arguments: list[str], *, figures: str = "drawn") -> tuple[int, str]:
    """Run the command line as a user would; return exit code and what it complained.

    Figures are ``"drawn"``, ``"laid out"`` by our code without Matplotlib's ink, which would be
    nine tenths of a case, or ``"empty"``, as their axes alone are two thirds of what is left.
    """
    complaints = io.StringIO()
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stderr(complaints))
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        # looking for libraries of threads takes 3 ms: most of what `main` does with odd words
        stack.enter_context(patch.object(commands, "threadpool_limits", _one_thread))
        if figures != "drawn":
            instead = _without_ink if figures == "laid out" else _empty
            stack.enter_context(patch.object(sketches, "laid_out", instead))
        code = main(arguments)
    return code, complaints.getvalue()


def _one_thread(limits: int) -> contextlib.AbstractContextManager[None]:
    return contextlib.nullcontext()


def _without_ink(draw: Callable[[Figure], Any], size: tuple[float, float]) -> Figure:
    draw(Figure(figsize=size))
    return Figure(figsize=(1, 1), dpi=10)


def _empty(draw: Callable[[Figure], Any], size: tuple[float, float]) -> Figure:
    return Figure(figsize=(1, 1), dpi=10)


def check(code: int, complaints: str, output: Path) -> None:
    ends[f"exit code {code}"] += 1
    assert code in (0, 1, 2)
    assert "Traceback" not in complaints
    assert "the report could not be written" not in complaints
    if code == 2:
        assert complaints.strip()
        assert len(complaints) < 5000
        # nothing is written half
        assert not output.exists()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cli")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    file = tmp_path_factory.mktemp("model") / "model.json"
    cr.save_model(file, cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.05), 3))
    return file.read_bytes()


def step_table(rng) -> bytes:
    """Some forty good samples of a step, one cell of them out of order at times."""
    n = rng.randint(25, 60)
    k = np.arange(n)
    y = 1 - 0.8 ** np.clip(k - 10 - rng.randint(0, 5), 0, None)
    y = y + rng.choice([0.0, 1e-3]) * generator(rng).standard_normal(n)
    rows = [f"{t / 10:g},{float(t >= 10):g},{v:.6f}" for t, v in zip(k, y, strict=True)]
    if sometimes(rng, 3):
        rows[rng.randrange(n)] = any_text(rng, 8)
    header = io.StringIO()
    names = ["u", "y"] if rng.randrange(2) else [any_name(rng), any_name(rng) + "2"]
    csv.writer(header, lineterminator="").writerow(["t", *names])
    return "\n".join([header.getvalue(), *rows]).encode()


@fuzz(40)
def test_identify_ends_in_an_exit_code_and_one_complaint(rng, folder):
    content = rng.choice([any_table, mutated, lambda r: any_bytes(r, 60), step_table])(rng)
    (folder / "record.csv").write_bytes(content)
    output, figures = folder / "out", rng.choice(["drawn"] + ["laid out"] * 10 + ["empty"] * 100)
    shutil.rmtree(output, ignore_errors=True)
    arguments = [word for option in some(rng, rng.choice(OPTIONS), 3) for word in option]
    with contextlib.chdir(folder), good_end(seconds=60) as codes:
        method = [] if "--method" in arguments else ["--method", "scan"]
        if "--input" not in arguments and rng.randrange(2):
            method += ["--input", "1", "--response", "2"]
        codes.append(
            run(["identify", "record.csv", "-o", "out", *method, *arguments], figures=figures)
        )
    assert codes, "an error was not caught"
    check(*codes[0], output)
    assert {path.name for path in folder.iterdir()} <= {"record.csv", "out"}


@fuzz(40)
def test_compare_ends_in_an_exit_code_and_one_complaint(rng, folder, model):
    good = rng.randrange(4)
    (folder / "model.json").write_bytes(model if good else any_bytes(rng, 80))
    (folder / "frf.csv").write_bytes(rng.choice([frf_table, lambda r: any_bytes(r, 80)])(rng))
    words = some(rng, any_word, 1 if good else 3)
    with contextlib.chdir(folder), good_end(seconds=60) as codes:
        codes.append(run(["compare", "model.json", "frf.csv", *words]))
    assert codes, "an error was not caught"
    ends[f"exit code {codes[0][0]}"] += 1
    assert codes[0][0] in (0, 2)
    for name in ("model.json", "frf.csv"):
        (folder / name).unlink()


@fuzz(60)
def test_any_words_end_in_an_exit_code(rng, folder):
    words = some(rng, any_word, 4)
    with contextlib.chdir(folder), good_end(seconds=60) as codes:
        codes.append(run(words))
    assert codes, "an error was not caught"
    ends[f"exit code {codes[0][0]}"] += 1
    assert codes[0][0] in (0, 2)
