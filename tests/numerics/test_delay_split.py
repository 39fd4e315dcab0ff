from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.delay_split import joined_columns, joined_rows, split_delays
from ctrl_realize.numerics.state_space.responses import markov

delays_of = st.lists(st.integers(0, 30), min_size=1, max_size=4)


@given(delays_of, delays_of)
def test_delays_of_outputs_and_inputs_are_found_from_their_sums(outputs, inputs):
    total = np.add.outer(outputs, inputs)
    ways = split_delays(total, np.ones(total.shape, dtype=bool))
    assert len(ways) == 1
    behind, before = ways[0]
    assert np.array_equal(np.add.outer(behind, before), total)
    # What all share may move between the sides; it lies where it takes fewer samples.
    common = min(outputs) + min(inputs)
    least = sum(outputs) - len(outputs) * min(outputs) + sum(inputs) - len(inputs) * min(inputs)
    assert behind.sum() + before.sum() == least + common * min(len(outputs), len(inputs))


def test_what_no_split_explains_is_shared_out_inputs_first_and_outputs_first():
    # the third input has no response
    delays = np.array([[3, 20, -1], [5, 20, -1]])
    _, first, second = split_delays(delays, delays >= 0)
    assert [share.tolist() for share in first] == [[0, 0], [3, 20, 0]]
    # outputs of 3 and 5 samples leave 0 and 15 to the inputs; two outputs, three inputs: what
    # is common lies at the outputs
    assert [share.tolist() for share in second] == [[3, 5], [0, 15, 0]]


@pytest.fixture
def parts():
    rng = np.random.default_rng(0)
    return [
        (0.5 * np.diag(rng.random(n)), rng.normal(size=(n, 2)), rng.normal(size=(1, n)),
         rng.normal(size=(1, 2)))
        for n in (2, 1, 3)
    ]  # fmt: skip


def test_rows_behind_tapped_lines_have_the_delay_of_each_entry(parts):
    taps = np.array([[0, 3], [2, 0], [5, 1]])
    A, B, C, D = joined_rows(parts, taps)
    assert A.shape[0] == 6 + 5 + 3
    whole = markov(A, B, C, D, 30)
    for i, part in enumerate(parts):
        single = markov(*part, 30)[0]
        for j in range(2):
            late = np.concatenate([np.zeros(taps[i, j]), single[j]])[:30]
            assert_allclose(whole[i, j], late, rtol=0, atol=1e-14)


def test_columns_in_front_of_tapped_lines_have_the_delay_of_each_entry(parts):
    turned = [(A.T, C.T, B.T, D.T) for A, B, C, D in parts]
    taps = np.array([[0, 2, 5], [3, 0, 1]])
    A, B, C, D = joined_columns(turned, taps)
    whole = markov(A, B, C, D, 30)
    for j, part in enumerate(turned):
        single = markov(*part, 30)[:, 0]
        for i in range(2):
            late = np.concatenate([np.zeros(taps[i, j]), single[i]])[:30]
            assert_allclose(whole[i, j], late, rtol=0, atol=1e-14)
    assert ct.ss(A, B, C, D, 1.0).nstates == 6 + 5 + 3
