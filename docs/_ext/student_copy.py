"""The laboratory as students get it: without solutions, checks and outputs."""

from __future__ import annotations

from pathlib import Path

import nbformat


def write(notebook: Path, path: Path) -> None:
    """Store a copy of a notebook with an empty cell in the place of each solution."""
    copy = nbformat.read(notebook, as_version=4)
    cells = []
    for cell in copy.cells:
        tags = set(cell.metadata.get("tags", []))
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
        if "solution" in tags:
            cell.source = "# your solution"
        if "remove-cell" not in tags:
            cell.metadata = {}
            cells.append(cell)
    copy.cells = cells
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(copy, path)
