#!/usr/bin/env python3
"""Run notebooks and store them with their outputs, in a form that does not change by itself.

    python tools/notebooks.py notebooks/02_step_to_impulse.ipynb ...

Times of execution, progress bars and machine paths do not belong into a stored notebook;
pictures are stored with few colours, which is a quarter of their size.
"""

from __future__ import annotations

import base64
import io
import os
import re
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

MACHINE_PATH = re.compile(r"(/home|/root|/tmp|/work|/Users|[A-Z]:\\)[\w./\\-]*")


def with_few_colours(png: str) -> str:
    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    packed = io.BytesIO()
    picture.quantize(96, dither=Image.Dither.NONE).save(packed, "PNG", optimize=True)
    return base64.b64encode(packed.getvalue()).decode()


def cleaned(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number:02d}"
        cell.metadata = {"tags": cell.metadata["tags"]} if cell.metadata.get("tags") else {}
        if cell.cell_type != "code":
            continue
        kept = []
        for output in cell.outputs:
            if output.output_type == "stream" and output.name == "stderr":
                raise SystemExit(f"cell {number} wrote to stderr: {output.text[:500]}")
            if output.output_type == "stream" and kept and kept[-1].output_type == "stream":
                # What is printed arrives in pieces, as the machine has time.
                kept[-1].text += output.text
                continue
            if "application/vnd.jupyter.widget-view+json" in output.get("data", {}):
                continue  # a slider is alive in Jupyter alone
            if output.output_type in ("display_data", "execute_result"):
                output.metadata = {}
                if "image/png" in output.data:
                    output.data["image/png"] = with_few_colours(output.data["image/png"])
                    output.data["text/plain"] = "<Figure>"
            kept.append(output)
        cell.outputs = kept
    found = MACHINE_PATH.search(
        "".join(str(cell.get("outputs", "")) for cell in notebook.cells).replace("image/png", "")
    )
    if found and "base64" not in found.group():
        print(f"  a machine path? {found.group()[:60]}")
    return notebook


def main(paths: list[str]) -> None:
    os.environ.pop("MPLBACKEND", None)  # another than the notebook's own stores no pictures
    for path in map(Path, paths):
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(
            notebook, timeout=300, resources={"metadata": {"path": str(path.parent)}}
        ).execute()
        nbformat.write(cleaned(notebook), path)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
