"""Noise, criterion and prediction of fits to one stretch, with searches that are by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_realize.numerics import fit_window as module
from ctrl_realize.numerics.delayed_modes import MoveTrain
from ctrl_realize.numerics.fit_window import (
    Window,
    WindowFit,
    _clipped,
    _ringing,
    _wild,
    extended,
    fit_window,
)
from ctrl_realize.numerics.own_terms import Stretches
from ctrl_realize.numerics.response_bins import Bins, response_bins
from ctrl_realize.numerics.separable_fit import KnownFactor, Problem, Structure, evaluate, respond
from ctrl_realize.numerics.structure_search import Candidate, Scales, needless_charge

ONE, TWO, ZERO = Structure(1, 1), Structure(2, 2), Structure(2, 1)
SIZE, EDGE, DT = 120, 20, 0.5
TRUTH = np.array([3.7, np.log(0.2)])  # delay and rate, in s and 1/s
SCALES = Scales(3.0, 5.0, 50.0, DT, 8.0)


def drive(first, width):
    return MoveTrain(DT * first, width, DT, np.array([EDGE * DT]), np.ones(1))


def windows():
    """One lag behind a delay on a level of 3: on bins, and sample by sample."""
    index, single = np.arange(SIZE), np.ones(SIZE, dtype=np.int64)
    every = drive(index.astype(float), single)
    output = 3.0 + respond(every, KnownFactor(), np.array([0.4]), TRUTH)
    bins = response_bins(SIZE, [EDGE], 8)
    assert bins.width.max() > 1
    level = np.ones((SIZE, 1))
    means = Problem(
        bins.average(output),
        np.sqrt(bins.width),
        drive(bins.first.astype(float), bins.width),
        np.ones((bins.first.size, 1)),
        KnownFactor(),
    )
    samples = Problem(output, np.ones(SIZE), every, level, KnownFactor())
    return (
        Window(EDGE, output, means, every, level, bins),
        Window(EDGE, output, samples, every, level, None),
    )


@pytest.mark.parametrize("window", windows(), ids=["bins", "samples"])
def test_a_model_is_predicted_at_every_sample(window):
    exact = window.predict(window.problem, Candidate(ONE, TRUTH, 0.0))
    assert exact == pytest.approx(window.output, abs=1e-12)
    # of other parameters gain and level are those of the problem's data
    other = window.predict(window.problem, Candidate(ONE, np.array([4.7, np.log(0.27)]), 0.0))
    assert 1e-3 < np.abs(other - window.output).max() < 0.5
    half = window.with_output(0.5 * window.output)
    assert window.predict(half, Candidate(ONE, TRUTH, 0.0)) == pytest.approx(0.5 * window.output)


def test_on_bins_and_on_samples_the_same_model_is_predicted():
    # noise is fitted alike, but for what the weights make of it
    noise = 0.01 * np.random.default_rng(0).standard_normal(SIZE)
    found = []
    for window in windows():
        noisy = window.with_output(window.output + noise)
        found.append(window.predict(noisy, Candidate(ONE, TRUTH, 0.0)))
    # three standard errors of two coefficients from a hundred samples
    assert found[0] == pytest.approx(found[1], abs=0.005)


def test_other_values_are_averaged_where_there_are_bins():
    means, samples = windows()
    values = np.random.default_rng(0).standard_normal(SIZE)
    assert np.array_equal(means.with_output(values).data, means.bins.average(values))
    assert np.array_equal(samples.with_output(values).data, values)
    assert means.with_output(values).root_weight is means.problem.root_weight


def test_a_free_response_is_predicted_at_every_sample():
    means, _ = windows()
    clock = DT * np.arange(SIZE)
    free = 2.0 * np.exp(-0.2 * clock)
    # in the middle of bins, of which those with one sample alone count here
    middle = means.bins.average(clock)
    single = 1.0 * (means.bins.width == 1)
    none = np.ones((means.bins.first.size, 0))
    level = np.ones((SIZE, 1))
    own = Stretches(np.array([0, SIZE]), clock, level)
    problem = replace(
        means.problem,
        data=means.bins.average(means.output + free),
        root_weight=single,
        regressors=none,
        stretches=Stretches(np.array([0, middle.size]), middle, means.bins.average(level)),
    )
    window = replace(means, problem=problem, columns=np.ones((SIZE, 0)), own=own)
    found = window.predict(problem, Candidate(ONE, TRUTH, 0.0))
    assert found == pytest.approx(means.output + free, abs=1e-10)


# --- what the best of the candidates leaves


class ByHand:
    """A window whose model is `rough` for one lag, and `better` of the output for others."""

    def __init__(self, output, start=0, columns=1, better=0.0, rough=0.0):
        self.output, self.start, self.better, self.rough = output, start, better, rough
        self.columns = np.ones((output.size, columns))
        self.problem = HandProblem(output)

    def predict(self, problem, candidate):
        assert isinstance(problem, HandProblem)
        return (
            self.better * self.output
            if candidate.structure != ONE
            else 0 * self.output + self.rough
        )

    def with_output(self, values):
        return HandProblem(values)


class HandProblem:
    def __init__(self, data, own=0):
        self.data, self.own = data, own

    def own_count(self, order):
        return self.own * order


@pytest.fixture
def searched(monkeypatch):
    """Costs are given by hand; searches and refinements are recorded."""
    seen = SimpleNamespace(searches=[], refined=[], costs={ONE: 500.0, TWO: 100.0})

    def search(problem, structures, scales, beside=None):
        seen.searches.append((problem, list(structures), scales, beside))
        found = {s: Candidate(s, np.zeros(1), seen.costs[s]) for s in structures}
        return (beside or {}) | found

    def refine(problem, candidates, scales):
        seen.refined.append((problem, scales))
        return candidates

    monkeypatch.setattr(module, "search", search)
    monkeypatch.setattr(module, "refine", refine)
    return seen


def noise(size=1000, seed=0):
    return np.random.default_rng(seed).standard_normal(size)


def fitted(window, noise=(1.0, 0.0), huber=False, structures=(ONE, TWO)):
    return fit_window(window, structures, SCALES, noise, huber)


def test_a_first_order_fit_comes_first_and_tells_the_ringing(searched):
    wave = np.sin(2 * np.pi * np.arange(1000) / 25)
    slow = np.sin(2 * np.pi * np.arange(1200) / 300)
    output = np.concatenate([9 * noise(200), wave]) + 5 * slow
    window = ByHand(output, start=200, rough=5 * slow)
    found = fitted(window)
    (rough, first, scales, _), (problem, second, informed, _) = searched.searches
    assert rough is problem is window.problem
    assert (first, second) == ([ONE], [ONE, TWO])
    assert scales.ringing == 0.0
    assert informed == replace(SCALES, ringing=pytest.approx(2 * np.pi / 25 / DT))
    assert found.scales is informed
    assert searched.refined == []


def test_the_level_is_what_is_left_after_the_start(searched):
    window = ByHand(np.concatenate([np.full(50, 99.0), 2 * noise(200)]), start=50, columns=3)
    found = fitted(window)
    # gain, delay and two lags are one and the order; columns as many as there are
    lost = 1 + 2 + 3
    squares = np.sum(window.output[50:] ** 2)
    assert found.sigma == pytest.approx(np.sqrt(squares / (200 - lost)), rel=1e-12)
    assert found.correlation == 1.0
    assert found.misfit == pytest.approx(np.sqrt(100.0 / (250 - lost)), rel=1e-12)
    assert found.rounding == 0.0
    assert found.colour is None
    assert (found.window, found.problem) == (window, window.problem)
    # a zero more
    searched.costs = {ONE: 500.0, ZERO: 100.0}
    found = fitted(window, structures=(ONE, ZERO))
    assert found.sigma == pytest.approx(np.sqrt(squares / (200 - lost - 1)), rel=1e-12)
    # noise given is the unit of the misfit
    louder = fitted(window, (2.0, 0.0), structures=(ONE, ZERO))
    assert louder.misfit == pytest.approx(0.5 * found.misfit, rel=1e-12)


def test_own_terms_are_counted(searched):
    window = ByHand(2 * noise(200))
    window.problem.own = 7
    found = fitted(window)
    assert found.sigma == pytest.approx(
        np.sqrt(np.sum(window.output**2) / (200 - 1 - 2 - 1 - 14)), rel=1e-12
    )
    charge = np.log(200)
    variance = found.sigma**2
    assert found.criterion == {
        ONE: pytest.approx(500 / variance + 3 * charge + 7),
        TWO: pytest.approx(100 / variance + 4 * charge + 14),
    }
    assert found.criteria(found.candidates) == pytest.approx(found.criterion)


def test_where_hardly_a_sample_is_free_one_is_counted(searched):
    found = fitted(ByHand(noise(4), columns=3))
    assert found.sigma == pytest.approx(np.sqrt(np.sum(noise(4) ** 2)))
    assert found.misfit == pytest.approx(10.0)


def test_far_below_the_noise_the_residual_is_rounding(searched):
    slow = np.repeat(noise(100), 10)
    found = fitted(ByHand(slow))
    assert found.correlation > 5
    # the level of the residual is known to 7 %
    near = fitted(ByHand(slow), (3.0, 0.0))
    assert (near.sigma, near.correlation) == (found.sigma, found.correlation)
    far = fitted(ByHand(slow), (3.6, 0.0))
    assert (far.sigma, far.correlation) == (pytest.approx(0.3 * 3.6), 1.0)


def test_the_criterion_counts_independent_samples(searched):
    window = ByHand(np.concatenate([noise(300), np.repeat(noise(100), 10)]), start=300)
    found = fitted(window)
    assert found.correlation > 5
    samples = 1000 / found.correlation
    assert found.independent == pytest.approx(samples)
    assert found.penalty == pytest.approx(np.log(samples))
    variance = found.sigma**2 * found.correlation
    assert found.variance == pytest.approx(variance)
    assert found.criterion[ONE] == pytest.approx(500 / variance + 3 * np.log(samples))
    assert found.criteria(found.candidates) == pytest.approx(found.criterion)


def test_the_structure_of_the_lowest_criterion_is_the_best(searched):
    found = fitted(ByHand(noise(200)))
    assert found.best is found.candidates[TWO]
    searched.costs[TWO] = 500.0
    assert fitted(ByHand(noise(200))).best.structure == ONE
    # a zero has to be worth what it is charged beyond a parameter
    charge = 2 * np.log(200) + needless_charge(ZERO)
    for cost, best in ((charge + 1, ZERO), (charge - 1, ONE)):
        searched.costs = {ONE: 99.0 + cost * fitted_variance(), ZERO: 99.0}
        assert fitted(ByHand(noise(200)), structures=(ONE, ZERO)).best.structure == best


def fitted_variance():
    # one gain, delay and order, a zero, a column
    return np.sum(noise(200) ** 2) / (200 - 5)


def test_coarse_rounding_counts_twice(searched):
    window = ByHand(noise(200))
    fine = fitted(window, (1.0, 1.6))
    assert fine.rounding == 0.0
    coarse = fitted(window, (1.0, 1.7))
    assert coarse.rounding == pytest.approx(1.7 / np.sqrt(12))
    assert coarse.variance == pytest.approx(fine.variance + 1.7**2 / 12)


def test_noise_that_was_made_white_counts_by_its_colour(searched):
    found = replace(fitted(ByHand(noise(200))), rounding=2.0, correlation=9.0)
    assert found.variance == pytest.approx(9 * (found.sigma**2 + 4.0))
    white = replace(found, colour=1.5)
    assert white.variance == pytest.approx(1.5 * (found.sigma**2 + 4.0))
    # colour or not, the same samples are independent
    assert white.independent == found.independent == pytest.approx(200 / 9)


def test_the_loss_of_huber_takes_a_pass_and_a_second_one_where_samples_are_wild(searched):
    window = ByHand(noise(1000))
    found = fitted(window, huber=True)
    assert len(searched.refined) == 1
    pseudo, scales = searched.refined[0]
    # data are moved towards the model, which is zero
    assert np.array_equal(pseudo.data, _clipped(window.output, 0.1))
    assert scales.ringing > 0
    assert found.problem is pseudo
    wild = noise(1000)
    wild[::200] += 50.0
    window = ByHand(wild, better=0.25)
    found = fitted(window, huber=True)
    assert len(searched.refined) == 3
    # the second one starts from the data, not from what the first made of them
    last = searched.refined[-1][0]
    error = 0.75 * wild
    np.testing.assert_allclose(last.data, 0.25 * wild + _clipped(error, 0.1), rtol=1e-12)
    assert found.problem is last
    # outliers do not count in the level
    assert found.sigma == pytest.approx(np.sqrt(np.sum(_clipped(error, 0.1) ** 2) / 996))
    assert found.sigma < 0.9


def test_residuals_are_clipped_at_a_share_of_noise_and_step(searched):
    still = np.zeros(1000)
    still[::10] = 5.0
    for noise_level, quantum, least in ((1.0, 0.0, 0.1), (1.0, 4.0, 2.0), (30.0, 4.0, 3.0)):
        searched.refined.clear()
        fitted(ByHand(still), (noise_level, quantum), huber=True)
        data = searched.refined[0][0].data
        assert np.array_equal(data, _clipped(still, least))


def test_without_huber_outliers_stay(searched):
    wild = noise(1000)
    wild[::200] += 50.0
    found = fitted(ByHand(wild))
    assert searched.refined == []
    assert found.sigma == pytest.approx(np.sqrt(np.sum(wild**2) / 996))


def test_structures_are_added_to_a_fit(searched):
    found = fitted(ByHand(noise(200)))
    searched.costs[ZERO] = 50.0
    more = extended(found, [ZERO])
    problem, structures, scales, beside = searched.searches[-1]
    assert (problem, structures, scales) == (found.problem, [ZERO], found.scales)
    assert beside is found.candidates
    assert set(more.candidates) == {ONE, TWO, ZERO}
    assert more.criterion == found.criteria(more.candidates)
    assert more.sigma == found.sigma


def test_a_model_with_a_given_delay_is_the_best_one_with_it():
    window, _ = windows()
    kept = Candidate(ONE, TRUTH, 0.0)
    fit = WindowFit(window, window.problem, {ONE: kept}, {ONE: 0.0}, SCALES, 1.0, 1.0, 1.0)
    moved = fit.at_delay(kept, 4.7)
    assert moved.structure == ONE
    assert moved.delay == 4.7
    assert TRUTH[0] == 3.7
    # less delay, less lag: a second later the response must be faster
    assert moved.poles[0].real < -0.2
    left = window.predict(window.problem, moved) - window.output
    assert moved.cost == pytest.approx(
        np.sum(window.bins.width * window.bins.average(left) ** 2), rel=1e-9
    )
    rates = -moved.poles[0].real * np.array([0.99, 1.0, 1.01])
    starts = np.stack([np.full(3, 4.7), np.log(rates)], axis=1)
    slower, best, faster = evaluate(window.problem, ONE, starts).cost
    assert best < min(slower, faster)


# --- residuals


def test_residuals_are_clipped_and_scaled_up_by_what_was_not():
    error = np.array([-2.0, -1.0, 0.0, 1.0, 30.0, -1.0, 1.0, 0.0])
    # the median deviation is 1: three quarters of 1.4826 x 1.345 = 1.994 and less
    limit = 1.345 * 1.4826
    expected = np.clip(error, -limit, limit) / (6 / 8)
    assert _clipped(error, 0.1) == pytest.approx(expected)
    # the least limit
    assert _clipped(error, 20.0) == pytest.approx(np.clip(error, None, 26.9) / (7 / 8))
    # at most by a factor of two
    most = np.array([0.0, 0.0, 0.0, 5.0, 5.0, 5.0, 5.0, 9.0, -9.0, 7.0])
    assert _clipped(most - 5.0, 1e-9).max() <= 2 * 1.345 * 1.4826 * 4.5


def test_clipping_leaves_noise_its_variance():
    # E psi^2 / (P inside)^2 of Gaussian noise: 0.71 / 0.82^2 is 1.05
    error = noise(100_000)
    assert np.var(_clipped(error, 0.0)) == pytest.approx(1.05, abs=0.02)


def test_residuals_are_wild_where_two_in_a_thousand_are_beyond_four_deviations():
    error = noise(2000)
    assert not _wild(error)
    assert np.abs(error).max() < 4 * 1.4826 * np.median(np.abs(error - np.median(error)))
    error[:4] = 9.0
    assert not _wild(error)
    error[4] = -9.0
    assert _wild(error)
    mild = noise(2000)
    mild[:10] = 3.5
    assert not _wild(mild)
    mild[:10] = 4.5
    assert _wild(mild)


def test_the_ringing_is_the_highest_line_above_two_periods():
    time = 0.1 * np.arange(500)
    for periods in (2, 7, 40):
        wave = np.cos(2 * np.pi * periods * time / 50) + 1e3
        assert _ringing(wave, 0.1) == pytest.approx(2 * np.pi * periods / 50)
    # what is slower is none
    both = 9 * np.cos(2 * np.pi * time / 50) + np.cos(2 * np.pi * 5 * time / 50)
    assert _ringing(both, 0.1) == pytest.approx(2 * np.pi * 5 / 50)
    assert _ringing(both[:15], 0.1) == 0.0
    assert _ringing(both[:16], 0.1) > 0.0


def test_means_of_bins_are_those_of_a_window():
    bins = Bins(np.array([0, 2]), np.array([2, 2]))
    window = replace(windows()[0], bins=bins)
    assert window.with_output(np.array([1.0, 3.0, 5.0, 9.0])).data.tolist() == [2.0, 7.0]
