"""The kernel of the output-error fit: responses, derivatives, optimum."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.separable.poles import parameters_from_poles, poles_from_parameters
from ctrl_realize.numerics.separable.responses import MoveTrain, SampledInput
from ctrl_realize.numerics.separable.structures import Scales, parameter_bounds, search
from ctrl_realize.numerics.separable.varpro import (
    KnownFactor,
    Problem,
    Structure,
    evaluate,
    fit_batch,
    respond,
)
from ctrl_realize.numerics.signals.bins import response_bins
from tests import rigs

ONES = np.ones(300, dtype=np.int64)
TRAIN = MoveTrain(np.arange(300.0), ONES, 1.0, np.array([0.0, 50.0]), np.array([1.0, 0.5]))
RANDOM = SampledInput(np.random.default_rng(0).normal(size=30).repeat(10), 1.0)
KNOWN = KnownFactor(np.array([-0.3 + 0j]), np.array([0.2, 0.3]))
THETA = {
    1: [np.log(0.03)],
    2: np.log([0.05, 0.7]),
    3: np.log([0.03, 0.05, 0.7]),
    4: np.log([0.05, 0.7, 0.1, 1.2]),
    5: np.log([0.03, 0.05, 0.7, 0.1, 1.2]),
}


@pytest.mark.parametrize("drive", [TRAIN, RANDOM], ids=["steps", "random input"])
@pytest.mark.parametrize(("n", "r"), [(1, 1), (2, 2), (2, 1), (3, 3), (3, 1), (4, 2), (5, 5)])
def test_at_the_optimum_the_jacobian_is_minus_the_derivative_of_the_residual(n, r, drive):
    # Kaufman's form leaves out a term that is proportional to the residual: it is exact where
    # the residual vanishes. Data: what the model itself makes of a random walk.
    x, structure = np.concatenate([[37.3], THETA[n]])[None], Structure(n, r)
    walk = np.random.default_rng(n).normal(size=300).cumsum()
    first = Problem(walk, np.ones(300), drive, np.ones((300, 1)), KNOWN)
    data = walk - evaluate(first, structure, x).residual[0]
    problem = Problem(data, np.ones(300), drive, np.ones((300, 1)), KNOWN)
    state = evaluate(problem, structure, x)
    assert np.abs(state.residual).max() < 1e-11 * np.abs(data).max()
    for q in range(n + 1):
        step = np.zeros_like(x)
        step[0, q] = 1e-5
        ahead = evaluate(problem, structure, x + step).residual
        behind = evaluate(problem, structure, x - step).residual
        derivative = (behind - ahead)[0] / 2e-5
        scale = np.abs(derivative).max()
        # central differences of step 1e-5: 1e-10 from curvature, 1e-7 from rounding
        assert_allclose(state.jacobian[0, :, q], derivative, rtol=0, atol=2e-6 * scale)


def test_the_response_is_the_closed_form_at_any_fraction_of_a_sample():
    poles = rigs.R3.poles().astype(complex)
    time = rigs.TS * np.arange(-50, 900)
    drive = MoveTrain(time, np.ones(950, dtype=np.int64), rigs.TS, np.zeros(1), np.ones(1))
    for delay in (0.0, 36.25, 37.0, 41.9):
        x = np.concatenate([[delay * rigs.TS], parameters_from_poles(poles)])
        ours = respond(drive, KnownFactor(), np.array([np.prod(-poles).real]), x)
        assert_allclose(ours, rigs.exact_step(rigs.R3, time - delay * rigs.TS), atol=1e-12)


def test_means_over_bins_are_means_of_samples_also_where_moves_arrive():
    moves, sizes = np.array([5.0, 6.0, 7.0, 100.0, 103.0]), np.array([0.3, 0.4, 0.3, -0.5, 1.0])
    width = np.array([1] * 40 + [3, 5, 7, 4, 1, 2, 20, 60, 158])
    first = np.concatenate([[0], np.cumsum(width)[:-1]])
    poles, _ = poles_from_parameters(np.log([[0.03, 0.1, 0.2], [1e-7, 0.3, 0.02]]))
    tau = np.array([7.3, 41.9])
    bins = MoveTrain(first.astype(float), width, 1.0, moves, sizes).modes(tau, poles)
    samples = MoveTrain(np.arange(300.0), ONES, 1.0, moves, sizes).modes(tau, poles)
    for mean, values in zip(bins, samples, strict=True):
        expected = np.add.reduceat(values, first, axis=1)
        expected = expected / width.reshape(1, -1, *[1] * (values.ndim - 2))
        # the slowest pole is at 1e-7: one minus its exponential keeps nine digits
        assert_allclose(mean, expected, rtol=1e-8, atol=1e-10)


def test_a_few_moves_and_the_sampled_input_that_they_make_give_the_same_modes():
    signal = np.zeros(300)
    signal[5:], signal[100:] = 1.0, -0.5
    train = MoveTrain(np.arange(300.0), ONES, 1.0, np.array([5.0, 100.0]), np.array([1.0, -1.5]))
    poles, _ = poles_from_parameters(np.log([[0.03, 0.1, 0.2]]))
    for a, b in zip(
        train.modes(np.array([7.3]), poles),
        SampledInput(signal, 1.0).modes(np.array([7.3]), poles),
        strict=True,
    ):
        assert_allclose(a, b, atol=1e-11)


@given(
    st.lists(st.floats(-3, 2), min_size=1, max_size=5),
    st.lists(st.floats(-4, 1.5), min_size=2, max_size=2),
)
def test_pole_parameters_and_poles_go_back_and_forth(speeds, dampings):
    theta = np.array(speeds)
    theta[theta.size % 2 + 1 :: 2] = dampings[: theta.size // 2]
    poles, _ = poles_from_parameters(theta[None])
    again, _ = poles_from_parameters(parameters_from_poles(poles[0])[None])
    assert np.all(poles.real < 0)
    # coinciding poles are moved apart by up to one per cent, once more on the way back
    assert_allclose(np.prod(again), np.prod(poles), rtol=0.15 if theta.size > 2 else 0.02)


def test_bins_cover_every_sample_once_and_are_single_samples_at_the_onset():
    bins = response_bins(6440, [3840], 60)
    assert bins.first[0] == 0
    assert bins.first[-1] + bins.width[-1] == 6440
    assert np.array_equal(bins.first[1:], (bins.first + bins.width)[:-1])
    near = (bins.first >= 3880) & (bins.first < 3920)
    assert np.all(bins.width[near] == 1)
    assert bins.first.size < 300


@pytest.mark.parametrize("zeta", [0.05, 0.7, 1.3])
def test_exact_data_give_their_own_parameters_back(zeta):
    poles = (rigs.lag(2.2) * rigs.pair(8.0, zeta)).poles().astype(complex)
    time = rigs.TS * np.arange(-50, 900)
    drive = MoveTrain(time, np.ones(950, dtype=np.int64), rigs.TS, np.zeros(1), np.ones(1))
    truth = np.concatenate([[36.4 * rigs.TS], parameters_from_poles(poles)])
    data = 2.0 + respond(drive, KnownFactor(), np.array([np.prod(-poles).real]), truth)
    problem = Problem(data, np.ones(950), drive, np.ones((950, 1)), KnownFactor())
    scales = Scales(50 * rigs.TS, 80 * rigs.TS, 900 * rigs.TS, rigs.TS, 100 * rigs.TS)
    found = search(problem, [Structure(3, 3)], scales)[Structure(3, 3)]
    polished, _ = fit_batch(
        problem,
        Structure(3, 3),
        found.parameters[None],
        parameter_bounds(Structure(3, 3), scales),
        tolerance=1e-13,
    )
    assert_allclose(polished[0, 0], truth[0], rtol=1e-6)


def test_no_random_start_beats_the_few_that_are_tried():
    # The starts are ten; thirty random ones from the whole box must not find a lower cost.
    worse = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        time = rigs.TS * np.arange(-20, 480)
        delay = rng.uniform(30, 45)
        data = rigs.exact_step(rigs.R3, time - delay * rigs.TS)
        data = data + 0.003 * rng.standard_normal(time.size)
        drive = MoveTrain(time, np.ones(500, dtype=np.int64), rigs.TS, np.zeros(1), np.ones(1))
        problem = Problem(data, np.ones(500), drive, np.ones((500, 1)), KnownFactor())
        scales = Scales(52 * rigs.TS, 90 * rigs.TS, 480 * rigs.TS, rigs.TS, 75 * rigs.TS)
        found = search(problem, [Structure(3, 3)], scales)[Structure(3, 3)]
        box = parameter_bounds(Structure(3, 3), scales)
        starts = rng.uniform(box.low, box.high, size=(30, 4))
        _, cost = fit_batch(problem, Structure(3, 3), starts, box, most_iterations=60)
        worse += found.cost > cost.min() * (1 + 1e-4)
    assert worse == 0
