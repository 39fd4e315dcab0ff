"""The least squares of a flow that disperses: responses, starts, errors, and when to stop."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import invgauss

from ctrl_realize.numerics import dispersed_flow as module
from ctrl_realize.numerics.delayed_modes import MoveTrain, SampledInput
from ctrl_realize.numerics.dispersed_flow import (
    DispersedFlow,
    _FlowFit,
    _followed,
    fit_flows,
    flow_profile,
)
from ctrl_realize.numerics.own_terms import Stretches
from ctrl_realize.numerics.separable_fit import KnownFactor, Problem, Structure
from ctrl_realize.numerics.structure_search import PLAUSIBLE, Candidate, Scales

DT, SIZE = 0.1, 240
TIME = DT * np.arange(SIZE)
MOVES, SIZES = np.array([1.0, 9.0]), np.array([1.0, -0.4])
SCALES = Scales(onset=2.0, rise=4.0, length=23.0, dt=DT, latest=6.0, earliest=0.5)
# delay, mean, spread: 1.73 s, 3 s, 0.6
TRUTH = np.array([1.73 / 4, np.log(3.0 / 4), np.log(0.6)])


def passed(time, mean=3.0, spread=0.6):
    return invgauss(mu=spread**2, scale=mean / spread**2).cdf(np.clip(time, 0, None))


def response(delay=1.73, **shape):
    return sum(s * passed(TIME - at - delay, **shape) for at, s in zip(MOVES, SIZES, strict=True))


def train():
    return MoveTrain(TIME, np.ones(SIZE, dtype=np.int64), DT, MOVES, SIZES)


def flow_fit(lagging=False, noise=0.01, known=None, scales=SCALES):
    data = 5 + 2 * response() + noise * np.random.default_rng(0).standard_normal(SIZE)
    known = known or KnownFactor()
    problem = Problem(data, np.ones(SIZE), train(), np.ones((SIZE, 1)), known)
    return _FlowFit(problem, problem.drive, scales, lagging)


def test_the_response_is_the_distribution_of_residence_times_after_every_move():
    assert flow_fit()._response(TRUTH) == pytest.approx(response(), abs=1e-9)


def test_a_lag_behind_the_flow_is_that_of_known_dynamics():
    lag = 0.7
    known = KnownFactor(np.array([-1 / lag + 0j]), np.array([1 / lag]))
    behind = flow_fit(lagging=True)._response(np.append(TRUTH, np.log(lag / 4)))
    assert flow_fit(known=known)._response(TRUTH) == pytest.approx(behind, abs=1e-12)
    assert np.abs(behind - response()).max() > 0.05
    # known dynamics and a lag: two lags, in either order
    other = KnownFactor(np.array([-2.0 + 0j]), np.array([2.0]))
    both = flow_fit(lagging=True, known=other)._response(np.append(TRUTH, np.log(lag / 4)))
    swapped = flow_fit(lagging=True, known=known)._response(np.append(TRUTH, np.log(0.5 / 4)))
    assert both == pytest.approx(swapped, abs=1e-12)


def test_wide_bins_are_means_by_simpson_s_rule():
    width = np.array([1] * 40 + [2] * 10 + [3] * 20 + [12] * 10)
    first = np.concatenate([[0], np.cumsum(width)[:-1]])
    drive = MoveTrain(DT * first, width, DT, MOVES, SIZES)
    fit = replace(flow_fit(), drive=drive)
    found = fit._response(TRUTH)
    fine = np.array(
        [response_at(DT * np.linspace(f, f + w - 1, 3)) for f, w in zip(first, width, strict=True)]
    )
    assert found == pytest.approx(fine @ [1 / 6, 4 / 6, 1 / 6], abs=1e-9)
    means = np.add.reduceat(response(), first) / width
    # a bin of 1.2 s among residence times of 3 s, of which the second move is in one
    assert found == pytest.approx(means, abs=0.02)


def response_at(time):
    return sum(s * passed(time - at - 1.73) for at, s in zip(MOVES, SIZES, strict=True))


def test_times_and_parameters_go_back_and_forth():
    assert flow_fit().times(TRUTH) == pytest.approx((1.73, 3.0, 0.6, 0.0))
    flow = DispersedFlow(1.73, 3.0, 0.6, 0.7, 0.0, 0.0, 0.0)
    assert flow_fit().parameters(flow) == pytest.approx(TRUTH)
    x = flow_fit(lagging=True).parameters(flow)
    assert x == pytest.approx([*TRUTH, np.log(0.7 / 4)])
    assert flow_fit(lagging=True).times(x) == pytest.approx((1.73, 3.0, 0.6, 0.7))
    assert (flow.parameters, replace(flow, lag=0.0).parameters) == (3, 2)
    assert (flow_fit().count, flow_fit(lagging=True).count) == (4, 5)
    assert flow.peclet == pytest.approx(2 / 0.36)


def test_bounds_are_in_rises():
    low, high = flow_fit(lagging=True).bounds
    # a tenth of a sample to three records; spreads of 0.1 to 1.2
    times = np.log([0.01 / 4, 69.0 / 4])
    assert low == pytest.approx([0.5 / 4, times[0], np.log(0.1), times[0]])
    assert high == pytest.approx([6.0 / 4, times[1], np.log(1.2), times[1]])
    for bound, whole in zip(flow_fit().bounds, (low, high), strict=True):
        assert np.array_equal(bound, whole[:3])


def test_gain_and_level_are_eliminated():
    fit = flow_fit(noise=0.0)
    assert np.abs(fit.residual(TRUTH)).max() < 1e-8
    x = TRUTH + 0.1
    columns = np.stack([fit._response(x), np.ones(SIZE)], axis=1)
    left = fit.problem.data - columns @ np.linalg.lstsq(columns, fit.problem.data, rcond=None)[0]
    assert fit.residual(x) == pytest.approx(left, abs=1e-10)
    assert fit.cost(x) == pytest.approx(left @ left)
    # with weights
    weight = np.linspace(0.5, 2, SIZE)
    weighted = replace(fit, problem=replace(fit.problem, root_weight=weight))
    best = np.linalg.lstsq(columns * weight[:, None], fit.problem.data * weight, rcond=None)[0]
    left = weight * (fit.problem.data - columns @ best)
    assert weighted.residual(x) == pytest.approx(left, abs=1e-10)


def test_starts_share_mean_and_variance_in_time_out():
    wide = flow_fit(lagging=True, scales=replace(SCALES, earliest=0.0))
    delay, mean, deviation = 2.0, 6.0, 1.5
    starts = [wide.times(x) for x in wide.starts(delay, mean, deviation)]
    assert len(starts) == 16
    for begins, flow, spread, lag in starts:
        assert begins + flow + lag == pytest.approx(mean)
        assert (spread * flow) ** 2 + lag**2 == pytest.approx(deviation**2)
    assert sorted({round(one[0], 9) for one in starts}) == [0.0, 0.8, 1.4, 1.9]
    assert sorted({round(one[3], 9) for one in starts}) == [0.075, 0.45, 0.9, 1.35]
    # without a lag all of the spread is that of the flow
    plain = flow_fit(scales=replace(SCALES, earliest=0.0))
    found = [plain.times(x) for x in plain.starts(delay, mean, deviation)]
    assert [one[0] for one in found] == pytest.approx([0.0, 0.8, 1.4, 1.9])
    assert [one[1] for one in found] == pytest.approx([6.0, 5.2, 4.6, 4.1])
    assert [one[1] * one[2] for one in found] == pytest.approx([1.5] * 4)


def test_starts_lie_within_the_bounds_and_leave_the_flow_some_time():
    fit = flow_fit(lagging=True)
    low, high = fit.bounds
    starts = list(fit.starts(4.0, 3.0, 2.0))
    # a delay of 2.8 s and more leaves nothing beside a lag of 0.6 s; 1.6 s leaves some beside 1.2
    assert 0 < len(starts) < 16
    for x in starts:
        assert np.all((low <= x) & (x <= high))
        delay, flow, _, lag = fit.times(x)
        assert delay >= 0.5
        assert flow > 0
        assert lag < 2.0
    assert list(fit.starts(4.0, 0.0, 2.0)) == []


def test_a_start_is_followed_to_its_minimum():
    fit = flow_fit()
    x = fit.improved(TRUTH + np.array([0.1, -0.2, 0.2]))
    assert x[0] * 4 == pytest.approx(1.73, abs=0.05)
    for step in 0.01 * np.eye(3):
        assert fit.cost(x) < min(fit.cost(x + step), fit.cost(x - step))


def test_a_delay_that_is_fixed_is_kept():
    fit = flow_fit()
    for delay in (0.3, 0.5):
        x = fit.improved(np.append(delay, TRUTH[1:]), fixed_delay=True)
        assert x[0] == delay
        assert x.size == 3
        for step in 0.02 * np.eye(3)[1:]:
            assert fit.cost(x) < min(fit.cost(x + step), fit.cost(x - step))


def test_a_start_may_be_on_its_bounds():
    fit = flow_fit()
    for bound in fit.bounds:
        x = fit.improved(np.append(bound[0], TRUTH[1:]))
        assert x[0] * 4 == pytest.approx(1.73, abs=0.05)
        corner = fit.improved(bound)
        assert np.all((fit.bounds[0] <= corner) & (corner <= fit.bounds[1]))


def test_what_is_improved_stays_within_its_bounds():
    for bounds in ({"latest": 1.5}, {"earliest": 2.0}):
        fit = flow_fit(scales=replace(SCALES, **bounds))
        x = fit.improved(TRUTH)
        assert fit.bounds[0][0] <= x[0] <= fit.bounds[1][0]
        # trust-region steps keep off a bound by some part of the range
        assert x[0] * 4 == pytest.approx(next(iter(bounds.values())), abs=0.02)


@pytest.mark.parametrize("side", [-20.0, 20.0])
def test_starts_beyond_the_bounds_are_taken_to_them(side):
    x = flow_fit().improved(np.array([side, *TRUTH[1:]]))
    assert x[0] * 4 == pytest.approx(1.73, abs=0.05)
    corner = flow_fit().improved(np.full(3, side))
    low, high = flow_fit().bounds
    assert np.all((low <= corner) & (corner <= high))


def test_the_error_of_the_delay_is_that_of_least_squares():
    fit = flow_fit()
    x = fit.improved(TRUTH)
    step = 1e-4
    jacobian = np.stack(
        [
            (fit.residual(x + step * row) - fit.residual(x - step * row)) / (2 * step)
            for row in np.eye(3)
        ],
        axis=1,
    )
    covariance = 0.01**2 * np.linalg.inv(jacobian.T @ jacobian)
    # forward differences of 1e-5, of parameters of order one
    assert fit.delay_error(x, 0.01**2) == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-3)
    assert fit.delay_error(x, 0.04**2) == pytest.approx(4 * fit.delay_error(x, 0.01**2))


def test_a_profile_goes_from_the_optimum_to_three_errors_and_its_bounds():
    fit = flow_fit()
    x = fit.improved(TRUTH)
    flow = DispersedFlow(*fit.times(x), fit.cost(x), 0.0, 0.0)
    error = 4 * fit.delay_error(x, 0.01**2)
    delay, excess = flow_profile(fit.problem, flow, SCALES, 0.01**2)
    away = np.array([0.7, 1.2, 1.7, 2.3, 3.2])
    expected = np.concatenate([-away[::-1], [0.0], away])
    assert (delay - flow.delay) / error == pytest.approx(expected, rel=1e-6)
    assert excess.min() == 0.0
    # near a parabola: one at a standard error
    assert excess == pytest.approx(expected**2, rel=0.35, abs=0.05)
    near = replace(SCALES, latest=flow.delay + 0.9 * error)
    delay, _ = flow_profile(fit.problem, flow, near, 0.01**2)
    assert delay[-1] == pytest.approx(near.latest)
    assert delay.size == 1 + 5 + 2
    near = replace(SCALES, earliest=flow.delay - 0.9 * error)
    delay, _ = flow_profile(fit.problem, flow, near, 0.01**2)
    assert delay[0] == pytest.approx(near.earliest)
    assert delay.size == 1 + 5 + 2


def test_a_profile_of_a_flow_with_a_lag_keeps_the_lag():
    fit = flow_fit(lagging=True)
    x = np.append(TRUTH, np.log(0.7 / 4))
    data = 5 + 2 * fit._response(x) + 0.01 * np.random.default_rng(0).standard_normal(SIZE)
    fit = replace(fit, problem=replace(fit.problem, data=data))
    x = fit.improved(x)
    flow = DispersedFlow(*fit.times(x), fit.cost(x), 0.0, 0.0)
    assert 0.2 < flow.lag < 1.0
    delay, excess = flow_profile(fit.problem, flow, SCALES, 0.01**2)
    best = int(np.argmin(excess))
    for i in (best - 1, best + 1):
        other = fit.improved(np.append(delay[i] / 4, x[1:]), fixed_delay=True)
        assert excess[i] == pytest.approx((fit.cost(other) - flow.cost) / 0.01**2, rel=1e-6)
    # without one it would be another
    plain = flow_profile(fit.problem, replace(flow, lag=0.0), SCALES, 0.01**2)[1]
    assert abs(plain[best - 1] - excess[best - 1]) > 0.01


# --- which are followed


class Ends:
    """Stands in for least squares: every start has a cost, and one when it is improved."""

    count = 4

    def __init__(self, *costs):
        self.costs, self.seen = dict(costs), []

    def starts(self, *target):
        self.target = target
        return [np.array([start]) for start in self.costs]

    def cost(self, x):
        return float(x[0])

    def improved(self, x):
        self.seen.append(float(x[0]))
        return np.array([self.costs[float(x[0])]])

    def times(self, x):
        return float(x[0]), 2.0, 0.3, 0.0


def follow(ends, level=0.0):
    # a variance of 2, a penalty of 5
    return _followed(ends, (1.0, 2.0, 3.0), 2.0, 5.0, level)


def test_the_three_best_starts_are_followed_and_the_best_end_is_kept():
    ends = Ends((40.0, 1.0), (20.0, 9.0), (30.0, 6.0), (10.0, 8.0))
    (flow,) = follow(ends)
    assert ends.target == (1.0, 2.0, 3.0)
    assert ends.seen == [10.0, 20.0, 30.0]
    assert (flow.delay, flow.mean, flow.spread, flow.lag) == (6.0, 2.0, 0.3, 0.0)
    assert flow.cost == 6.0
    # 6 / 2, four parameters, and 8 for being a flow
    assert flow.criterion == 3.0 + 20.0 + 8.0
    assert flow.excess == 31.0
    assert follow(Ends((10.0, 8.0)), level=40.0)[0].excess == -8.0
    assert follow(Ends()) == []


def test_two_ends_that_are_one_are_enough():
    # a tenth of the variance of 2
    ends = Ends((10.0, 8.0), (20.0, 8.19), (30.0, 6.0))
    assert follow(ends)[0].cost == 8.0
    assert ends.seen == [10.0, 20.0]
    ends = Ends((10.0, 8.0), (20.0, 7.81), (30.0, 6.0))
    assert follow(ends)[0].cost == 7.81
    assert ends.seen == [10.0, 20.0]
    ends = Ends((10.0, 8.0), (20.0, 8.21), (30.0, 6.0))
    assert follow(ends)[0].cost == 6.0


def test_what_ends_far_above_the_level_is_left_alone():
    # 300 above: 544 / 2 and 28
    ends = Ends((10.0, 543.9), (20.0, 6.0))
    assert follow(ends)[0].cost == 6.0
    ends = Ends((10.0, 544.1), (20.0, 6.0))
    assert follow(ends)[0].cost == 544.1
    assert ends.seen == [10.0]
    assert follow(Ends((10.0, 544.1), (20.0, 6.0)), level=1.0)[0].cost == 6.0


@pytest.fixture
def followed(monkeypatch):
    """Flows are by hand, with a lag and without one; what was asked is recorded."""
    seen = SimpleNamespace(asked=[], moments=(7.0, 2.25), excess=0.0, lag=0.5, spread=0.3)

    def follow(fit, target, variance, penalty, level):
        seen.asked.append((fit.lagging, target, variance, penalty, level))
        assert fit.scales is SCALES
        lag = seen.lag if fit.lagging else 0.0
        return [DispersedFlow(1.0, 2.0, seen.spread, lag, 0.0, 0.0, seen.excess)]

    monkeypatch.setattr(module, "_followed", follow)
    monkeypatch.setattr(module, "time_moments", lambda problem, like: seen.moments)
    return seen


def flows(problem=None):
    like = Candidate(Structure(2, 2), np.array([1.9, 0.0, 0.0]), 0.0)
    return fit_flows(problem or flow_fit().problem, like, SCALES, 2.0, 5.0, 33.0)


def test_flows_are_tried_with_a_lag_and_without_one(followed):
    found = flows()
    assert [flow.lag for flow in found] == [0.5, 0.0]
    target = (1.9, 7.0, 1.5)
    assert followed.asked == [(True, target, 2.0, 5.0, 33.0), (False, target, 2.0, 5.0, 33.0)]


def test_without_a_lag_only_a_parameter_can_be_won(followed):
    followed.excess = PLAUSIBLE + 5.0
    assert len(flows()) == 2
    followed.excess = PLAUSIBLE + 5.1
    assert [flow.lag for flow in flows()] == [0.5]


def test_flows_that_spread_by_less_than_half_their_lag_are_none(followed):
    # a spread of 0.6 s
    followed.lag = 1.2
    assert [flow.lag for flow in flows()] == [1.2, 0.0]
    followed.lag = 1.21
    assert [flow.lag for flow in flows()] == [0.0]


def test_what_spreads_by_less_than_a_sample_and_what_flows_have_no_poles_for_is_not_tried(followed):
    followed.moments = 7.0, 0.99 * DT**2
    assert flows() == []
    followed.moments = 7.0, 1.01 * DT**2
    assert len(flows()) == 2
    problem = flow_fit().problem
    pieces = Stretches(np.array([0, SIZE]), TIME, np.ones((SIZE, 1)))
    assert flows(replace(problem, stretches=pieces)) == []
    assert flows(replace(problem, drive=SampledInput(np.ones(SIZE), DT))) == []
