"""The package does not grow unnoticed: sizes are stored, and fall or stay.

A capability that needs more lines says how many and why in its commit, and stores the new figures.
"""

import json

from tools import house


def test_code_lines_and_modules_have_not_grown():
    stored = json.loads(house.STORED.read_text(encoding="utf-8"))
    for name, value in house.sizes().items():
        assert value <= stored[name], f"{name}: `python tools/house.py` lists what has grown"


def test_the_path_of_a_step_record_has_not_grown():
    stored = json.loads(house.STORED.read_text(encoding="utf-8"))
    for name, value in house.path_of_identify().items():
        assert value <= stored[name], name


def test_lines_of_code_are_those_that_hold_code(tmp_path):
    file = tmp_path / "one.py"
    words = '    """Words."""'
    lines = [
        words.strip(),
        "import os",
        "# why",
        "A = (",
        "1,",
        ")",
        "",
        "def f():",
        words,
        "    return A",
    ]
    file.write_text("\n".join(lines) + "\n")
    assert house.code_lines(file) == 5  # three of the tuple, def, return
    assert house.constants(file) == 1
