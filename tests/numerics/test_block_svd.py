"""What takes the place of the bidiagonalisation where it does not end."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics import block_svd
from ctrl_realize.numerics.block_svd import leading_triplets
from tests.oracles import dense

SIZE = 70


@pytest.mark.parametrize(("p", "m"), [(1, 1), (2, 1), (1, 2)])
@pytest.mark.parametrize("fallback", [10_000, 0])
def test_a_matrix_without_a_gap_is_decomposed_another_way(monkeypatch, p, m, fallback):
    # white noise: singular values close to each other, for which four steps are too few
    monkeypatch.setattr(block_svd, "MAX_STEPS", 4)
    monkeypatch.setattr(block_svd, "DENSE_SIZE", 10)
    monkeypatch.setattr(block_svd, "DENSE_FALLBACK_SIZE", fallback)
    h = 1e9 * np.random.default_rng(0).standard_normal((p, m, 2 * SIZE - 1))
    H = dense.hankel(h, SIZE, SIZE)
    expected = np.linalg.svd(H, compute_uv=False)
    found = leading_triplets(h, SIZE, SIZE, 5)
    assert_allclose(found.values, expected[:5], rtol=1e-12)
    # to the rounding of a product with a matrix of this size
    assert_allclose(H @ found.V, found.U * found.values, rtol=0, atol=1e-12 * expected[0])
    assert_allclose(H.T @ found.U, found.V * found.values, rtol=0, atol=1e-12 * expected[0])
    assert found.complete == (fallback > 0)
    assert found.others.size == (expected.size - 5 if fallback else 0)
