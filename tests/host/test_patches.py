"""The patches for python-control, applied to a copy of it (docs/python_control_patches.md)."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import control
import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python_control_patches.md"
PATCHES = re.findall(
    r"^## (.*?)$.*?^```diff\n(.*?)^```$.*?^```python\n(.*?)^```$", PAGE.read_text(), re.M | re.S
)
RUN = """
import json
held = []
for title, lines in blocks.items():
    try:
        exec(lines, {})
    except Exception:
        continue
    held.append(title)
print(json.dumps(held))
"""
pytestmark = [
    pytest.mark.skipif(control.__version__ != "0.10.2", reason="the patches are for 0.10.2"),
    pytest.mark.skipif(shutil.which("git") is None, reason="git applies the patches"),
]


def test_every_patch_is_found():
    assert len(PATCHES) == PAGE.read_text().count("\n## ")


def test_every_patch_corrects_what_it_says(tmp_path):
    shutil.copytree(
        Path(control.__file__).parent,
        tmp_path / "control",
        ignore=shutil.ignore_patterns("tests", "__pycache__"),
    )
    alone = os.environ | {"GIT_CEILING_DIRECTORIES": str(tmp_path.parent)}  # no repository above
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    blocks = {title: lines for title, _, lines in PATCHES}

    def holding() -> list[str]:
        """Titles of the patches whose lines run."""
        command = [sys.executable, "-W", "ignore", "-c", f"blocks = {blocks!r}\n{RUN}"]
        run = subprocess.run(
            command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, check=True
        )
        return json.loads(run.stdout)

    assert holding() == []
    for _, patch, _ in PATCHES:
        command = ["git", "apply", "-"]
        subprocess.run(command, input=patch.encode(), cwd=tmp_path, env=alone, check=True)
    assert holding() == list(blocks)
