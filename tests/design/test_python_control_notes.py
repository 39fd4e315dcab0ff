"""The page on python-control says what python-control does: its examples run."""

import re
import warnings
from pathlib import Path

import control as ct
import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python_control_notes.md"
BLOCKS = re.findall(r"## ([^\n]+)\n|```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


def examples():
    title = "setup"
    for heading, code in BLOCKS:
        title = heading or title
        if code:
            yield title, code


def test_the_page_has_its_examples():
    assert len(list(examples())) >= 9


@pytest.mark.parametrize(
    ("title", "code"), list(examples())[1:], ids=[title for title, _ in list(examples())[1:]]
)
def test_each_example_of_the_page_holds(title, code):
    if "without slycot" in code and ct.exception.slycot_check():
        pytest.skip("slycot takes another way to polynomials")
    names: dict[str, object] = {}
    exec(next(examples())[1], names)
    with warnings.catch_warnings():
        # Ill-conditioning is what these examples are about.
        warnings.simplefilter("ignore")
        exec(code, names)
