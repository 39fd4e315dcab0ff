"""State-space matrices from Hankel pairs; responses and misfits of many models at once."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.hankel.delay_models import realize_at
from ctrl_realize.numerics.hankel.iae import integrated_absolute_error
from ctrl_realize.numerics.hankel.kung import realize_block, realize_symmetric
from ctrl_realize.numerics.hankel.matrix import hankel_matrix
from ctrl_realize.numerics.state_space.responses import markov
from tests.oracles import dense
from tests.oracles.plants import modal, valve_pulse


@pytest.mark.parametrize("rank", [1, 2, 7])
def test_matrix_free_realization_of_exact_data_ends_by_itself(rank):
    g = exact(rank, 2, 2, 800, rank)
    model = realize_at(g, 0, 799, rank, padded=False)
    assert model.singular_values.size == rank  # too large for the complete decomposition
    back = markov(model.A, model.B, model.C, g[:, :, 0], 800)
    assert_allclose(back, g, rtol=0, atol=1e-12 * np.abs(g).max())
    beyond = realize_at(g, 0, 799, rank + 2, padded=False)
    assert np.count_nonzero(beyond.singular_values) == rank


def exact(order: int, p: int, m: int, count: int, seed: int) -> np.ndarray:
    return markov(*modal(np.random.default_rng(seed), order, p, m), count)


def test_paper_formulas_with_the_misprints_corrected_return_the_markov_parameters():
    g = exact(3, 1, 1, 41, 0)
    H = hankel_matrix(g[0, 0, 1:], 20, 20)
    values, vectors = np.linalg.eigh(H)
    lead = np.argsort(-np.abs(values))[:3]
    A, B, C = realize_symmetric(
        values[np.newaxis, lead], vectors.T[np.newaxis, lead], g[0, :, 21:41]
    )
    model = markov(A[0], B[0][:, np.newaxis], C, g[:, :, 0], 41)
    assert_allclose(model, g, rtol=0, atol=1e-13 * np.abs(g).max())


@pytest.mark.parametrize("size", [150, 700])  # below and above the complete decomposition
@pytest.mark.parametrize("kind", ["zero-phase", "unfiltered"])
def test_padded_error_is_below_the_bound_and_poles_are_inside_for_every_order(size, kind):
    g = valve_pulse(kind, seed=size)[: size + 1]
    omega = np.linspace(0, np.pi, 1500)
    z = np.exp(1j * omega)
    # the data's own response, by Horner; the direct term is in both
    data = np.polyval(g[::-1], 1 / z)
    for order in (1, 2, 3, 5, 8):
        model = realize_at(g[np.newaxis, np.newaxis], 0, size, order, padded=True)
        assert np.abs(np.linalg.eigvals(model.A)).max() < 1
        states = np.linalg.solve(
            z[:, np.newaxis, np.newaxis] * np.eye(order) - model.A, np.tile(model.B, (z.size, 1, 1))
        )
        error = np.abs(data - g[0] - (model.C @ states)[:, 0, 0])
        assert error.max() <= model.rest_bound
        full = np.linalg.svd(hankel_matrix(g[1:], size, size), compute_uv=False)
        assert model.rest_bound >= 2 * full[order:].sum() * (1 - 1e-12)


@given(scale=st.floats(1e-9, 1e9), seed=st.integers(0, 100))
def test_data_times_c_scale_values_and_gain_and_nothing_else(scale, seed):
    g = exact(4, 1, 1, 301, seed) + 1e-3 * np.random.default_rng(seed).standard_normal(301)
    one = realize_at(g, 0, 300, 3, padded=False)
    other = realize_at(scale * g, 0, 300, 3, padded=False)
    largest = scale * one.singular_values[0]
    assert_allclose(other.singular_values, scale * one.singular_values, atol=1e-13 * largest)
    assert_allclose(other.A, one.A, atol=1e-8)  # gaps of the noisy data magnify 1e-12
    assert_allclose(
        np.linalg.norm(other.B) * np.linalg.norm(other.C),
        scale * np.linalg.norm(one.B) * np.linalg.norm(one.C),
        rtol=1e-8,
    )


def test_block_formulas_agree_with_the_textbook():
    g = exact(4, 2, 3, 81, 2) + 0.01 * np.random.default_rng(0).standard_normal((2, 3, 81))
    A, B, C, s = dense.kung(g, 0, 80, 3)
    H = hankel_matrix(g[:, :, 1:], 40, 40)
    U, values, Vt = np.linalg.svd(H)
    last = g[:, :, 41:81].transpose(0, 2, 1).reshape(2, -1)
    fast = realize_block(U[:, :3], values[:3], Vt[:3].T, (2, 3), last)
    want = markov(A, B, C, g[:, :, 0], 80)
    assert_allclose(markov(*fast, g[:, :, 0], 80), want, atol=1e-12)
    assert_allclose(values, s, rtol=0, atol=1e-12 * s[0])


def test_signs_of_singular_vectors_do_not_matter():
    g = exact(4, 2, 3, 81, 2)
    U, values, Vt = np.linalg.svd(hankel_matrix(g[:, :, 1:], 40, 40))
    last = g[:, :, 41:81].transpose(0, 2, 1).reshape(2, -1)
    models = []
    for turn in (np.ones(4), -np.ones(4), np.array([1, -1, -1, 1])):
        models.append(
            realize_block(turn * U[:, :4], values[:4], (turn[:, None] * Vt[:4]).T, (2, 3), last)
        )
    for other in models[1:]:
        for one, two in zip(models[0], other, strict=True):
            assert_allclose(one, two, atol=1e-13)
    # the input that moves a state most moves it up
    B = models[0][1]
    assert np.all(B[np.arange(4), np.abs(B).argmax(axis=1)] > 0)


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
