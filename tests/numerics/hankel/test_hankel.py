"""Hankel matrices: dense, by FFT, their norm, and leading eigenpairs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.hankel.lanczos import largest_magnitude, leading_eigenpairs
from ctrl_realize.numerics.hankel.matrix import hankel_matrix, hankel_norm_squared
from ctrl_realize.numerics.hankel.svd import leading_triplets, thin_svd
from tests.oracles.plants import modal, valve_pulse


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.mark.parametrize(
    ("shape", "rows", "columns"), [((9,), 5, 5), ((2, 3, 9), 4, 7), ((4,), 9, 9)]
)
def test_norm_without_the_matrix_is_the_norm_of_the_matrix(rng, shape, rows, columns):
    h = rng.standard_normal(shape)
    expected = np.sum(hankel_matrix(h, rows, columns) ** 2)
    assert hankel_norm_squared(h, rows, columns) == pytest.approx(expected, rel=1e-13)


KINDS = ["clean", "zero-phase", "causal", "unfiltered"]


def windows(pulse: np.ndarray, size: int, members: int) -> np.ndarray:
    return np.lib.stride_tricks.sliding_window_view(pulse[1:], 2 * size - 1)[:members]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 3, 8])
def test_pairs_satisfy_their_definition_to_the_tolerance(kind, count):
    h = windows(valve_pulse(kind), 250, 20)
    pairs = leading_eigenpairs(h, 250, count, tol=1e-9)
    for d in range(20):
        H = hankel_matrix(h[d], 250, 250)
        dense = np.sort(np.abs(np.linalg.eigvalsh(H)))[::-1]
        found = np.abs(pairs.values[d])
        assert_allclose(
            found, dense[:count], rtol=0, atol=1e-10 * dense[0]
        )  # the promised accuracy
        residual = np.linalg.norm(
            H @ pairs.vectors[d].T - pairs.vectors[d].T * pairs.values[d], axis=0
        )
        # 1e-9 is what was asked for; 1e-13: rounding of products with a matrix of norm dense[0]
        assert residual.max() <= 1e-9 * found[-1] + 1e-13 * dense[0]


@pytest.mark.parametrize("place", [3, 40, 77])
def test_a_pulse_on_a_smooth_response_does_not_hide_its_copies(place):
    k = np.arange(2 * 150)
    h = windows(0.99**k * np.cos(0.1 * k) + (k == 2 * place), 150, 1)
    expected = np.linalg.svd(hankel_matrix(h[0], 150, 150), compute_uv=False)[:6]
    found = np.abs(leading_eigenpairs(h, 150, 6).values[0])
    assert_allclose(found, expected, rtol=0, atol=1e-10 * expected[0])


@pytest.mark.parametrize(("p", "m"), [(2, 2), (3, 1), (2, 4)])
@pytest.mark.parametrize("noise", [0.0, 1e-2, 1.0])
def test_block_triplets_are_the_dense_ones(p, m, noise):
    rng = np.random.default_rng(p + m)
    A, B, C, _ = modal(rng, 6, p, m)
    h = np.stack([C @ np.linalg.matrix_power(A, k) @ B for k in range(639)], axis=-1)
    h = h + noise * rng.standard_normal(h.shape)
    H = hankel_matrix(h, 320, 320)
    expected = np.linalg.svd(H, compute_uv=False)
    found = leading_triplets(h, 320, 320, 6)
    assert not found.complete  # the matrix-free route
    assert_allclose(found.values, expected[:6], rtol=0, atol=1e-12 * expected[0])
    assert_allclose(H @ found.V, found.U * found.values, atol=1e-10 * expected[0])
    assert_allclose(H.T @ found.U, found.V * found.values, atol=1e-10 * expected[0])


@pytest.mark.parametrize("rank", [1, 3])
def test_equal_channels_of_low_rank_are_not_taken_for_one(rank):
    A, B, C, _ = modal(np.random.default_rng(rank), rank)
    one = np.array([(C @ np.linalg.matrix_power(A, k) @ B)[0, 0] for k in range(639)])
    h = np.kron(np.eye(3)[:, :, np.newaxis], one)
    expected = np.linalg.svd(hankel_matrix(h, 320, 320), compute_uv=False)
    found = leading_triplets(h, 320, 320, 3 * rank + 1)
    assert not found.complete
    assert_allclose(found.values[:-1], expected[: 3 * rank], rtol=0, atol=1e-12 * expected[0])
    assert found.values[-1] == 0


@pytest.mark.parametrize("size", [40, 100, 300])
def test_beyond_the_numerical_rank_there_are_zeros(size):
    for rank in (0, 1, 5):
        A, B, C, _ = modal(np.random.default_rng(rank), max(rank, 1))
        pulse = np.array([(C @ np.linalg.matrix_power(A, k) @ B)[0, 0] for k in range(2 * size)])
        pairs = leading_eigenpairs(windows(pulse * (rank > 0), size, 1), size, 8)
        assert np.count_nonzero(pairs.values[0]) == rank
        assert np.count_nonzero(np.abs(pairs.vectors[0]).max(axis=1)) == rank


@pytest.mark.parametrize("size", [50, 200, 2000])  # dense, dense fallback, ARPACK
def test_a_pulse_has_one_and_minus_one_many_times(size):
    pulse = np.zeros(2 * size)
    pulse[20] = 1.0
    pairs = leading_eigenpairs(windows(pulse, size, 1), size, 8)
    # one start vector sees each value once; the rest must not be taken for zero
    assert_allclose(np.abs(pairs.values[0]), np.ones(8), rtol=1e-13)


# So many values of noise do not converge in the steps of one run: the dense fallback, ARPACK.
@pytest.mark.slow
@pytest.mark.parametrize(("size", "count"), [(800, 199), (1600, 150)])
def test_noise_that_needs_too_many_steps_is_solved_another_way(size, count):
    noise = np.random.default_rng(5).standard_normal(2 * size - 1)
    H = hankel_matrix(noise, size, size)
    expected = np.sort(np.abs(np.linalg.eigvalsh(H)))[::-1]
    pairs = leading_eigenpairs(noise[np.newaxis], size, count)
    assert_allclose(np.abs(pairs.values[0]), expected[:count], rtol=0, atol=1e-9 * expected[0])
    assert_allclose(H @ pairs.vectors[0].T, pairs.vectors[0].T * pairs.values[0], atol=1e-7)
    assert pairs.following[0] == pytest.approx(expected[count], rel=0.1)
    found = leading_triplets(noise[np.newaxis, np.newaxis], size, size, count)
    assert_allclose(found.values, expected[:count], rtol=0, atol=1e-11 * expected[0])
    # to the rounding of a product with a matrix of this size
    assert_allclose(H @ found.V, found.U * found.values, rtol=0, atol=1e-10 * expected[0])


def test_norm_to_three_digits():
    noise = np.random.default_rng(5).standard_normal((3, 399))
    expected = [np.linalg.norm(hankel_matrix(row, 200, 200), 2) for row in noise]
    assert_allclose(largest_magnitude(noise, 200), expected, rtol=1e-3)


class Stubborn(np.ndarray):
    """A matrix on which NumPy's divide and conquer does not end, as one in 30 000 does not."""

    def __array_function__(self, function, types, args, keywords):
        if function is np.linalg.svd:
            raise np.linalg.LinAlgError("SVD did not converge")
        return super().__array_function__(function, types, args, keywords)


