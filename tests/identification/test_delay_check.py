"""The table of views of one delay and its verdict, on views that are written by hand."""

from __future__ import annotations

from dataclasses import replace

from ctrl_realize.identification.validation.delay_estimates_result import (
    DelayComparison,
    DelayEstimate,
    common_dead_time,
)


def view(method, low, high, kind="dead time", doubt=""):
    return DelayEstimate(method, "record", kind, (low + high) / 2, low, high, doubt)


def bound(method, high):
    return view(method, 0.0, high, "upper bound")


A, B = view("a", 1.0, 3.0), view("b", 2.5, 3.5)
DOUBTED = replace(view("c", 2.0, 2.1), doubt="of noise")


def check(views, common=(2.5, 3.0), conflicts=(), dt=0.5, flags=()):
    return DelayComparison(tuple(views), common is not None, common, tuple(conflicts), dt, flags)


def test_intervals_that_touch_agree_on_where_they_touch():
    assert common_dead_time([A, view("b", 3.0, 5.0)]) == ((3.0, 3.0), ())
    assert common_dead_time([A, bound("b", 1.0)]) == ((1.0, 1.0), ())
    assert common_dead_time([A, view("b", 3.01, 5.0)]) == (None, (("a", "b"),))
    assert common_dead_time([view("b", 3.01, 5.0), A]) == (None, (("b", "a"),))
    assert common_dead_time([A, bound("b", 0.99)]) == (None, (("a", "b"),))


def test_only_pairs_that_rule_each_other_out_are_in_conflict():
    late = view("late", 4.0, 5.0)
    common, pairs = common_dead_time([A, B, late, bound("p", 2.0), bound("q", 4.5)])
    assert common is None
    assert pairs == (("a", "late"), ("b", "late"), ("b", "p"), ("late", "p"))
    # those that touch do not
    touching = [A, view("b", 3.0, 3.5), view("c", 3.5, 4.0)]
    for order in (touching, touching[::-1]):
        assert [set(pair) for pair in common_dead_time(order)[1]] == [{"a", "c"}]
    # the interval of an upper bound begins where nothing is said: only its end counts
    assert common_dead_time([A, view("r", 3.5, 6.0, "upper bound")]) == ((1.0, 3.0), ())


def test_the_narrowest_dead_time_that_counts_is_relied_on():
    assert check([A, B, DOUBTED, bound("d", 0.5)]).rely_on == "b"
    assert check([A, B], None, [("a", "b")]).rely_on is None
    assert check([bound("d", 0.5)], (0.0, 0.5)).rely_on is None
    assert check([DOUBTED, bound("d", 0.5)], (0.0, 0.5)).rely_on is None


def test_an_estimate_is_rounded_as_its_interval_is():
    shown = check(
        [DelayEstimate("a", "FRF", "dead time", 0.0123456, 0.012, 0.013)], dt=0.01
    ).report()
    assert "12.3 ms = 1.235 samples (12.0 to" in shown
