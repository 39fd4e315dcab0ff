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


@pytest.mark.parametrize("delays", [(1, 4), (5, 0, 2), (3, 3, 9), (0, 37), (7, 40, 11)])
def test_inputs_of_different_delays_get_the_gain_of_the_augmented_system(delays):
    plant = several_inputs(delays)
    Q, R = np.diag([1.0, 0.1, 2.0]), np.diag(1.0 + np.arange(len(delays)))
    if delays == (3, 3, 9):
        R[0, 1] = R[1, 0] = 0.5  # these two share a delay
    found = cr.design.predictor_lqr(plant, Q, R)
    K, *_ = ct.dlqr(plant.A, plant.B, enlarged(plant, Q), R)
    np.testing.assert_allclose(found.gain, K, rtol=0, atol=1e-9)
    assert found.delay == delays


def test_after_the_longest_delay_the_core_moves_as_if_there_were_none():
    plant = several_inputs((3, 20))
    found = cr.design.predictor_lqr(plant, np.eye(3), np.eye(2))
    core = plant.delay_free
    closed = core.A - core.B @ found.core_gain
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(closed)), np.sort_complex(found.poles), atol=1e-9
    )
    x = np.random.default_rng(4).standard_normal(plant.nstates)
    for k in range(30):
        after = plant.A @ x - plant.B @ (found.gain @ x)
        follows = np.allclose(after[:3], closed @ x[:3], rtol=0, atol=1e-10)
        assert follows == (k >= 20)
        x = after


@given(
    delays=st.lists(st.integers(0, 8), min_size=1, max_size=3),
    output_delay=st.integers(0, 3),
    seed=st.integers(0, 10**6),
)
def test_any_delays_give_the_gain_of_the_augmented_system(delays, output_delay, seed):
    plant = several_inputs(delays, seed, output_delay=output_delay)
    Q, R = np.eye(3), np.eye(len(delays))
    K, *_ = ct.dlqr(plant.A, plant.B, enlarged(plant, Q), R)
    found = cr.design.predictor_lqr(plant, Q, R).gain
    # 1e-7: what the Riccati equation of the augmented system keeps for a random, badly
    # reachable core; the recursion's own loss is far below.
    np.testing.assert_allclose(found, K, rtol=0, atol=1e-7 * np.abs(K).max())


def test_the_optimum_of_unequal_delays_costs_less_than_a_law_that_ignores_them():
    plant = several_inputs((2, 9))
    Q, R = np.eye(3), np.eye(2)
    found = cr.design.predictor_lqr(plant, Q, R)

    def spent(gain):
        x, total = np.ones(plant.nstates), 0.0
        for _ in range(600):
            u = -gain @ x
            total += x[:3] @ Q @ x[:3] + u @ R @ u
            x = plant.A @ x + plant.B @ u
        return total

    rng = np.random.default_rng(1)
    least = spent(found.gain)
    for _ in range(20):
        other = found.gain + 1e-3 * rng.standard_normal(found.gain.shape)
        assert spent(other) > least
    late = cr.design.predictor_lqr(plant.replace(delay=9), Q, R).gain
    # The law for nine samples on both inputs, its lines cut to those that are there.
    cut = np.hstack([late[:, :3], late[:, 3:5], late[:, 12:]])
    assert not spent(cut) < 1.05 * least


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
