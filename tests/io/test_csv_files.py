"""Tables of results: no cell is a formula, and everything is read back as it was."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ctrl_realize.io.text.csv_files import as_text, write_csv

FORMULA_SIGNS = "=+-@\t\r\n\uff1d\uff0b\uff0d\uff20"
NAMES = [
    "=cmd|'/c calc'!A1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "\uff1d1", "valve;=1+1",
    "valve\n=1", "'=1", "'", "", "NaN", "1e5", 'say "=1"', "a,b", "a\rb", "a\r\nb", "valve 16 mA",
]  # fmt: skip


def plain(text: str) -> str:
    """The name that a cell stands for: as the documentation says, without one apostrophe."""
    return re.sub(rf"(^|[;\t\r\n])'(?='*[{re.escape(FORMULA_SIGNS)}])", r"\1", text)


@pytest.mark.parametrize("name", NAMES)
def test_no_cell_of_a_spreadsheet_begins_as_a_formula(name):
    # also where the semicolon ends a cell, and where line ends are not in quotes
    for cell in re.split("[;\t\r\n]", as_text(name)):
        assert cell[:1] not in tuple(FORMULA_SIGNS)


@given(st.text(st.sampled_from([*FORMULA_SIGNS, "'", ";", '"', ",", "a", " "]), max_size=8))
def test_a_name_is_got_back_by_leaving_out_one_apostrophe(name):
    assert plain(as_text(name)) == name


def test_names_and_numbers_are_read_as_they_were_written(tmp_path):
    values = np.resize([0.1, 1 / 3, -5e-324, 1e300, np.inf, np.nan], len(NAMES))
    table = pd.DataFrame({"delay": values}, index=pd.Index(NAMES, name="record"))
    write_csv(tmp_path / "a.csv", table, index=True)
    again = pd.read_csv(tmp_path / "a.csv", keep_default_na=False, na_values={"delay": [""]})
    assert [plain(name) for name in again["record"]] == NAMES
    np.testing.assert_array_equal(again["delay"], values)


def test_ordinary_tables_are_those_of_pandas(tmp_path):
    table = pd.DataFrame(
        {"gain": [1.5, -2.0, np.nan], "trusted": [True, False, True], "error": ["", "a, b", "c"]}
    )
    write_csv(tmp_path / "a.csv", table, index=False)
    assert (tmp_path / "a.csv").read_bytes() == table.to_csv(index=False).encode()


def test_names_of_columns_are_no_formulas_either(tmp_path):
    write_csv(tmp_path / "a.csv", pd.DataFrame({"=1+1": [1]}), index=False)
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "'=1+1\n1\n"
