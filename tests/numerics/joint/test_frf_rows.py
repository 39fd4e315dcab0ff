"""Points of a frequency response as rows of a separable problem, against the transfer function."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.engine.eliminate import compress, evaluate
from ctrl_realize.numerics.engine.local_terms import Segments
from ctrl_realize.numerics.engine.modal import parameters_from_poles, respond
from ctrl_realize.numerics.engine.problem import KnownFactor, Problem, Structure
from ctrl_realize.numerics.engine.responses import SampledInput
from ctrl_realize.numerics.joint.data import with_rows
from ctrl_realize.numerics.rational.frf_data import FRFData

OMEGA = np.geomspace(0.1, 50.0, 12)
POLES = np.array([-3.0, -1.0 + 4.0j, -1.0 - 4.0j])
NUMERATOR = np.array([60.0, 5.0])  # 60 + 5 s
DEAD_TIME = 0.07
PARAMETERS = np.append(DEAD_TIME, parameters_from_poles(POLES))
EXACT = ct.tf([5.0, 60.0], np.poly(POLES).real)(1j * OMEGA) * np.exp(-1j * OMEGA * DEAD_TIME)


def points(response, sigma):
    return FRFData(1j * OMEGA, response, np.sqrt(2) / sigma, 1.0).problem


def test_the_cost_is_the_weighted_distance_with_half_of_the_variance_in_each_part():
    sigma = 0.01 * np.arange(1.0, 13.0)
    moved = EXACT + sigma * np.exp(1j * np.arange(12.0) ** 2)
    problem = points(moved, sigma)
    state = evaluate(problem, Structure(3, 2), PARAMETERS[None])
    b = state.numerator[0]
    model = (b[0] + b[1] * 1j * OMEGA) / np.polyval(np.poly(POLES), 1j * OMEGA)
    distance = np.abs(moved - model * np.exp(-1j * OMEGA * DEAD_TIME))
    assert_allclose(state.cost[0], np.sum(2 * (distance / sigma) ** 2), rtol=1e-10)
    # a search sees the same cost, and the same slope
    searched = compress(problem, Structure(3, 2), PARAMETERS[None])
    assert_allclose(searched.cost, state.cost, rtol=1e-10)
    slopes = [each.jacobian[0].T @ each.residual[0] for each in (searched, state)]
    assert_allclose(*slopes, rtol=1e-8)


@pytest.mark.parametrize("which", range(4))
def test_the_gradient_is_that_of_the_cost(which):
    moved = EXACT * (1 + 0.02 * np.exp(1j * np.arange(12.0) ** 2))
    problem = points(moved, np.full(12, 0.01))
    step = 1e-6 * np.eye(4)[which]
    rows = np.array([PARAMETERS - step, PARAMETERS, PARAMETERS + step])
    state = evaluate(problem, Structure(3, 2), rows)
    slope = -2 * state.jacobian[1, :, which] @ state.residual[1]
    # central differences of a cost of some hundreds with steps of 1e-6
    assert_allclose((state.cost[2] - state.cost[0]) / 2e-6, slope, rtol=1e-4, atol=1e-3)


def test_initial_states_of_records_leave_the_points_alone():
    dt, n = 0.02, 80
    u = np.sign(np.sin(np.arange(n) ** 1.5))
    y = respond(SampledInput(u, dt), KnownFactor(), NUMERATOR, PARAMETERS)
    y = y + 0.3 + 2.0 * np.exp(-3.0 * dt * np.arange(n))  # a level, and a free response
    segments = Segments(np.array([0, n]), dt * np.arange(n), np.ones((n, 1)))
    record = Problem(y, np.ones(n), SampledInput(u, dt), np.empty((n, 0)), KnownFactor(), segments)
    more = points(EXACT, np.full(12, 0.01))
    joint = with_rows(record, more)
    state = evaluate(joint, Structure(3, 2), PARAMETERS[None])
    assert state.cost[0] < 1e-12 * float(y @ y)
    assert_allclose(state.numerator[0], NUMERATOR, rtol=1e-8)
    assert joint.local_count(3) == record.local_count(3)
