"""When structures are fitted again for the colour of the noise, with fits that are by hand."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_realize.numerics import coloured_fit, step_problem
from ctrl_realize.numerics.coloured_fit import (
    _delays_near,
    _fitted_again,
    _quiet,
    in_coloured_noise,
)
from ctrl_realize.numerics.separable_fit import Structure
from ctrl_realize.numerics.structure_search import Candidate

ONE, TWO, ZERO = Structure(1, 1), Structure(2, 2), Structure(2, 1)
EDGE, SIZE = 800, 2000


@dataclass(frozen=True, eq=False)
class Problem:
    data: np.ndarray
    stretches: object = None
    whitener: object = None


@dataclass(frozen=True, eq=False)
class Window:
    """A window whose model is zero: its output is the residual."""

    output: np.ndarray
    bins: object = "bins"
    columns: np.ndarray = field(default_factory=lambda: np.ones((SIZE, 1)))

    def predict(self, problem, candidate):
        return np.zeros(self.output.size)

    def with_output(self, output):
        return Problem(output)


@dataclass(frozen=True, eq=False)
class Whole:
    window: Window
    problem: Problem
    candidates: dict
    criterion: dict = field(default_factory=dict)
    correlation: float = 1.0
    sigma: float = 1.0
    colour: float | None = None
    scales: object = "scales"
    best: object = "best"

    def criteria(self, found):
        return {structure: model.cost + self.colour for structure, model in found.items()}


def noise(seed=0, memory=0.7, size=SIZE):
    white = np.random.default_rng(seed).standard_normal(size)
    out = np.zeros(size)
    for k in range(1, size):
        out[k] = memory * out[k - 1] + white[k]
    return out


def window(output=None, **changed):
    output = noise() if output is None else output
    old = {s: Candidate(s, np.array([1.0]), 7.0) for s in (ONE, TWO)}
    return Whole(Window(output, **changed), Problem(output), old)


@pytest.fixture
def by_hand(monkeypatch):
    """Covariances and fits are recorded; one lag leaves `cost`, two lags more."""
    seen = SimpleNamespace(cost=1990.0, covariance=np.array([1.0, 0.7]))

    def noise_covariance(quiet, longest):
        seen.quiet, seen.longest = quiet, longest
        return seen.covariance

    def fitted_again(whole, problem):
        seen.problem = problem
        costs = {ONE: seen.cost, TWO: seen.cost + 500}
        return {s: Candidate(s, np.array([2.0]), cost) for s, cost in costs.items()}

    monkeypatch.setattr(coloured_fit, "noise_covariance", noise_covariance)
    monkeypatch.setattr(coloured_fit, "whitener", lambda bins, covariance: (bins, covariance))
    monkeypatch.setattr(coloured_fit, "_fitted_again", fitted_again)
    monkeypatch.setattr(coloured_fit, "_quiet", lambda error, data: error[: data.edge])
    return seen


def data(**changed):
    return SimpleNamespace(edge=EDGE, coarse=False, **changed)


def test_noise_that_is_coloured_at_rest_is_made_white(by_hand):
    whole = window()
    found = in_coloured_noise(whole, data())
    assert found is not whole
    assert by_hand.problem.whitener == ("bins", by_hand.covariance)
    assert by_hand.longest == SIZE
    assert np.array_equal(by_hand.quiet, whole.window.output[:EDGE])
    assert found.problem is by_hand.problem
    assert {s: c.cost for s, c in found.candidates.items()} == {ONE: 1990.0, TWO: 2490.0}
    # what is left of 2000 less gain, delay, one lag and one column, over a variance of one
    assert found.colour == pytest.approx(1.0)
    assert found.criterion == {ONE: 1991.0, TWO: 2491.0}


def test_what_is_left_sets_the_level_of_the_criterion(by_hand):
    by_hand.cost = 2 * (SIZE - 3)  # one, its order, one column
    found = in_coloured_noise(window(), data())
    assert found.colour == pytest.approx(2.0, rel=1e-12)
    assert found.criterion[ONE] == pytest.approx(by_hand.cost + 2.0, rel=1e-12)
    quieter = Whole(**vars(window()) | {"sigma": 0.5})
    assert in_coloured_noise(quieter, data()).colour == pytest.approx(8.0, rel=1e-12)


def test_a_whitened_residual_far_above_the_noise_is_not_believed(by_hand):
    whole = window()
    by_hand.cost = 8.99 * (SIZE - 3)
    assert in_coloured_noise(whole, data()).colour == pytest.approx(8.99, rel=1e-12)
    by_hand.cost = 9.01 * (SIZE - 3)
    assert in_coloured_noise(whole, data()) is whole


def test_samples_that_are_wild_are_cut_at_five_deviations(by_hand):
    output = noise()
    output[[900, 1500]] = 1e3, -1e3
    in_coloured_noise(window(output), data())
    used = by_hand.problem.data
    limit = 5 * np.median(np.abs(output - np.median(output))) / 0.6745
    assert np.abs(used).max() == pytest.approx(limit, rel=1e-3)
    assert np.sign(used[[900, 1500]]).tolist() == [1.0, -1.0]
    tame = np.abs(output) < 0.99 * limit
    assert np.array_equal(used[tame], output[tame])
    # where most samples agree, those of the noise of the fit
    louder = Whole(**vars(window(output)) | {"sigma": 3.0})
    in_coloured_noise(louder, data())
    assert np.abs(by_hand.problem.data).max() == 15.0


def test_noise_without_a_coefficient_is_left_as_it_is(by_hand):
    by_hand.covariance = np.ones(1)
    whole = window()
    assert in_coloured_noise(whole, data()) is whole


def test_other_records_stay_as_they_are(by_hand):
    whole = window()
    assert in_coloured_noise(whole, SimpleNamespace(edge=EDGE, coarse=True)) is whole
    without_bins = window(bins=None)
    assert in_coloured_noise(without_bins, data()) is without_bins
    pieces = Whole(**vars(whole) | {"problem": Problem(whole.problem.data, stretches="some")})
    assert in_coloured_noise(pieces, data()) is pieces
    white = window(noise(memory=0.0))
    assert in_coloured_noise(white, data()) is white
    # 5.7 samples count as one; a residual of twelve of them is a misfit
    for correlation, same in ((10.0, False), (13.0, True)):
        other = Whole(**vars(whole) | {"correlation": correlation})
        assert (in_coloured_noise(other, data()) is other) == same


def test_a_rest_that_is_too_short_tells_no_colour(by_hand):
    whole = window()
    for edge, same in ((99, True), (100, False)):
        assert (in_coloured_noise(whole, SimpleNamespace(edge=edge, coarse=False)) is whole) == same
    # of slow noise a hundred samples are no eight that are independent
    slow = window(noise(memory=0.97))
    time = coloured_fit.correlation_time(slow.window.output[:110])
    assert time > 110 / 8
    assert in_coloured_noise(slow, SimpleNamespace(edge=110, coarse=False)) is slow


def test_quiet_is_the_rest_and_the_later_half_of_what_has_settled(monkeypatch):
    parts = []

    def stop_at(data, part):
        parts.append(part)
        return 150

    monkeypatch.setattr(step_problem, "stop_at", stop_at)
    error = np.arange(400.0)
    # settled twice the rise of 50 samples after the edge, at 200
    found = _quiet(error, SimpleNamespace(edge=100))
    assert found.tolist() == [*range(100), *range(300, 400)]
    assert parts == [0.95]
    monkeypatch.setattr(coloured_fit, "_ENOUGH", 30)
    found = _quiet(error, SimpleNamespace(edge=100))
    assert found.tolist() == [*range(70, 100), *range(300, 330)]


def test_fits_start_again_at_the_best_delays_around(monkeypatch):
    def evaluate(problem, structure, starts):
        assert (problem, structure) == ("problem", ONE)
        assert np.all(starts[:, 1] == 3.0)
        return SimpleNamespace(cost=np.abs(starts[:, 0] - 1.24))

    monkeypatch.setattr(coloured_fit, "evaluate", evaluate)
    scales = SimpleNamespace(dt=0.1, earliest=0.0, latest=9.0)
    old = Candidate(ONE, np.array([1.0, 3.0]), 5.0)
    starts = _delays_near("problem", old, scales)
    assert np.array(starts) == pytest.approx(np.array([[1.0, 3.0], [1.25, 3.0], [1.2, 3.0]]))
    # six samples to both sides, within the bounds
    far = SimpleNamespace(dt=0.01, earliest=0.0, latest=9.0)
    assert _delays_near("problem", old, far)[1][0] == pytest.approx(1.06)
    pinned = SimpleNamespace(dt=0.1, earliest=0.0, latest=1.1)
    assert max(start[0] for start in _delays_near("problem", old, pinned)) == 1.1


def test_simple_structures_are_fitted_first_and_the_best_start_is_kept(monkeypatch):
    known = []

    def neighbours(structure, scales, found):
        assert scales == "scales"
        known.append((structure, list(found)))
        return [np.array([10.0])] * len(found)

    def fit_batch(problem, structure, starts, bounds):
        assert problem == "problem"
        assert bounds == (structure, "scales")
        return starts + 1, np.abs(starts[:, 0] - 2.0)

    monkeypatch.setattr(
        coloured_fit,
        "_delays_near",
        lambda problem, old, scales: [old.parameters, old.parameters + 1],
    )
    monkeypatch.setattr(coloured_fit, "neighbour_starts", neighbours)
    monkeypatch.setattr(coloured_fit, "fit_batch", fit_batch)
    monkeypatch.setattr(coloured_fit, "parameter_bounds", lambda s, scales: (s, scales))
    old = {s: Candidate(s, np.array([1.0]), 0.0) for s in (ZERO, TWO, ONE)}
    whole = SimpleNamespace(candidates=old, scales="scales")
    found = _fitted_again(whole, "problem")
    assert known == [(ONE, []), (TWO, [ONE]), (ZERO, [ONE, TWO])]
    for s, candidate in found.items():
        assert candidate.structure == s
        assert candidate.parameters.tolist() == [3.0]  # from the start at 2
        assert candidate.cost == 0.0
