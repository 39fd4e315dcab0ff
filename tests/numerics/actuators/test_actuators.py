"""Laws of the elements of actuators, with closed forms and one model against another."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.actuators import Characteristic
from ctrl_realize.numerics.actuators.friction import backlash, kano
from ctrl_realize.numerics.actuators.limits import (
    resolved,
    slew_limited,
    without_dead_zone,
)
from tests.oracles.he import he
from tests.oracles.lugre import LuGre, lugre_stem

choudhury = partial(kano, sided=False)


def triangle(n: int = 400, height: float = 10.0, periods: int = 3) -> np.ndarray:
    phase = np.linspace(0, periods, n)
    return height * (1 - np.abs(2 * (phase % 1) - 1))


def random_walk(seed: int, hold: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.repeat(np.cumsum(rng.normal(0, 1.0, 300)), hold)


def test_a_slew_limited_step_takes_its_height_over_the_rate_of_its_direction():
    u = np.concatenate([np.zeros(10), np.full(60, 5.0), np.full(60, -1.0)])
    y = slew_limited(u, opening=2.0, closing=4.0, dt=0.1)
    moving = np.diff(y)
    assert_allclose(y[10:35], 0.2 * np.arange(1, 26))
    assert_allclose(moving[moving < 0], -0.4)
    assert (np.sum(moving > 0), np.sum(moving < 0), y[-1]) == (25, 15, -1.0)


@pytest.mark.parametrize("start", [-1.0, 0.0, 1.0])
def test_without_a_jump_models_of_stiction_are_backlash(start):
    u = random_walk(1)
    assert_allclose(kano(u, 2.0, 0.0, start), backlash(u, 2.0, start), atol=1e-12)
    swings = triangle()
    assert_allclose(choudhury(swings, 2.0, 0.0, 1.0), backlash(swings, 2.0, 1.0), atol=1e-12)


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("start", [-1.0, 0.0, 1.0])
def test_for_commands_that_pause_hes_model_is_kanos(seed, start):
    u = random_walk(seed, hold=3)
    stick, jump = 3.0, 1.2
    expected = he(u, (stick + jump) / 2, (stick - jump) / 2, start)
    assert_allclose(kano(u, stick, jump, start), expected, atol=1e-9)


@pytest.mark.parametrize("model", [choudhury, kano])
def test_a_stem_turns_after_s_with_a_jump_of_j(model):
    u, stick, jump = triangle(4001), 2.0, 0.7
    y = model(u, stick, jump)
    change = float(np.max(np.diff(u)))
    turned = int(np.argmax(u))
    moves = turned + np.flatnonzero(np.diff(y[turned:]))[0] + 1
    assert u[turned] - u[moves] == pytest.approx(stick, abs=2 * change)
    assert y[moves - 1] - y[moves] == pytest.approx(jump, abs=2 * change)
    later = slice(moves, moves + 500)
    assert_allclose(y[later] - u[later], (stick - jump) / 2)


def test_a_resolution_is_the_smallest_change_that_moves_the_output():
    y = resolved(np.linspace(0, 1, 1001), 0.1)
    assert_allclose(np.unique(np.round(y, 9)), np.linspace(0, 1, 11))
    assert_allclose(without_dead_zone(np.array([-3.0, 0.5, 3.0]), -1.0, 2.0), [-2.0, 0.0, 1.0])


def test_equal_percentages_are_the_exponential_characteristic():
    travel, middle = np.linspace(0, 1, 11), 0.5
    valve = Characteristic("equal-percentage", high=1.0, full_flow=1.0, rangeability=50.0)
    flow = valve.simulate(travel)
    curve = np.expm1(np.log(50.0) * (travel - middle))
    # The same up to gain and level: f = f(m) (1 + curve).
    assert_allclose(flow, valve.simulate([middle]) * (1 + curve))


def test_a_stem_with_lugre_friction_breaks_away_at_the_static_force_and_slides_at_the_kinetic():
    stem = LuGre(1.0, 100.0, 5.0, 10.0, 0.01, 1e5, 300.0, 20.0)
    dt, speed = 0.01, 0.2
    u = speed * dt * np.arange(200)
    y = lugre_stem(u, stem, dt)
    first = int(np.flatnonzero(y > 1e-3)[0])
    assert stem.spring * u[first] == pytest.approx(stem.static, rel=0.08)
    # In steady sliding the spring's force lags by Coulomb and viscous friction.
    sliding = slice(-40, None)
    assert np.mean(stem.spring * (u - y)[sliding]) == pytest.approx(5.0 + 20.0 * speed, rel=0.05)
