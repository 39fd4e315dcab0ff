"""Level, drift and initial state of every stretch of a record."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.engine.local_terms import LocalTerms, Segments
from ctrl_realize.numerics.engine.modal import poles_from_parameters

CLOCK = np.concatenate([np.arange(70.0), np.arange(110.0)])
EDGES = np.array([0, 70, 180])
SHAPES = np.stack([np.ones(180), CLOCK], axis=1)
STRETCHES = Segments(EDGES, CLOCK, SHAPES)
# real; a ringing pair; the same pair just on either side of critical damping; all of them
THETA = {
    "real": [-3.0],
    "ringing": [np.log(0.3), np.log(0.1)],
    "below critical": [np.log(0.1), -1e-9],
    "above critical": [np.log(0.1), 1e-9],
    "three": [-3.0, np.log(0.3), np.log(0.1)],
}


@pytest.mark.parametrize("theta", THETA.values(), ids=THETA.keys())
def test_what_a_record_has_for_itself_disappears(theta):
    poles, _ = poles_from_parameters(np.array([theta]))
    rng = np.random.default_rng(0)
    own = LocalTerms(STRETCHES, np.ones(180), poles)
    data = np.zeros(180)
    for rows in STRETCHES.rows:
        # every real free response: with conjugate amplitudes
        amplitudes = rng.normal(size=poles.shape[1]) + 1j * rng.normal(size=poles.shape[1])
        free = (np.exp(CLOCK[rows, None] * poles[0]) @ amplitudes).real
        data[rows] = free + rng.normal() + rng.normal() * CLOCK[rows]
    left = own.without(data[None, :, None])[0, :, 0]
    assert_allclose(left, 0.0, atol=1e-9 * np.abs(data).max())


# alone, beside the other of its pair, and before a pair
@pytest.mark.parametrize(
    ("lasting", "over"),
    [([], [-900.0]), ([-0.2], [-0.2, -900.0]), ([-0.2, -0.3], [-900.0, -0.2, -0.3])],
)
def test_a_free_response_that_is_over_before_the_first_row_takes_nothing_away(lasting, over):
    clock, weight = np.arange(60.0) + 0.5, np.linspace(1.0, 2.0, 60)
    rows = Segments(np.array([0, 60]), clock, np.ones((60, 1)))
    data = np.random.default_rng(0).normal(size=(1, 60, 1))
    without = [
        LocalTerms(rows, weight, np.array([poles], dtype=np.complex128)).without(data)
        for poles in (lasting, over)
    ]
    assert_allclose(without[1], without[0], atol=1e-12)


def test_terms_of_a_stretch_with_fewer_samples_than_terms_take_all_of_it():
    poles, turned = poles_from_parameters(np.array([THETA["three"]]))
    rows = np.r_[0:70, 70:73]  # five terms and three samples
    own = LocalTerms(Segments(np.array([0, 70, 73]), CLOCK[rows], SHAPES[rows]), np.ones(73), poles)
    data = np.random.default_rng(0).normal(size=(1, 73, 1))
    left = own.without(data)[0, :, 0]
    assert_allclose(left[70:], 0.0, atol=1e-12)  # rounding, of numbers of 1
    assert np.abs(left[:70]).max() > 1
    assert np.isfinite(own.moved(data[:, :, 0], turned)).all()


def test_nothing_else_disappears_and_records_do_not_mix():
    poles, _ = poles_from_parameters(np.array([THETA["three"]]))
    own = LocalTerms(STRETCHES, np.ones(180), poles)
    data = np.zeros(180)
    data[:70] = np.random.default_rng(0).normal(size=70)
    left = own.without(data[None, :, None])[0, :, 0]
    assert np.all(left[70:] == 0)
    # five own terms of the first stretch, three of them of the plant
    columns = np.concatenate([SHAPES[:70], np.exp(CLOCK[:70, None] * poles[0])], axis=1)
    expected = data[:70] - (columns @ np.linalg.lstsq(columns, data[:70] + 0j, rcond=None)[0]).real
    assert_allclose(left[:70], expected, rtol=0, atol=1e-10)
