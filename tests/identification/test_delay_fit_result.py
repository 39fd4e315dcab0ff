"""What the result of an output-error fit says of itself, on results that are written by hand."""

from __future__ import annotations

import numpy as np

from ctrl_realize.identification.delay_fit_result import DelayFit, Repeatability
from ctrl_realize.wording import in_time


def result(**changed):
    """2 lags behind 28.90625 ms, 37 samples, within 28.5 to 29.5 ms."""
    values = {
        "dead_time": 0.02890625,
        "std_given_structure": 1e-4,
        "interval": (0.0285, 0.0295),
        "onset": 0.0312345,
        "total_delay": 0.112346,
        "order": 2,
        "relative_degree": 1,
        "poles": np.array([-20.0, -10.0]) + 0j,
        "zeros": np.array([-5.0]) + 0j,
        "gain": 2.0000004,
        "at_noise_level": True,
        "misfit": 1.0449,
        "noise": 0.012345,
        "residual": 0.0456789,
        "correlation": 1.0,
        "views": {},
        "structures": (),
        "profile_delay": np.zeros(2),
        "profile_excess": np.zeros(2),
        "time": np.zeros(2),
        "measured": np.zeros(2),
        "fitted": np.zeros(2),
        "dt": 7.8125e-4,
    }
    return DelayFit(**values | changed)


def test_times_are_samples_over_the_sample_time():
    fit = result()
    assert fit.delay == 37.0
    assert fit.delay_interval == (0.0285 / 7.8125e-4, 0.0295 / 7.8125e-4)
    assert fit.dead_time_interval == fit.interval
    assert fit.structure == (2, 1)


def test_the_interval_is_of_confidence_only_where_one_model_leaves_noise():
    assert result().interval_label == "95 % interval"
    assert "views" in result(at_noise_level=False).interval_label


def test_the_result_says_itself_in_one_line():
    assert repr(result()) == (
        "<DelayFit 0.02891 s in 0.0285...0.0295 s, order 2, relative degree 1, residual noise>"
    )
    assert repr(result(at_noise_level=False, misfit=3.14)).endswith("residual 3.1 x noise>")


def test_the_card_tells_every_number_with_its_unit():
    assert result().report().splitlines() == [
        "Output-error fit: dead time 28.9 ms",
        "  dead time      28.9 ms = 37.0 samples",
        "  95 % interval  28.5 to 29.5 ms",
        "  first motion   31.23 ms",
        "  total delay    112.35 ms (dead time and lags: firm)",
        "  model          order 2, relative degree 1",
        "  poles          lag 100 ms, lag 50 ms",
        "  gain           2",
        "  residual       0.0457, noise 0.0123 (misfit 1.04)",
    ]


def test_a_narrow_interval_gets_digits_that_tell_its_ends_apart():
    shown = dict(result(dead_time=0.028906789, interval=(0.0289065, 0.0289071))._rows())
    # 0.6 µs of 28.9 ms: two digits of the width
    assert shown["dead time"] == "28.90679 ms = 37.00069 samples"


def test_views_are_listed_and_a_first_motion_only_where_there_is_one():
    shown = dict(result(onset=float("nan"), views={"early": 0.0123456, "whole": 0.02})._rows())
    assert "first motion" not in shown
    assert shown["view: early"] == "12.35 ms"
    assert shown["view: whole"] == "20 ms"


def repeats(**changed):
    values = {
        "names": ("a", "b", "c", "d"),
        "amplitudes": np.array([1.0, 2.0, 3.0, 4.0]),
        "delays": np.array([0.010, 0.011, 0.012, 0.013]),
        "errors": np.full(4, 1e-3),
        "gains": np.ones(4),
        "chi_square": 31.416,
        "p_value": 1.234e-6,
        "trend": 0.0012345,
        "trend_error": 0.00045,
        "outlying": ("b",),
    }
    return Repeatability(**values | changed)


def test_records_are_compared_on_the_card():
    rows = result(repeatability=repeats())._rows()
    assert len(rows) == 12
    # 10 to 13 ms: a variance of 5/3
    assert rows[-4:] == [
        ("records", "4, 1 of them left out"),
        ("scatter of delays", f"{in_time(np.sqrt(5 / 3) * 1e-3)} between records"),
        ("chi-square", "31.4 for 3 (p = 1.2e-06)"),
        ("trend over amplitude", "0.0012 +- 0.00045 s per unit"),
    ]


def test_without_a_trend_or_a_second_record_there_is_none_to_tell():
    labels = [label for label, _ in repeats(trend_error=0.0).rows()]
    assert labels == ["records", "scatter of delays", "chi-square"]
    assert dict(repeats(delays=np.array([0.01])).rows())["scatter of delays"].startswith("0 s")
    two = repeats(delays=np.array([0.010, 0.012]))
    assert dict(two.rows())["scatter of delays"].startswith(in_time(np.sqrt(2) * 1e-3))
