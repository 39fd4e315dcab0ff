"""Families of models with few parameters: derivatives, gains within bounds, standard errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import gammainc

from ctrl_realize.numerics.engine.eliminate import eliminate
from ctrl_realize.numerics.engine.problem import Bounds, KnownFactor, Structure
from ctrl_realize.numerics.engine.static_gain import static_gain
from ctrl_realize.numerics.engine.structures import Candidate
from ctrl_realize.numerics.engine.window_fit import window_of_rows, with_known_noise
from ctrl_realize.numerics.families.equal_lags import fit_chains
from ctrl_realize.numerics.families.flow import fit_flows
from ctrl_realize.numerics.families.form_fit import fit_form, form_family
from ctrl_realize.numerics.families.process_form import ProcessForm
from ctrl_realize.numerics.families.slow_lags import SlowLags, fit_slow_lags
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window

DELAY, SIGMA = 20.3, 1e-3
VALUES = {
    "dead_time": DELAY, "lag_1": 20.0, "lag_2": 8.0, "lag_3": 7.9, "pair_time_1": 12.0,
    "pair_damping_1": 0.7, "lead_1": 3.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def case():
    """Four equal lags of 12 samples behind a dead time of 20.3."""
    k = np.arange(-300, 600, dtype=float)
    y = gammainc(4, np.clip(k - DELAY, 0, None) / 12)
    y += SIGMA * np.random.default_rng(3).standard_normal(k.size)
    data = step_data(y, (k >= 0).astype(float), 1.0, [(300, 1)])
    return window(data, k.size, KnownFactor()).problem, step_scales(data, k.size, None)


def assert_exact(problem, family, x):
    """The gradient of the sum of squares is the limit of its differences."""
    state = family.evaluate(problem, x[None])
    short = family.compress(problem, x[None])
    assert_allclose(short.cost, state.cost, rtol=1e-10)
    products = [one.jacobian[0].T @ one.jacobian[0] for one in (short, state)]
    assert_allclose(*products, rtol=0, atol=1e-9 * products[1].max())
    slope = -2 * state.jacobian[0].T @ state.residual[0]
    moves = 1e-5 * np.diag(np.maximum(np.abs(x), 1.0))
    ahead, behind = (family.evaluate(problem, x + way * moves).cost for way in (1, -1))
    steep = (ahead - behind) / (2 * moves.diagonal())
    assert_allclose(slope, steep, rtol=0, atol=1e-5 * np.abs(steep).max())


@pytest.mark.parametrize(
    "form",
    [
        ProcessForm("P2D", 2),
        ProcessForm("P3D", 3),
        ProcessForm("P3DUZ", 1, pair=True, lead=True),
        ProcessForm("P1DI", 1, integrator=True),
        ProcessForm("P2D", 2, fixed={"gain": 0.7}),
    ],
    ids=["two lags", "two of three are equal", "pair and lead", "integrator", "gain"],
)
def test_derivatives_of_forms_are_limits_of_differences(case, form):
    problem, scales = case
    family = form_family(form, scales)
    assert_exact(problem, family, family.coordinates(VALUES))


def test_derivatives_of_chains_and_flows_are_limits_of_differences(case):
    problem, scales = case
    theta = np.array([25.0, np.log(0.05), np.log(0.04), np.log(1.1)])
    like = Candidate(Structure(3, 3), theta, 1.0)
    fits = with_known_noise(window_of_rows(problem), {like.structure: like}, scales, SIGMA)
    flows = fit_flows(fits, 0.0)
    assert flows
    for flow in flows:
        assert_exact(problem, flow.fit.structure, flow.fit.parameters + 0.1)
    chain = fit_chains(fits)[0]
    assert abs(chain.candidate.dead_time - DELAY) < 4 * chain.error


def test_a_gain_within_bounds_is_the_best_one_or_at_a_bound(case):
    problem, scales = case
    form = ProcessForm("P2D", 2, bounds={"gain": (0.0, 0.9)})
    bounded, free = form_family(form, scales), form_family(ProcessForm("P2D", 2), scales)
    x = free.coordinates(VALUES)
    best = free.gain(problem, x)
    assert best > 0.9  # of a plant with gain 1
    assert bounded.gain(problem, x) == pytest.approx(0.9, rel=1e-14)
    # Of all gains up to there no other one leaves less.
    residual, unit = (
        free.evaluate(problem, x[None]).residual[0],
        free.directions(problem, x)[0][:, -1],
    )
    lost = [np.sum((residual + (best - g) * unit) ** 2) for g in (0.9, 0.89)]
    for cost in (bounded.evaluate(problem, x[None]).cost, bounded.compress(problem, x[None]).cost):
        assert_allclose(cost, lost[0], rtol=1e-12)
    assert lost[1] > lost[0]


def test_standard_errors_are_those_of_the_derivatives(case):
    problem, scales = case
    form = ProcessForm("P2D", 2, fixed={"gain": 1.0}, bounds={"lag_2": (1.0, 9.0)})
    like = Candidate(Structure(1, 1), np.array([30.0, np.log(0.03)]), 1.0)
    fit = fit_form(problem, form, replace(scales, latest=60.0), [like])
    found = {p.name: p for p in fit.structure.parameters(problem, fit.parameters, SIGMA**2)}
    assert found["gain"].std == 0.0
    assert fit.structure.at_bound == ("lag_2",)
    seen = np.array([n not in fit.structure.at_bound for n in fit.structure.names])
    jacobian = fit.structure.evaluate(problem, fit.parameters[None]).jacobian[0][:, seen]
    covariance = SIGMA**2 * np.linalg.inv(jacobian.T @ jacobian)
    assert_allclose(found["dead_time"].std, np.sqrt(covariance[0, 0]), rtol=1e-6)


@pytest.mark.parametrize("pairs", [0, 1])
def test_derivatives_of_slow_lags_are_limits_of_differences(case, pairs):
    problem, _ = case
    shape = np.log([0.05, 0.048, 0.11]) if not pairs else np.log([0.05, 0.08, 0.7])
    x = np.append(DELAY + 3.3, shape)
    family = SlowLags(3, 2, Bounds(x - 1, x + 1), pairs, 600.0)
    assert_exact(problem, family, x)
    alone = eliminate(problem, Structure(3, 2), family.theta(x)[None])
    assert_allclose(family.evaluate(problem, x[None]).cost, alone.cost, rtol=1e-12)


def test_the_fastest_lag_is_a_bound_of_the_best_fit(case):
    problem, scales = case
    free = Candidate(Structure(2, 2), np.array([25.0, np.log(0.06), np.log(1.2)]), 0.0)
    fits = with_known_noise(window_of_rows(problem), {free.structure: free}, scales, SIGMA)
    free = fit_slow_lags(fits, free, [], 1.0)  # two lags for four: 19 each
    slow = fit_slow_lags(fits, free, [], 24.0)
    assert np.all(np.abs(free.poles) > 1 / 24)
    assert slow.cost > free.cost
    assert_allclose(np.abs(slow.poles).max(), 1 / 24, rtol=0.02)  # equal poles are set apart
    assert slow.dead_time < free.dead_time


def test_nearly_equal_lags_leave_the_error_of_the_gain(case):
    """Differences see poles jump apart: they said 660 times the gain."""
    problem, _ = case
    stds = []
    for lags in ([12.0, 12.06, 11.95, 12.04], [13.5, 12.6, 11.6, 10.4]):
        x = np.append(DELAY, -np.log(lags))
        family = SlowLags(4, 4, Bounds(x - 1, x + 1), 0, 600.0)
        cost = float(family.evaluate(problem, x[None]).cost[0])
        stds.append(static_gain(problem, Candidate(family, x, cost), SIGMA**2, 600.0).gain_std)
    assert stds[1] <= stds[0] < 20 * stds[1]
