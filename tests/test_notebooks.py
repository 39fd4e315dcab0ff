"""Notebooks run from top to bottom, and their last cells assert what they claim."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
SHARED_DATA = ROOT.parent / "shared" / "data"
# Folders of people and machines; a stored output must not tell where it was made.
MACHINE_PATH = re.compile(r"/(home|root|tmp|Users|mnt|workspace)/\w+|[A-Z]:\\\\")


def outputs(cell) -> list[str]:
    shown = []
    for output in cell.get("outputs", []):
        if output.output_type == "stream":
            shown.append(output.text)
        else:
            shown += [text for kind, text in output.get("data", {}).items() if "image" not in kind]
    return ["".join(text) for text in shown]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_its_numbers_hold(path: Path, monkeypatch: pytest.MonkeyPatch):
    if "shared/data" in path.read_text() and not SHARED_DATA.is_dir():
        pytest.skip("measured records are not beside the project")
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(path.parent)}}
    NotebookClient(notebook, timeout=240, resources=resources).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_as_it_should_be_read(path: Path):
    notebook = nbformat.read(path, as_version=4)
    first, last = notebook.cells[0], notebook.cells[-1]
    assert "**Question.**" in first.source
    assert "assert " in last.source
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in code), "stored without its outputs"
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    shown = [text for cell in code for text in outputs(cell)]
    assert not any(output.output_type == "error" for cell in code for output in cell.outputs)
    assert not [text for text in shown if MACHINE_PATH.search(text)]
    assert not [text for text in shown if " at 0x" in text], "end the line with a semicolon"
    pictures = sum(
        "image/png" in output.get("data", {}) for cell in code for output in cell.outputs
    )
    assert pictures >= 1
    assert path.stat().st_size < 1_000_000
