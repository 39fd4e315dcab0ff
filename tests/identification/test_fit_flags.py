"""What a fit flags, each by itself, on fits that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.identification.fit_flags import (
    INTEGRATOR,
    fit_flags,
    model_flags,
    repeat_flags,
    same_record_flags,
    sampled_flags,
)
from ctrl_realize.wording import in_time, interval_in_time

DT = 0.1


def fit(**changed):
    """A fit of two lags behind 1 s, within 0.99 to 1.01 s, with nothing to flag."""
    delay = np.linspace(0.9, 1.1, 21)
    values = {
        "delay": 1.0,
        "low": 0.99,
        "high": 1.01,
        "latest": 5.0,
        "poles": np.array([-1.0, -2.0]),
        "numerator": np.array([2.0]),
        "adequate": True,
        "misfit": 1.0,
        "residual": 0.01,
        "correlation": 1.0,
        "views": (),
        "profile": (delay, ((delay - 1.0) / 0.005) ** 2),
        "fitted": np.zeros(100),
        "chain": "",
        "endless": False,
        "like_flow": False,
        "open_start": False,
        "relaxing": False,
        "flows": (),
        "follows_flow": False,
        "whitened": False,
    }
    assert changed.keys() <= values.keys()
    return SimpleNamespace(**values | changed)


def data(**changed):
    values = {
        "output": np.zeros(100),
        "edge": 20,
        "dt": DT,
        "drift": 0.0,
        "hum": [],
        "coarse": False,
        "quantum": 0.0,
        "sigma": 0.01,
    }
    assert changed.keys() <= values.keys()
    return SimpleNamespace(**values | changed)


def of_model(max_delay=None, length=10.0, **changed):
    found = model_flags(fit(**changed), DT, length, max_delay)
    return {flag.code: flag.message for flag in found if flag is not None}


def of_step(step=None, **changed):
    found = fit_flags(step or data(), fit(**changed), None)
    assert len({flag.code for flag in found}) == len(found)
    return {flag.code: flag.message for flag in found}


def test_a_fit_that_leaves_noise_around_a_firm_delay_has_no_flags():
    assert of_step() == {}
    assert sampled_flags(fit(), DT, 10.0, None) == ()


def test_a_delay_at_the_largest_one_allowed_is_flagged():
    assert set(of_model(50, high=4.9)) == {"delay_at_bound"}
    assert "max_delay=50 samples" in of_model(50, high=4.9)["delay_at_bound"]
    assert of_model(50, high=4.89) == {}
    # rounding of max_delay dt counts as reached; a bound that lies before it is another one
    assert set(of_model(50, high=4.95, latest=5.0 * (1 - 5e-10))) == {"delay_at_bound"}
    assert of_model(50, high=4.95, latest=5.0 * (1 - 2e-9)) == {}
    assert of_model(None, high=4.95) == {}


def test_no_delay_is_resolved_where_half_a_sample_is_not_ruled_out():
    assert set(of_model(low=0.05)) == {"no_delay_resolved"}
    assert in_time(1.01) in of_model(low=0.05)["no_delay_resolved"]
    assert of_model(low=0.051) == {}


def test_chains_of_many_lags_are_flagged():
    like = of_model(like_flow=True, chain="chain of 8 nearly equal lags")
    assert set(like) == {"many_lags"}
    assert "the model is a chain of 8 nearly equal lags" in like["many_lags"]
    assert f"begins {in_time(0.5 * (1.0 + 0.5))} earlier" in like["many_lags"]
    for like_flow in (False, True):
        assert "the longer they are" in of_model(endless=True, like_flow=like_flow)["many_lags"]


def flow(excess, lag=0.0):
    return SimpleNamespace(excess=excess, mean=2.0, peclet=8.0, lag=lag, delay=0.7)


def test_a_flow_is_flagged_where_it_fits_better_than_lags():
    assert of_model(flows=(flow(0.0), flow(3.0))) == {}
    better = of_model(flows=(flow(1.0), flow(-0.1, lag=0.3)))
    assert set(better) == {"dispersed_flow"}
    assert f"behind a dead time of {in_time(0.7)}" in better["dispersed_flow"]
    assert f" and a lag of {in_time(0.3)}" in better["dispersed_flow"]
    assert "Peclet number 8)" in of_model(flows=(flow(-1.0),))["dispersed_flow"]
    followed = of_model(flows=(flow(0.5),), follows_flow=True)
    assert "clearly better than lags" in followed["dispersed_flow"]


def test_an_open_beginning_is_flagged_with_its_interval():
    found = of_model(open_start=True)
    assert set(found) == {"onset_open"}
    assert interval_in_time(0.99, 1.01) in found["onset_open"]


def test_slow_poles_are_flagged_by_the_length_of_the_record():
    poles = np.array([-5.0, -0.2])
    assert of_model(length=10.0, poles=poles) == {}  # two time constants
    assert "1.9 of the slowest" in of_model(length=9.5, poles=poles)["not_settled"]
    assert set(of_model(length=10.0, poles=np.array([-5.0, -INTEGRATOR / 10.0]))) == {"not_settled"}
    slower = np.array([-5.0, -0.99 * INTEGRATOR / 10.0])
    assert set(of_model(length=10.0, poles=slower)) == {"integrating"}


def test_a_zero_on_the_right_is_an_inverse_response_where_it_is_slow_enough():
    # b(s) = b0 + b1 s from the lowest power on: a zero at -b0 / b1
    assert set(of_model(numerator=np.array([6.0, -1.0]))) == {"inverse_response"}
    assert "zero at 6 rad/s" in of_model(numerator=np.array([6.0, -1.0]))["inverse_response"]
    assert "zero at 0.5 rad/s" in of_model(numerator=np.array([0.5, -1.0]))["inverse_response"]
    assert of_model(numerator=np.array([6.01, -1.0])) == {}  # over three times the fastest pole
    assert of_model(numerator=np.array([1.0, 1.0])) == {}
    assert of_model(numerator=np.array([6.0, -1.0]), follows_flow=True, flows=()) == {}
    # (s - 3)(s - 100): the slower one counts
    both = of_model(numerator=np.array([300.0, -103.0, 1.0]))
    assert "zero at 3 rad/s" in both["inverse_response"]


def test_a_residual_with_structure_is_flagged_with_what_the_interval_is_then():
    views = (("whole", 1.0), ("early", 1.005))
    told = of_step(adequate=False, misfit=2.34, views=views)
    assert set(told) == {"structured_misfit"}
    assert "2.3 times the noise" in told["structured_misfit"]
    assert "median of five views" in told["structured_misfit"]
    assert "only if the structures given" in of_step(adequate=False)["structured_misfit"]


def test_views_that_lie_apart_are_named():
    views = (("whole", 1.0), ("early", 1.15), ("late", 0.84))
    assert of_step(adequate=False, views=views, low=0.85, high=1.15).keys() == {"structured_misfit"}
    apart = of_step(adequate=False, views=views, low=0.84, high=1.15)
    assert apart["views_disagree"] == f"far from the median lie: late {in_time(0.84)}"
    # of a delay below a sample 0.3 samples are meant
    short = {"delay": 0.0, "views": (("whole", 0.0), ("late", 0.02)), "adequate": False}
    assert "views_disagree" not in of_step(low=0.06, high=0.09, **short)
    assert "views_disagree" in of_step(low=0.06, high=0.091, **short)


def test_structures_disagree_where_together_they_are_wide():
    # the profile of the chosen one is 1.96 * 0.005 s to both sides
    wide = of_step(low=0.7, high=1.21)
    assert set(wide) == {"structures_disagree"}
    assert interval_in_time(0.7, 1.21) in wide["structures_disagree"]
    assert of_step(low=0.71, high=1.21) == {}  # half a dead time
    assert set(of_step(low=0.7, high=1.21, open_start=True)) == {"onset_open"}
    # as wide as the chosen one by itself
    delay = np.linspace(0.2, 1.8, 33)
    alone = (delay, ((delay - 1.0) / 0.15) ** 2)  # 0.588 s, and twice that is 1.176 s
    assert of_step(low=0.42, high=1.59, profile=alone) == {}
    assert set(of_step(low=0.40, high=1.59, profile=alone)) == {"structures_disagree"}
    # of a delay below a sample half a sample is meant
    tiny = {"delay": 0.01, "profile": (delay / 100, ((delay - 1.0) / 0.15) ** 2)}
    assert "structures_disagree" not in of_step(low=0.0, high=0.05, **tiny)
    assert "structures_disagree" in of_step(low=0.0, high=0.051, **tiny)
    found = sampled_flags(fit(low=0.7, high=1.21), DT, 10.0, None)
    assert [flag.code for flag in found] == ["structures_disagree"]


def test_a_record_that_is_no_step_tells_how_coloured_its_residual_is():
    (flag,) = sampled_flags(fit(adequate=False, correlation=3.21), DT, 10.0, None)
    assert flag.code == "coloured_residual"
    assert "3.21 samples of the residual count as one" in flag.message
    (bound,) = sampled_flags(fit(latest=1.02), DT, 10.0, 10)
    assert bound.code == "delay_at_bound"


def test_the_length_of_a_step_record_counts_from_its_edge():
    # 80 samples behind the edge, 8 s: 1.92 time constants
    assert "1.9 of the slowest" in of_step(poles=np.array([-0.24]))["not_settled"]
    assert of_step(poles=np.array([-0.25])) == {}
    found = fit_flags(data(), fit(latest=1.02), 10)
    assert [flag.code for flag in found] == ["delay_at_bound"]


def test_disturbances_are_named():
    assert of_step(data(edge=8)) == {}
    assert "7 samples before the step" in of_step(data(edge=7))["no_rest"]
    assert "2 per s" in of_step(data(drift=0.2))["drift"]
    moving = of_step(data(drift=0.2), relaxing=True)
    assert set(moving) == {"not_at_rest"}  # which takes the place of a drift
    assert "5 Hz, 10 Hz" in of_step(data(hum=[0.5, 1.0]))["hum"]
    coarse = of_step(data(coarse=True, quantum=0.125))
    assert "steps of 0.125" in coarse["coarse_quantisation"]


def test_samples_far_off_the_model_are_outliers():
    output = np.zeros(1000)
    output[[1, 3, 5]] = 0.051, -0.051, 0.052  # over five times the residual
    level = {"fitted": np.zeros(1000)}
    assert "0.3 % of the samples" in of_step(data(output=output), **level)["outliers"]
    assert of_step(data(output=np.where(output > 0.0515, 0.0, output)), **level) == {}  # 0.2 %
    # in noise that is larger than the residual, or in a structured misfit, they are none
    assert of_step(data(output=output, sigma=0.011), **level) == {}
    assert of_step(data(output=output), residual=0.011, **level) == {}
    assert "outliers" not in of_step(data(output=output), adequate=False, **level)
    # what the model follows is not off it
    assert of_step(data(output=output), fitted=output) == {}


@pytest.mark.parametrize("code", [-999.0, 999.0])
def test_a_value_for_none_is_named(code):
    output = np.linspace(0.0, 1.0, 1000)
    output[[400, 700]] = code
    told = of_step(data(output=output), fitted=output)["outliers"]
    assert told.startswith(f"2 sample(s), the first at index 400, are {code:g}, 20 times")
    # several values are no code, and 20 times the range is far
    output[700] *= 1.0005  # half a unit
    assert of_step(data(output=output), fitted=output) == {}
    range_ = float(np.diff(np.percentile(np.linspace(0.0, 1.0, 1000), [1, 99]))[0])
    for times, flagged in ((19.9, False), (20.2, True)):
        output = np.linspace(0.0, 1.0, 1000)
        low, high = np.percentile(output, [1, 99])
        output[400] = high + times * range_ if code > 0 else low - times * range_
        assert bool(of_step(data(output=output), fitted=output)) == flagged


def test_a_signal_that_stands_still_but_for_one_sample_has_no_code():
    output = np.zeros(1000)
    output[400] = 1.0
    assert of_step(data(output=output), fitted=output) == {}


def repeats(**changed):
    values = {
        "outlying": (),
        "p_value": 0.5,
        "chi_square": 3.0,
        "trend": 0.0,
        "trend_error": 1.0,
    }
    return {f.code: f.message for f in repeat_flags(SimpleNamespace(**values | changed))}


def test_records_that_differ_are_flagged():
    assert repeats() == {}
    assert repeats(outlying=("b", "d"))["outlying_records"].endswith("of the mean: b, d")
    differing = repeats(p_value=0.0099, chi_square=31.4)
    assert "chi-square 31.4, p = 0.0099" in differing["records_differ"]
    assert repeats(p_value=0.01) == {}
    assert "(-3.1 +- 1 s per unit)" in repeats(trend=-3.1)["amplitude_trend"]
    assert set(repeats(trend=1.6, trend_error=0.5)) == {"amplitude_trend"}
    assert repeats(trend=3.0) == repeats(trend=1.0, trend_error=0.0) == {}


def test_records_that_are_others_over_again_are_named():
    time = np.arange(10.0)
    a, b = (cr.Record(time, time > 3, k * time) for k in (1.0, 2.0))
    assert same_record_flags((a, b)) == ()
    (flag,) = same_record_flags((a, b, a, b))
    assert flag.code == "same_records"
    assert flag.message.startswith("2 of 4 records are others over again (the 3. is the 1., the 4.")
    assert "the 2.)" in flag.message
    (many,) = same_record_flags((a,) * 6)
    assert "(the 2. is the 1., the 3. is the 1., the 4. is the 1. and 2 more)" in many.message
    (four,) = same_record_flags((a,) * 5)
    assert "the 4. is the 1. and 1 more)" in four.message
    (three,) = same_record_flags((a,) * 4)
    assert "more" not in three.message
