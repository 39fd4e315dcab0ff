"""The table of the long lane counts every case once."""

from __future__ import annotations

from tests.fuzz.table import table, union


def test_ranges_that_overlap_count_once():
    assert union([]) == 0
    assert union([(0, 10), (5, 12), (6, 8), (20, 21)]) == 13
    assert union([(20, 21), (0, 10)]) == 11


def test_seeds_add_up_and_runs_of_one_seed_do_not():
    line = {"target": "test_any_table_is_read", "seed": "1", "cases": 60, "failures": []}
    failing = {**line, "first": 50, "failures": ["case 51: KeyError: 0", "case 60: x"]}
    again = {**failing, "failures": ["case 51: ValueError: elsewhere"]}
    other = {**line, "seed": "2", "cases": 2000}
    rows = table([line, failing, again, other])
    assert rows[2:] == ["| any table is read | 2 110 | 2 |"]


def test_cases_of_a_renamed_target_count_under_its_new_name_beside_those_of_the_same_number():
    line = {"target": "test_an_exact_delay_is_found_exactly", "seed": "1", "cases": 60}
    rows = table(
        [
            {**line, "failures": ["case 5: KeyError: 0"]},
            {**line, "target": "test_an_exact_response_is_found_exactly", "failures": []},
        ]
    )
    assert rows[2:] == ["| an exact response is found exactly | 120 | 1 |"]
