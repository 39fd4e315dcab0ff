"""Delay systems by python-control's names: the cases of another library's tests."""

import pytest

import ctrl_realize as cr
from benchmarks.loops.textbook import DIFFERENT, REFUSED, difference, refused, responses


@pytest.fixture(scope="module")
def cases():
    with cr.extend_control():
        yield responses()


@pytest.mark.parametrize(
    "group",
    ["products and sums", "loops", "several channels", "sampled", "Pade approximations"],
)
def test_responses_are_those_that_are_expected(cases, group):
    apart = {
        name: difference(case)
        for name, case in cases[group].items()
        if not difference(case) <= case[3]
    }
    assert set(apart) <= set(DIFFERENT), apart


def test_what_has_no_meaning_is_refused(cases):
    assert {name for name, call in REFUSED.items() if not refused(call)} == set()
