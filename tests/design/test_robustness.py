"""Uncertainty bounds against the plants that they must hold, and small gain against eigenvalues."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.io import FitSummary

DT = 7.8125e-4


def test_the_bound_holds_every_given_plant(valve):
    plant = valve(37)
    others = [valve(36), 1.1 * valve(38), 0.95 * plant]
    bound = cr.design.uncertainty_bound(others, plant)
    z = np.exp(1j * bound.omega * DT)
    for other in others:
        assert np.all(np.abs(other(z) / plant(z) - 1) <= bound.bound + 1e-12)
    assert np.any(np.isclose(np.abs(others[1](z) / plant(z) - 1), bound.bound))


def test_the_part_of_the_delay_is_the_supremum_over_the_interval(valve):
    plant = valve(37)
    bound = cr.design.uncertainty_bound([], plant, dead_time_interval=(30 * DT, 41 * DT))
    shifts = np.linspace(-7 * DT, 4 * DT, 2001)
    expected = np.abs(np.exp(-1j * bound.omega[:, None] * shifts) - 1).max(axis=1)
    np.testing.assert_allclose(bound.delay_part, expected, rtol=1e-4, atol=1e-12)
    np.testing.assert_array_equal(bound.bound, bound.delay_part)


def test_a_robust_loop_is_stable_for_every_plant_within(valve, pi_controller):
    plant = valve(37)
    others = [valve(33), 1.2 * valve(40), 0.8 * plant]
    found = cr.design.uncertainty_bound(others, plant).check(pi_controller(0.5, 0.1))
    assert found.robust
    for other in others:
        loop = ct.feedback(ct.ss(other) * pi_controller(0.5, 0.1), 1)
        assert np.all(np.abs(loop.poles()) < 1)
        ms = cr.design.margins(other, pi_controller(0.5, 0.1)).ms
        assert ms <= found.performance * (1 + 1e-6)


def test_a_loop_that_some_plant_destabilizes_is_not_called_robust(valve, pi_controller):
    plant = valve(37)
    gm = cr.design.margins(plant, pi_controller(0.5, 0.1)).gain_margin
    found = cr.design.uncertainty_bound([1.01 * gm * plant], plant).check(pi_controller(0.5, 0.1))
    assert not found.robust
    assert found.performance == np.inf
    assert "NOT guaranteed" in found.report()


def test_an_interval_is_around_the_dead_time_and_not_around_the_delay_that_holds_it(valve):
    continuous = cr.design.to_continuous(valve(0)).core
    truth = 36.25 * DT  # held as z^-37 and a direct term
    interval = truth - 2 * DT, truth + 2 * DT
    values = (("dead_time", truth), ("dead_time_interval", interval))
    fit = FitSummary("Fit", "Fit", (), values)
    plant = cr.delayed_ss(continuous, dead_time=truth, dt=DT, fit=fit)
    assert plant.delay == 37
    bound = cr.design.uncertainty_bound([], plant)
    np.testing.assert_allclose(
        bound.delay_part, 2 * np.sin(np.minimum(2 * DT * bound.omega, np.pi) / 2), rtol=1e-6
    )
    checked = cr.design.delay_robustness(plant, cr.design.PIDController(0.5, 0.2, dt=DT))
    np.testing.assert_allclose(checked.dead_times / DT, np.arange(34.25, 38.5), rtol=1e-9)
    np.testing.assert_allclose(checked.table()["dead_time"], checked.dead_times)


@pytest.mark.parametrize("samples", [2.21, 5.51, 13.87])
def test_the_range_of_dead_times_is_that_of_the_plant_sampled_with_each(samples):
    core, dt = ct.tf([2.0], [1, 1]), 0.05
    system = cr.delayed_ss(core, dead_time=samples * dt, dt=dt)
    controller = cr.design.pid(system)
    found = cr.design.delay_robustness(system, controller, (samples * dt, 3 * samples * dt))
    whole = int(np.ceil(samples))
    # f from a feedthrough, which to_continuous solves for to 1e-9 of it
    assert found.nominal_dead_time == pytest.approx(samples * dt, rel=1e-7)
    assert found.fractional_time == pytest.approx((whole - samples) * dt, rel=1e-6)

    def is_stable(later):
        """Eigenvalues of the closed loop with the plant sampled later by whole samples."""
        other = cr.delayed_ss(core, dead_time=(samples + later) * dt, dt=dt)
        loop = ct.feedback(ct.ss(other), ct.ss(controller))
        return np.abs(np.linalg.eigvals(loop.A)).max() < 1

    last = next(later for later in range(200) if not is_stable(later + 1))
    assert found.stable_to == pytest.approx((samples + last) * dt, rel=1e-7)
    # the uncertainty of a dead time that is known is none
    bound = cr.design.uncertainty_bound([], system, dead_time_interval=(samples * dt,) * 2)
    assert bound.delay_part.max() < 1e-6


TS = 0.01


def plant(lag=0.8, dead_time=0.3):
    return cr.delayed_ss(ct.tf([2.0], [lag, 1]), dead_time=dead_time, dt=TS)


def pi(gain, integral_time):
    return ct.ss(ct.tf([gain * (1 + TS / integral_time), -gain], [1, -1], TS))


@pytest.mark.parametrize("delay", [0, 37, 100, 300, 1000])
def test_phase_is_that_of_a_fine_grid_on_any_grid(valve, delay):
    plant = valve(delay)
    fine = np.linspace(0.001, 0.99 * np.pi / DT, 400_000)
    expected = np.unwrap(np.angle(plant(np.exp(1j * fine * DT))))
    some = np.array([17, 40_000, 200_000, 399_999])
    found = cr.design.unwrapped_phase(plant, fine[some])
    np.testing.assert_allclose(found, expected[some], rtol=1e-9, atol=1e-9)


def test_the_phase_of_a_continuous_system_has_its_delay_at_any_frequency():
    lag, omega = ct.tf([1], [0.1, 1]), np.array([1.0, 100.0, 1e3, 1e5])
    exact = -0.3 * omega - np.arctan(0.1 * omega)
    for system in (lag * cr.delay(0.3), cr.delay(0.3) * lag):
        np.testing.assert_allclose(cr.design.unwrapped_phase(system, omega), exact, rtol=1e-12)
    # the second path is a twentieth of the first: its phase never leads by half a turn
    paths = lag * cr.delay(0.3) + 0.05 * (lag * cr.delay(0.5))
    expected = exact + np.angle(1 + 0.05 * np.exp(-0.2j * omega))
    np.testing.assert_allclose(cr.design.unwrapped_phase(paths, omega), expected, rtol=1e-12)


@pytest.mark.parametrize("delay", [37, 300])
def test_sixty_measured_points_are_unwrapped_without_being_told_the_delay(valve, delay):
    omega = 2 * np.pi * np.geomspace(0.1, 50, 60)
    response = valve(delay)(np.exp(1j * omega * DT))
    noise = np.random.default_rng(1).standard_normal((2, 60)) * 0.02 * np.abs(response)
    data = cr.MeasuredFRF(response + noise[0] + 1j * noise[1], omega / (2 * np.pi))
    exact = cr.design.unwrapped_phase(valve(delay), omega)
    found = cr.design.unwrapped_phase(data)
    np.testing.assert_allclose(found, exact, atol=0.1)  # 2 % noise, five sigma
    told = cr.design.unwrapped_phase(data, dead_time=delay * DT)
    np.testing.assert_allclose(told, exact, atol=0.1)
    # What plain unwrapping makes of it: whole turns are missing.
    assert np.abs(np.unwrap(np.angle(response)) - exact).max() > 6 or delay == 37
