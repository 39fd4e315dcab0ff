from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.responses import markov
from ctrl_realize.numerics.state_space.sections import in_sections, motion

SAMPLES = 60


def some_model(seed, order, p=2, m=3):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((order, order))
    A *= 0.95 / max(np.abs(np.linalg.eigvals(A)).max(initial=0.0), 0.5)
    B, C = rng.standard_normal((order, m)), rng.standard_normal((p, order))
    return A, B, C, rng.standard_normal((p, m))


models = st.builds(some_model, st.integers(0, 300), st.integers(1, 7))


@given(models)
def test_a_model_in_sections_is_the_same_model(model):
    sections = in_sections(*model)
    matrices = sections.matrices()
    assert matrices[0].shape == model[0].shape
    expected = markov(*model, SAMPLES)
    # eigenvectors of random matrices of order 7 lose up to six digits
    assert_allclose(
        markov(*matrices, SAMPLES), expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )
    poles = np.linalg.eigvals(model[0])
    distance = np.abs(sections.poles[:, None] - poles)
    assert distance.min(axis=0).max() < 1e-7
    assert sections.poles.size == poles.size


@given(models)
def test_the_motion_is_the_simulation(model):
    v = np.random.default_rng(1).standard_normal((3, SAMPLES))
    sections = in_sections(*model)
    ours = motion(sections, v).output(sections, v)
    theirs = ct.forced_response(ct.ss(*model, 1.0), inputs=v).outputs
    assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_slopes_are_differences_of_outputs(order):
    v = np.random.default_rng(1).standard_normal((3, SAMPLES))
    sections = in_sections(*some_model(3, order))
    mine = motion(sections, v)
    slopes = np.stack([mine.slopes(sections, v, a, slice(0, SAMPLES)) for a in range(2)])
    for k in np.flatnonzero(sections.free(feedthrough=True)):
        step = np.zeros(slopes.shape[1])
        step[k] = 1e-6
        ahead, behind = sections.moved(step), sections.moved(-step)
        change = motion(ahead, v).output(ahead, v) - motion(behind, v).output(behind, v)
        # a central difference of 1e-6 keeps seven digits or so
        assert_allclose(slopes[:, k], change / 2e-6, rtol=0, atol=1e-6 * np.abs(slopes).max())


@pytest.mark.parametrize("order", [1, 2, 3])
def test_starts_are_free_responses(order):
    model = some_model(5, order)
    sections = in_sections(*model)
    A, _, C, _ = sections.matrices()
    kept = np.arange(2 * sections.a.shape[0])
    if order % 2:
        kept = np.delete(kept, -2)
    found = motion(sections, np.zeros((3, 9))).starts(sections)[:, kept]
    expected = np.stack([C @ np.linalg.matrix_power(A, k) for k in range(9)], axis=-1)
    assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
