"""Smith predictors against feedback of the whole models, and in brute-force simulation."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests.oracles.dense import step_response

DT = 7.8125e-4


def closed(plant, controller):
    return ct.feedback(ct.ss(plant) * ct.ss(controller), 1)


def loaded(plant, controller):
    return ct.feedback(ct.ss(plant), ct.ss(controller))


@pytest.mark.parametrize("delay", [1, 2, 37, 100])
@pytest.mark.parametrize("kind", ["valve", "stable", "direct"])
@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_the_set_point_response_is_that_of_the_core_alone_d_samples_later(
    valve, cores, pi_controller, kind, delay
):
    core = valve(0).delay_free if kind == "valve" else cores[kind]
    controller = pi_controller(1.5, 0.1)
    predictor = cr.design.smith_predictor(cr.delayed_ss(core, delay), controller)
    alone = step_response(ct.feedback(core * controller, 1), 600)
    found = step_response(closed(cr.delayed_ss(core, delay), predictor), 600 + delay)
    np.testing.assert_array_equal(found[:delay], 0)
    np.testing.assert_allclose(found[delay:], alone, atol=1e-11)  # 600 steps of rounding


@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_margins_see_the_same_closed_loop_as_its_eigenvalues(valve, pi_controller):
    counts = []
    for gain, delay in ((0.5, 30), (1.5, 60), (4.0, 40), (4.0, 120)):
        plant, controller = valve(20), pi_controller(gain, 0.1)
        predictor = cr.design.smith_predictor(plant, controller)
        radius = np.abs(closed(plant.replace(delay=delay), predictor).poles())
        found = cr.design.margins(plant.replace(delay=delay), predictor)
        assert found.unstable_poles == np.sum(radius > 1)
        counts.append(found.unstable_poles)
    assert counts[0] == 0 < counts[-1]


def test_a_filtered_predictor_leaves_no_error_after_a_load(valve, pi_controller):
    plant = valve(100)
    predictor = cr.design.smith_predictor(plant, pi_controller(1.5, 0.1), filter_time=0.05)
    assert cr.design.margins(plant, predictor).stable
    assert abs(step_response(loaded(plant, predictor), 6000)[-1]) < 1e-6


@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_the_range_of_stable_dead_times_ends_where_it_says(valve, pi_controller):
    plant = valve(37)
    predictor = cr.design.smith_predictor(plant, pi_controller(3.0, 0.08))
    checked = cr.design.delay_robustness(plant, predictor, (0.02, 0.03))
    last = round(checked.stable_to / DT)
    assert np.all(np.abs(closed(plant.replace(delay=last), predictor).poles()) < 1)
    assert np.any(np.abs(closed(plant.replace(delay=last + 1), predictor).poles()) > 1)
    assert checked.stable
    assert checked.worst_modulus_margin == checked.table()["modulus_margin"].min()
    assert "stable" in checked.report()


@pytest.mark.parametrize("delay", [5, 700])
def test_the_response_is_smiths_in_any_units(delay):
    unit, gain = 1e6, 1e-6
    plant = cr.delayed_ss(ct.tf([gain], [unit, 1]), delay, dt=0.1 * unit)
    controller = ct.tf([0.66 / gain, -0.6 / gain], [1, -1], 0.1 * unit)
    z = np.exp(1j * np.geomspace(0.01, 3, 40))
    pole = np.exp(-0.1)
    core = gain * (1 - pole) / (z - pole)
    C = 0.6 / gain * (1.1 * z - 1) / (z - 1)
    predictor = cr.design.smith_predictor(plant, controller)
    expected = C / (1 + C * core * (1 - z**-delay))
    # z^-d has d times the rounding of z
    np.testing.assert_allclose(predictor(z), expected, rtol=1e-11)
