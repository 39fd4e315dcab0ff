"""A flag is raised in a world in which it is due, and in the world beside it is not.

The worlds are those of the honesty benchmark, which counts how often; here one seed is looked at,
of which it is known that the flag has to be there. Flags of frequency responses and loops are
tested beside them.
"""

from __future__ import annotations

import pytest

from benchmarks.honesty import runs

RESULTS = ("fit_delay", "estimate_delay", "realize", "identify_campaign", "bootstrap")
SEEDS = {("fit_delay", "views_disagree"): 1, ("fit_delay, moving input", "integrating"): 1}
"""Where the first record of a world does not show what it should."""

CASES = {}
for case in runs.FLAG_CASES:
    if case.result.startswith(RESULTS):
        CASES.setdefault((case.result, case.code), case)
QUIET = {(case.result, case.not_due): case for case in CASES.values()}


@pytest.mark.parametrize("key", CASES, ids=": ".join)
def test_a_flag_is_raised_where_it_is_due(key):
    assert key[1] in CASES[key].raising(SEEDS.get(key, 0)), CASES[key].due


@pytest.mark.parametrize("key", QUIET, ids=": ".join)
def test_no_flag_is_raised_where_none_is_due(key):
    due = {case.code for case in CASES.values() if (case.result, case.not_due) == key}
    assert not due & QUIET[key].quiet(0)
