"""Hankel matrices: dense, by FFT, and their norm."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.hankel.matrix import (
    BlockHankel,
    HankelStack,
    fft_length,
    hankel_matrix,
    hankel_norm_squared,
)
from tests.oracles import dense


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.mark.parametrize(("p", "m"), [(1, 1), (2, 3), (3, 1)])
@pytest.mark.parametrize(
    ("rows", "columns", "length"), [(4, 4, 7), (5, 3, 7), (4, 6, 5), (1, 1, 1)]
)
def test_block_hankel_has_the_entries_of_its_definition(rng, p, m, rows, columns, length):
    h = rng.standard_normal((p, m, length))
    assert np.array_equal(hankel_matrix(h, rows, columns), dense.hankel(h, rows, columns))


@pytest.mark.parametrize("size", [1, 2, 17, 500])
@pytest.mark.parametrize("missing", [0, 3])
def test_fft_product_is_the_dense_product(rng, size, missing):
    h = rng.standard_normal((4, max(1, 2 * size - 1 - missing)))
    v = rng.standard_normal((4, size))
    expected = [hankel_matrix(row, size, size) @ x for row, x in zip(h, v, strict=True)]
    # 500 terms of order one, each rounded at 1e-16
    assert_allclose(HankelStack(h, size)(v), expected, rtol=0, atol=1e-12)


def test_members_that_are_taken_keep_their_matrix(rng):
    h, v = rng.standard_normal((5, 39)), rng.standard_normal((2, 20))
    all_members = HankelStack(h, 20)
    taken = all_members.take(np.array([1, 4]))(v)
    expected = [hankel_matrix(h[i], 20, 20) @ x for i, x in zip((1, 4), v, strict=True)]
    assert_allclose(taken, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("p", "m"), [(1, 1), (3, 2), (2, 5)])
@pytest.mark.parametrize(
    ("rows", "columns", "length"), [(30, 30, 59), (20, 41, 60), (30, 30, 40), (13, 13, 25)]
)
def test_block_products_are_the_dense_products(rng, p, m, rows, columns, length):
    # 25 samples are transformed with 25 points, an odd number
    h = rng.standard_normal((p, m, length))
    H, fast = hankel_matrix(h, rows, columns), BlockHankel(h, rows, columns)
    x, y = rng.standard_normal(H.shape[1]), rng.standard_normal(H.shape[0])
    assert fast.shape == H.shape
    assert_allclose(fast.times(x), H @ x, rtol=0, atol=1e-12)  # 200 terms of order one
    assert_allclose(fast.transposed_times(y), H.T @ y, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "rows", "columns"), [((9,), 5, 5), ((2, 3, 9), 4, 7), ((4,), 9, 9)]
)
def test_norm_without_the_matrix_is_the_norm_of_the_matrix(rng, shape, rows, columns):
    h = rng.standard_normal(shape)
    expected = np.sum(hankel_matrix(h, rows, columns) ** 2)
    assert hankel_norm_squared(h, rows, columns) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(
    ("n", "length"), [(1, 1), (999, 1024), (1000, 1024), (1025, 1080), (513, 540)]
)
def test_fft_length_prefers_a_power_of_two_that_is_near(n, length):
    assert fft_length(n) == length
