"""Responses and misfits of many models at once."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.hankel.iae import integrated_absolute_error, markov_stack
from tests.oracles.plants import modal


def stack(models: int, order: int, radius: float = 0.97):
    rng = np.random.default_rng(order)
    parts = [modal(rng, order, radius=radius) for _ in range(models)]
    return (
        np.stack([A for A, *_ in parts]),
        np.stack([B[:, 0] for _, B, *_ in parts]),
        np.stack([C[0] for *_, C, _ in parts]),
    )


def stepped(A, B, C, count):
    out, x = np.empty(count), B.copy()
    for k in range(count):
        out[k] = C @ x
        x = A @ x
    return out


@pytest.mark.parametrize("count", [1, 2, 3, 31, 32, 33, 1100])
@pytest.mark.parametrize("order", [1, 3, 8])
def test_block_powers_step_the_states(count, order):
    A, B, C = stack(4, order)
    expected = [stepped(*model, count) for model in zip(A, B, C, strict=True)]
    # 1100 steps, each rounded at 1e-16 of a state of order ten
    assert_allclose(markov_stack(A, B, C, count), expected, atol=1e-12)


def test_defective_matrices_are_no_special_case():
    A = np.array([[[0.9, 1.0], [0.0, 0.9]]])
    k = np.arange(200)
    expected = k * 0.9 ** (k - 1.0)
    response = markov_stack(A, np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]]), 200)
    assert_allclose(response[0], expected, atol=1e-13 * expected.max())


@pytest.mark.parametrize("delays", [[0, 3, 17, 40], [5], [0], [40, 0], [3, 4, 5, 6], [4, 3]])
def test_misfit_is_the_sum_over_one_window_for_all_delays(delays):
    A, B, C = stack(len(delays), 3)
    rng = np.random.default_rng(1)
    data, D = rng.standard_normal(90), rng.standard_normal(len(delays))
    expected = []
    for i, d in enumerate(delays):
        model = np.r_[np.zeros(d), D[i], stepped(A[i], B[i], C[i], 89 - d)]
        expected.append(np.abs(data - model).sum())
    misfit = integrated_absolute_error(data, np.array(delays), (A, B, C, D))
    assert_allclose(misfit, expected, rtol=1e-13)


def test_a_model_that_leaves_the_range_of_floats_has_an_infinite_misfit():
    # two states that grow beyond all bounds and cancel: inf - inf
    A = np.array([np.diag([1e30, 1e30]), np.diag([0.5, 0.5])])
    B, C = np.ones((2, 2)), np.array([[1.0, -1.0], [1.0, -1.0]])
    misfit = integrated_absolute_error(np.ones(50), np.array([0, 1]), (A, B, C, np.ones(2)))
    assert misfit[0] == np.inf
    assert np.isfinite(misfit[1])


def test_the_data_are_not_changed():
    data = np.arange(20.0)
    data.flags.writeable = False
    A, B, C = stack(1, 2)
    integrated_absolute_error(data, np.array([2]), (A, B, C, np.zeros(1)))