@pytest.mark.parametrize("shape", [(5, 5), (7, 3), (3, 7)])
@pytest.mark.parametrize("kind", [np.ndarray, Stubborn])
def test_the_factors_make_the_matrix(shape, kind):
    matrix = np.random.default_rng(1).standard_normal(shape)
    U, values, Vt = thin_svd(matrix.view(kind))
    assert (np.diff(values) <= 0).all()
    assert_allclose(U @ (values[:, None] * Vt), matrix, atol=1e-13 * values[0])
    assert_allclose(U.T @ U, np.eye(values.size), atol=1e-13)
    assert_allclose(Vt @ Vt.T, np.eye(values.size), atol=1e-13)


@pytest.mark.parametrize("count", [6, 7, 8])
def test_vectors_of_steeply_decreasing_pairs_are_orthonormal(count):
    # a step leaves about a hundredth of its product, which multiplies a loss by a hundred
    poles = np.exp(-1 / np.geomspace(3, 30, count))
    pulse = lfilter([1.0], np.poly(poles), np.r_[1.0, np.zeros(660)])
    pairs = leading_eigenpairs(windows(pulse, 300, 50), 300, count)
    for vectors in pairs.vectors:
        size = np.linalg.norm(vectors, axis=1) > 0  # those beyond the numerical rank are 0
        # 3e-15 is found; the rounding of 300 entries is some 1e-14 at most
        assert_allclose(vectors[size] @ vectors[size].T, np.eye(size.sum()), atol=1e-13)
