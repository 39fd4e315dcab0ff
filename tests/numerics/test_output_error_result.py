"""What is put together of a fit: model, table of structures and interval."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ctrl_realize.numerics.delayed_modes import MoveTrain
from ctrl_realize.numerics.fit_window import Window, WindowFit
from ctrl_realize.numerics.output_error_result import assembled, profile_of
from ctrl_realize.numerics.profile_interval import delay_profile
from ctrl_realize.numerics.separable_fit import KnownFactor, Problem, Structure, respond
from ctrl_realize.numerics.structure_search import Candidate, Scales

ONE, TWO, ZERO = Structure(1, 1), Structure(2, 2), Structure(2, 1)
SIZE, EDGE, DT = 150, 10, 0.5
SCALES = Scales(3.0, 5.0, 70.0, DT, 8.0, 1.0)
# delay in s; two poles at 0.2 and 0.8, and a zero at -0.5: omega 0.4, zeta 1.25
TRUTH = np.array([3.7, np.log(0.4), np.log(1.25)])
GAINS = np.array([0.4, 0.8])


@pytest.fixture(scope="module")
def whole():
    """Two lags and a lead, sampled exactly; its rivals are not at their optima."""
    one = np.ones(SIZE, dtype=np.int64)
    drive = MoveTrain(DT * np.arange(SIZE), one, DT, np.array([EDGE * DT]), np.ones(1))
    output = 3.0 + respond(drive, KnownFactor(), GAINS, TRUTH)
    level = np.ones((SIZE, 1))
    problem = Problem(output, np.ones(SIZE), drive, level, KnownFactor())
    candidates = {
        ONE: Candidate(ONE, np.array([3.0, np.log(0.25)]), 9.0),
        TWO: Candidate(TWO, np.array([2.0, np.log(0.4), np.log(1.25)]), 7.0),
        ZERO: Candidate(ZERO, TRUTH, 0.0),
    }
    criterion = {ONE: 30.0, TWO: 80.0, ZERO: 11.0}
    window = Window(EDGE, output, problem, drive, level, None)
    return WindowFit(window, problem, candidates, criterion, SCALES, 0.3, 1.7, 1.1)


def result(whole, **changed):
    given = {
        "chosen": whole.candidates[ZERO],
        "adequate": True,
        "views": (),
        "profiles": {},
        "interval": (3.5, 3.9, 0.1),
        "profile": (np.array([3.5, 3.9]), np.zeros(2)),
    } | changed
    return assembled(whole, *given.values())


def test_the_model_is_that_of_the_chosen_structure(whole):
    found = result(whole)
    assert (found.delay, found.low, found.high, found.std) == (3.7, 3.5, 3.9, 0.1)
    assert found.structure == ZERO
    assert np.sort(found.poles.real) == pytest.approx([-0.8, -0.2])
    # the lowest power first
    assert found.numerator == pytest.approx(GAINS)
    assert found.fitted == pytest.approx(whole.window.output)
    assert found.latest == 8.0
    other = result(whole, chosen=whole.candidates[ONE])
    assert (other.delay, other.structure) == (3.0, ONE)
    assert other.poles.tolist() == [pytest.approx(-0.25)]
    assert np.abs(other.fitted - whole.window.output).max() > 0.01


def test_noise_and_views_are_handed_on(whole):
    views = (("first motion", 3.0),)
    found = result(whole, views=views, adequate=False)
    assert (found.residual, found.correlation, found.misfit) == (0.3, 1.7, 1.1)
    assert found.views == views
    assert found.adequate is False
    assert result(whole).adequate is True
    assert result(whole).profile[0].tolist() == [3.5, 3.9]
    assert found.whitened is False
    assert result(replace(whole, colour=1.2)).whitened is True


def test_the_table_has_every_structure_the_best_one_first(whole):
    table = result(whole).structures
    assert [line.structure for line in table] == [ZERO, ONE, TWO]
    assert [line.excess for line in table] == [0.0, 19.0, 69.0]
    assert [line.delay for line in table] == [3.7, 3.0, 2.0]
    # the delay and the lags, 5 s and 1.25 s or 4 s; less the lead of 2 s
    assert [line.total_delay for line in table] == pytest.approx([7.95, 7.0, 8.25])
    assert [line.poles.size for line in table] == [2, 1, 2]
    assert all(np.isnan([line.low, line.high]).all() for line in table)


def test_lines_of_the_table_have_an_interval_where_there_is_a_profile(whole):
    grid = np.linspace(1.0, 5.0, 41)
    profile = grid, ((grid - 3.0) / 0.5) ** 2
    best, one, two = result(whole, profiles={ONE: profile}).structures
    assert one.structure == ONE
    # linear in the root: half a second times the square root of 3.84
    assert [one.low, one.high] == pytest.approx([3 - 0.5 * 3.84**0.5, 3 + 0.5 * 3.84**0.5])
    assert np.isnan([best.low, best.high, two.low, two.high]).all()


def test_a_profile_is_that_of_the_problem_in_units_of_its_variance(whole):
    delay, excess = profile_of(whole, whole.candidates[ZERO])
    same = delay_profile(whole.problem, whole.candidates[ZERO], 0.3**2 * 1.7, SCALES)
    assert np.array_equal(delay, same[0])
    assert np.array_equal(excess, same[1])
    assert excess.min() == 0.0
    assert delay[0] == 1.0
    assert delay[-1] == 8.0
