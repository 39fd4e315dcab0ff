"""Regulator and filter against the big Riccati equations, controllers against eigenvalues."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ctrl_realize as cr


@pytest.fixture(scope="module")
def balanced(valve):
    """The valve in balanced coordinates, where the big Riccati equation keeps its digits."""
    core = cr.design.reduce(valve(0), 3).delay_free
    return lambda delay: cr.delayed_ss(core, delay)


def enlarged(plant, Q):
    weight = np.zeros((plant.nstates, plant.nstates))
    weight[: Q.shape[0], : Q.shape[0]] = Q
    return weight


@pytest.mark.parametrize("delay", [0, 1, 5, 37])
def test_gain_equals_dlqr_of_the_augmented_system(balanced, delay):
    plant = balanced(delay)
    C = np.asarray(plant.delay_free.C)
    Q = C.T @ C + 1e-3 * np.eye(3)
    found = cr.design.predictor_lqr(plant, Q, 0.1)
    K, _, _ = ct.dlqr(plant.A, plant.B, enlarged(plant, Q), 0.1)
    np.testing.assert_allclose(found.gain, K, rtol=1e-9, atol=1e-9)
    # The chain's poles at 0 are defective: eigenvalues scatter by eps^(1/d).
    moved = np.linalg.eigvals(plant.A - plant.B @ found.gain)
    np.testing.assert_allclose(np.sort(np.abs(moved))[-3:], np.sort(np.abs(found.poles)), rtol=1e-6)


def test_gain_at_a_thousand_samples_is_the_prediction_law(balanced):
    plant = balanced(1000)
    found = cr.design.predictor_lqr(plant, np.eye(3), 1.0)
    assert found.gain.shape == (1, 1003)
    A, B = np.asarray(plant.delay_free.A), np.asarray(plant.delay_free.B)
    x = np.random.default_rng(0).standard_normal(1003)
    state, sent = x[:3], x[3:]  # u[k-1] ... u[k-1000]
    for u in sent[::-1]:
        state = A @ state + B[:, 0] * u
    assert found.gain @ x == pytest.approx(found.core_gain @ state, rel=1e-9)


def several_inputs(delays, seed=0, **settings):
    rng = np.random.default_rng(seed)
    m = len(delays)
    A = np.diag([0.9, 0.8, 1.01]) + 0.05 * rng.standard_normal((3, 3))
    core = ct.ss(A, rng.standard_normal((3, m)), rng.standard_normal((2, 3)), 0, 0.1)
    return cr.delayed_ss(core, delays, **settings)


@given(
    delays=st.lists(st.integers(0, 8), min_size=1, max_size=3),
    output_delay=st.integers(0, 3),
    seed=st.integers(0, 10**6),
)
@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_any_delays_give_the_gain_of_the_augmented_system(delays, output_delay, seed):
    plant = several_inputs(delays, seed, output_delay=output_delay)
    Q, R = np.eye(3), np.eye(len(delays))
    K, *_ = ct.dlqr(plant.A, plant.B, enlarged(plant, Q), R)
    found = cr.design.predictor_lqr(plant, Q, R).gain
    # 1e-7: what the Riccati equation of the augmented system keeps for a random, badly
    # reachable core; the recursion's own loss is far below.
    np.testing.assert_allclose(found, K, rtol=0, atol=1e-7 * np.abs(K).max())


@pytest.mark.parametrize("delay", [0, 5, 37])
def test_filter_equals_dlqe_of_the_augmented_system(balanced, delay):
    plant = balanced(delay)
    QN = 1e-3 * np.eye(3)
    found = cr.design.kalman_predictor(plant, QN, 0.1)
    into = np.eye(plant.nstates)[:, :3]
    L, *_ = ct.dlqe(plant.A, into, plant.C, QN, np.array([[0.1]]))
    np.testing.assert_allclose(L[:3], found.gain, rtol=1e-9)
    np.testing.assert_allclose(L[3:], 0, atol=1e-12)
    A, C = np.asarray(plant.delay_free.A), np.asarray(plant.delay_free.C)
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(A - found.gain @ C)), np.sort_complex(found.poles)
    )


@pytest.mark.parametrize(("delays", "late"), [((0, 6), (0, 0)), ((2, 5), (3, 1)), ((0, 0), (4, 4))])
def test_lqg_of_several_channels_has_the_poles_of_regulator_and_estimator(delays, late):
    plant = several_inputs(delays, output_delay=late)
    Q, QN = np.eye(3), 0.1 * np.eye(3)
    controller = cr.design.lqg(plant, Q, np.eye(2), QN, np.eye(2))
    assert controller.nstates == 3 + sum(delays) + sum(late)
    loop = ct.feedback(ct.ss(plant) * controller, np.eye(2))
    expected = np.concatenate(
        [
            cr.design.predictor_lqr(plant, Q, np.eye(2)).poles,
            cr.design.kalman_predictor(plant, QN, np.eye(2)).poles,
        ]
    )
    # Up to ten poles at 0 in one chain scatter to eps^(1/10) = 0.03 and more.
    expected = np.sort(np.abs(expected[np.abs(expected) > 0.2]))
    assert expected.size >= 5
    found = np.sort(np.abs(loop.poles()))[-expected.size :]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize("price", [0.0, -1.0])
def test_a_weight_on_the_input_is_above_zero(price):
    plant = cr.delayed_ss(ct.tf([2.0], [40.0, 1.0]), dead_time=6.0, dt=1.0)
    with pytest.raises(cr.errors.OptionError, match=r"R has an eigenvalue .*expected all of them"):
        cr.design.predictor_lqr(plant, 1.0, price)


def test_a_regulator_of_states_is_not_judged_by_outputs_of_other_models():
    # with them in the place of the weighted states the loop of a negative plant was "unstable"
    plant = cr.design.ProcessModel(gain=2.0, lag=30.0, second_lag=6.0, dead_time=8.5).system(0.75)
    t = 0.75 * np.arange(500)
    u = np.where(t < 37.5, 0.0, 10.0)
    y = plant.simulate(u) + 0.1 * np.random.default_rng(0).standard_normal(t.size)
    checks = [
        cr.design.predictor_lqr(cr.identify(cr.Record(t, u, sign * y)), np.eye(2), 1.0).check
        for sign in (1, -1)
    ]
    assert checks[0].worst.ms == pytest.approx(checks[1].worst.ms, rel=1e-6)
    assert max(check.worst.ms for check in checks) < 1.1  # 1.016 to 1.026 on models of its order
    assert all(check.stable_within_interval for check in checks)
