"""A flag is raised in a world in which it is due, and in the world beside it is not.

The worlds are those of the honesty benchmark, which counts how often. Flags of
frequency responses and loops are tested beside them.
"""

from __future__ import annotations

import pytest

from benchmarks.honesty import runs

RESULTS = ("fit_output_error", "estimate_delay", "realize", "identify_campaign", "bootstrap")
ELSEWHERE = ("drift", "integrating", "dispersed_flow", "cut", "feedback")
"""Codes of output-error fits that other tests of identification raise, on smaller records."""
FIRST = {
    ("fit_output_error", "cancelled_pair"): 5,
    ("fit_output_error", "estimates_disagree"): 1,
    ("fit_output_error", "noncausal"): 4,
}
"""First record of a world in which the flag is raised, where it is not that of seed 0."""
CASES = {}
for case in runs.FLAG_CASES:
    # steps come first; what raises a flag there looks at moving inputs as well
    key = case.result.split(",")[0], case.code
    if key[0] in RESULTS and (key[0] != "fit_output_error" or case.code not in ELSEWHERE):
        CASES.setdefault(key, case)
QUIET = {(case.result, case.not_due): case for case in CASES.values()}


@pytest.mark.parametrize("key", CASES, ids=": ".join)
def test_a_flag_is_raised_where_it_is_due(key):
    # a flag that is rarely due in its world is in one of eight records
    seeds = sorted(range(8), key=lambda seed: seed != FIRST.get(key, 0))
    assert any(key[1] in CASES[key].raising(seed) for seed in seeds), CASES[key].due


@pytest.mark.parametrize("key", QUIET, ids=": ".join)
def test_no_flag_is_raised_where_none_is_due(key):
    due = {case.code for case in CASES.values() if (case.result, case.not_due) == key}
    assert not due & QUIET[key].quiet(0)
