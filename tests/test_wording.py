"""How estimates and intervals are written."""

from hypothesis import given
from hypothesis import strategies as st

from ctrl_realize._wording import interval_in_time, time_within
from ctrl_realize.results import Parameter, formula

SIZES = st.floats(1e-7, 1e5)


@given(low=SIZES, width=st.floats(1e-5, 10.0), part=st.floats(0.0, 1.0))
def test_a_written_estimate_lies_within_its_written_interval(low, width, part):
    high = low * (1 + width)
    value = low + part * (high - low)
    number, unit = time_within(value, low, high).split()
    first, _, last, same = interval_in_time(low, high).split()
    assert unit == same
    assert float(first) <= float(number) <= float(last)
    # and as many decimals
    assert len({len(text.partition(".")[2]) for text in (first, number, last)}) == 1


def test_an_estimate_before_its_rounded_interval_is_not_shown():
    # in four and in three digits: 124.9 ms of 125 to 126 ms
    assert time_within(0.12486, 0.12473, 0.12612) == "124.9 ms"
    assert interval_in_time(0.12473, 0.12612) == "124.7 to 126.1 ms"


def test_an_interval_without_width_has_four_digits():
    assert time_within(0.125, 0.125, 0.125) == "125.0 ms"
    assert interval_in_time(0.125, 0.125) == "125.0 to 125.0 ms"


def test_a_formula_has_four_digits_and_says_where_its_gain_is_not_known():
    lag = Parameter("lag_1", 12.0, times=1)
    known = Parameter("gain", 1.79968, 0.0004, 1.7989, 1.8005)
    assert formula([known, lag]) == "1.800 (+-0.0004) / (12 s + 1)"
    unknown = Parameter("gain", 0.04, 0.2, -0.36, 0.44, unit="K/%")
    assert formula([unknown, lag]) == "K / (12 s + 1), gain K not determined: 0.0 (+-0.2) K/%"
