"""Notebooks run from top to bottom, and their last cells assert what they claim."""

import ast
import json
import os
import re
import sys
import warnings
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
# Folders of people and machines; a stored output must not tell where it was made.
MACHINE_PATH = re.compile(r"/(home|root|tmp|Users|mnt|workspace)/\w+|[A-Z]:\\\\")


def cells(path: Path) -> list[dict]:
    """Without nbformat, whose import takes longer than most tests."""
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def outputs(cell: dict) -> list[str]:
    shown = []
    for output in cell["outputs"]:
        if output["output_type"] == "stream":
            shown.append(output["text"])
        else:
            shown += [text for kind, text in output.get("data", {}).items() if "image" not in kind]
    return ["".join(text) for text in shown]


def run(source: str, scope: dict) -> None:
    """Run a cell as a kernel does: figures are drawn, the value of the last line is shown."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), scope)
    if last is not None:
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), scope)
        repr(value)
        getattr(value, "_repr_html_", str)()
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()
    plt.close("all")


@pytest.mark.parametrize("path", NOTEBOOKS[1:], ids=lambda path: path.stem)
def test_notebook_runs_and_its_numbers_hold(path: Path, monkeypatch: pytest.MonkeyPatch):
    """In this process; the first one runs in a kernel below, and all do where they are stored."""
    monkeypatch.chdir(path.parent)
    # without sliders, what they would move is drawn once, and an error in it is one here
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    scope: dict = {"__name__": "__main__"}
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.simplefilter("default")  # as in a kernel
        for cell in cells(path):
            if cell["cell_type"] == "code":
                run("".join(cell["source"]), scope)


def test_a_notebook_runs_in_a_kernel(monkeypatch: pytest.MonkeyPatch):
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    notebook = nbformat.read(NOTEBOOKS[0], as_version=4)
    resources = {"metadata": {"path": os.fspath(NOTEBOOKS[0].parent)}}
    NotebookClient(notebook, timeout=240, resources=resources).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_as_it_should_be_read(path: Path):
    notebook = cells(path)
    first, last = notebook[0], notebook[-1]
    assert "**Question.**" in "".join(first["source"])
    assert "assert " in "".join(last["source"])
    assert last["metadata"]["tags"] == ["remove-cell"], "checks are not in the reader's way"
    code = [cell for cell in notebook if cell["cell_type"] == "code"]
    assert all(cell["execution_count"] for cell in code), "stored without its outputs"
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    shown = [text for cell in code for text in outputs(cell)]
    assert not any(output["output_type"] == "error" for cell in code for output in cell["outputs"])
    assert not [text for text in shown if MACHINE_PATH.search(text)]
    assert not [text for text in shown if " at 0x" in text], "end the line with a semicolon"
    pictures = sum(
        "image/png" in output.get("data", {}) for cell in code for output in cell["outputs"]
    )
    assert pictures >= 1
    assert path.stat().st_size < 1_000_000
