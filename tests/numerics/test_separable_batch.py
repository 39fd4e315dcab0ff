"""Elimination of linear terms and steps of a batch of starts, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.separable.local_terms import Stretches
from ctrl_realize.numerics.separable.responses import MoveTrain
from ctrl_realize.numerics.separable.varpro import (
    Bounds,
    KnownFactor,
    Problem,
    Structure,
    evaluate,
    fit_batch,
    partial_fractions,
    respond,
)

ONE, TWO, ZERO, JUMP = Structure(1, 1), Structure(2, 2), Structure(2, 1), Structure(1, 0)
SIZE, DT = 90, 0.5
TIME = DT * np.arange(SIZE)
NOTHING = KnownFactor()
LAG = 2.5
TRUTH = np.array([3.3, -np.log(LAG)])
BOX = Bounds(np.array([0.0, np.log(0.02)]), np.array([9.0, np.log(4.0)]))


def train(unit=1.0, at=2.0):
    ones = np.ones(SIZE, dtype=np.int64)
    return MoveTrain(unit * TIME, ones, unit * DT, np.array([unit * at]), np.ones(1))


def problem(data, **changed):
    given = {
        "root_weight": np.ones(SIZE),
        "drive": train(),
        "regressors": np.ones((SIZE, 1)),
        "known": NOTHING,
    } | changed
    return Problem(data, **given)


def lag(time, rate):
    return -np.expm1(-rate * np.clip(time, 0, None))


def noisy(gain=2.0, level=5.0, noise=0.02, seed=0):
    clean = level + gain * lag(TIME - 2.0 - TRUTH[0], 1 / LAG)
    return clean + noise * np.random.default_rng(seed).standard_normal(SIZE)


# --- responses


def test_known_dynamics_stand_in_cascade():
    # 1.2 / (s + 0.4) behind (6 + s) / (s + 3): by partial fractions, static gain 6
    known = KnownFactor(np.array([-3.0 + 0j]), np.array([1.0, 6.0]))
    found = respond(train(), known, np.array([1.2]), np.array([3.3, np.log(0.4)]))
    since = TIME - 5.3
    slow = 1.2 * 5.6 / (-0.4 * 2.6)
    fast = 1.2 * 3.0 / (-3.0 * -2.6)
    expected = 6.0 + slow * np.exp(-0.4 * since) + fast * np.exp(-3.0 * since)
    assert 6.0 + slow + fast == pytest.approx(0.0, abs=1e-12)
    assert found == pytest.approx(np.where(since > 0, expected, 0.0), abs=1e-12)


@pytest.mark.parametrize("known", [np.ones(1), np.array([0.2, 0.0, 0.3])])
def test_partial_fractions_add_up(known):
    poles = np.array([[-0.4 + 0j, -0.3 + 2j, -0.3 - 2j], [-1.0, -2.0, -7.0]])
    residues, gain, moved = partial_fractions(poles, known, 2 if known.size > 1 else 3)
    s = 0.7 + 0.3j
    for row, p in enumerate(poles):
        for i in range(residues.shape[2]):
            whole = s ** (i - 1) * np.polyval(known, s) / np.prod(s - p)
            parts = gain[row, i] / s + np.sum(residues[row, :, i] / (s - p))
            assert parts == pytest.approx(whole, rel=1e-12)
            # the derivative of its numerator, s^(i-1) K, at every pole; over a' there
            slope = np.array([np.prod(x - np.delete(p, j)) for j, x in enumerate(p)])
            ahead, behind = ((p + h) ** (i - 1.0) * np.polyval(known, p + h) for h in (1e-6, -1e-6))
            # central differences of a step of 1e-6
            expected = (ahead - behind) / 2e-6 / slope
            assert moved[row, :, i] == pytest.approx(expected, rel=1e-7, abs=1e-8)


# --- elimination


def test_the_residual_is_that_of_weighted_least_squares():
    data, weight = noisy(), np.linspace(0.5, 2.0, SIZE)
    trials = TRUTH + np.array([[0.0, 0.0], [0.7, 0.2], [-1.0, -0.5]])
    state = evaluate(problem(data, root_weight=weight), ONE, trials)
    for row, (delay, rate) in enumerate(trials):
        columns = np.stack([lag(TIME - 2.0 - delay, np.exp(rate)), np.ones(SIZE)], axis=1)
        best = np.linalg.lstsq(columns * weight[:, None], data * weight, rcond=None)[0]
        left = weight * (data - columns @ best)
        assert state.residual[row] == pytest.approx(left, abs=1e-12)
        assert state.cost[row] == pytest.approx(left @ left)
        # b over s + a has the static gain b / a
        assert state.numerator[row, 0] / np.exp(rate) == pytest.approx(best[0])
        assert state.regression[row, 0] == pytest.approx(best[1])


def test_a_whitener_stands_in_for_the_weights():
    data = noisy()
    white = np.tril(np.random.default_rng(0).standard_normal((SIZE, SIZE))) + 3 * np.eye(SIZE)
    columns = np.random.default_rng(1).standard_normal((2, SIZE, 3))
    made = problem(data, whitener=white)
    assert made.weighted(columns) == pytest.approx(np.stack([white @ one for one in columns]))
    assert made.weighted_data == pytest.approx(white @ data)
    diagonal = problem(data, whitener=np.diag(np.linspace(0.5, 2, SIZE)))
    weighted = problem(data, root_weight=np.linspace(0.5, 2, SIZE))
    both = [evaluate(one, ONE, TRUTH[None]).residual for one in (diagonal, weighted)]
    assert both[0] == pytest.approx(both[1], abs=1e-12)


@pytest.mark.parametrize("structure", [ONE, JUMP, TWO, ZERO])
def test_sensitivity_is_the_size_of_the_derivative_of_the_model(structure):
    pair = [-np.log(LAG), np.log(1.2)][: structure.order]
    x = np.concatenate([[3.37], pair])
    weight = np.linspace(0.5, 2.0, SIZE)
    made = problem(noisy(), root_weight=weight)
    state = evaluate(made, structure, x[None])
    b = state.numerator[0]
    for q in range(x.size):
        step = 1e-6 * (np.arange(x.size) == q)
        change = respond(train(), NOTHING, b, x + step) - respond(train(), NOTHING, b, x - step)
        size = np.linalg.norm(weight * change / 2e-6)
        # no sample lies where the response breaks off; central differences of 1e-6
        assert state.sensitivity[0, q] == pytest.approx(size, rel=1e-6)


def test_own_terms_are_taken_out_of_data_and_model():
    # a free response of the plant and a level of its own in each of two stretches
    free = np.concatenate([4.0 * np.exp(-TIME[:40] / LAG), 1.0 - 2 * np.exp(-TIME[:50] / LAG)])
    clock = np.concatenate([TIME[:40], TIME[:50]])
    pieces = Stretches(np.array([0, 40, SIZE]), clock, np.ones((SIZE, 1)))
    data = respond(train(), NOTHING, np.array([0.8]), TRUTH) + free
    none = np.empty((SIZE, 0))
    weight = np.linspace(0.5, 2.0, SIZE)
    made = problem(data, regressors=none, stretches=pieces, root_weight=weight)
    state = evaluate(made, ONE, TRUTH[None])
    assert state.cost[0] < 1e-20
    assert state.numerator[0] == pytest.approx([0.8])
    # the lag of the free response moves along with that of the model
    h = 1e-5
    for q in range(2):
        step = h * (np.arange(2) == q)
        ahead, behind = (evaluate(made, ONE, (TRUTH + d)[None]).residual[0] for d in (step, -step))
        expected = (behind - ahead) / (2 * h)
        # central differences of 1e-5: 1e-10 of curvature and 1e-7 of rounding
        assert np.abs(state.jacobian[0, :, q] - expected).max() < 2e-6 * np.abs(expected).max()


# --- steps


def fitted(data, start, bounds=BOX, **settings):
    x, cost = fit_batch(problem(data), ONE, np.atleast_2d(start), bounds, **settings)
    return x[0], cost[0]


def test_a_delay_that_is_fixed_is_kept_wherever_it_is():
    for delay in (1.0, 3.3, 11.0):
        x, _ = fitted(noisy(), [delay, 0.0], delay_fixed=True, tolerance=1e-12)
        assert x[0] == delay
        rates = np.clip(x[1] + 1e-2 * np.array([-1, 0, 1]), BOX.low[1], BOX.high[1])
        trials = np.stack([np.full(3, delay), rates], axis=1)
        slower, at, faster = evaluate(problem(noisy()), ONE, trials).cost
        assert at <= min(slower, faster)


def test_no_start_gets_worse_and_the_callers_are_kept():
    starts = np.array([[1.0, -1.0], [6.0, 1.0], [3.0, -3.5]])
    kept = starts.copy()
    first = evaluate(problem(noisy()), ONE, starts).cost
    last = first
    for turns in (1, 2, 5):
        x, cost = fit_batch(problem(noisy()), ONE, starts, BOX, most_iterations=turns)
        assert np.all(cost <= last)
        assert cost == pytest.approx(evaluate(problem(noisy()), ONE, x).cost)
        last = cost
    assert np.all(last < first)
    assert np.array_equal(starts, kept)


def test_steps_do_not_depend_on_the_unit_of_time():
    # no start lies between two samples in one unit and on a sample in another
    start = np.array([[5.1, 0.3], [1.1, -2.0]])
    data = noisy()
    for unit in (1e3, 1e-6):
        shift = np.array([0.0, np.log(unit)])
        scale = np.array([unit, 1.0])
        box = Bounds(BOX.low * scale - shift, BOX.high * scale - shift)
        ours, cost = fit_batch(problem(data), ONE, start, BOX, most_iterations=4)
        other = problem(data, drive=train(unit))
        theirs, same = fit_batch(other, ONE, start * scale - shift, box, most_iterations=4)
        # four steps, each a solution of equations of condition 1e3
        assert (theirs + shift) / scale == pytest.approx(ours, rel=1e-9)
        assert same == pytest.approx(cost, rel=1e-9)
