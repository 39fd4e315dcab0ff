"""Uncertainty bounds against the plants that they must hold, and small gain against eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError

DT = 7.8125e-4


@dataclass(frozen=True)
class FitWithInterval:
    dead_time_interval: tuple[float, float]


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


def test_the_identified_interval_is_taken_by_default(valve):
    plant = valve(37).replace(fit=FitWithInterval((0.028, 0.030)))
    assert cr.design.uncertainty_bound([], plant).delay_part.max() > 0
    with pytest.raises(OptionError, match="no interval"):
        cr.design.uncertainty_bound([], valve(37))


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


def test_the_margin_is_how_much_the_bound_may_grow(valve, pi_controller):
    plant = valve(37)
    found = cr.design.uncertainty_bound([1.1 * plant], plant).check(pi_controller(0.5, 0.1))
    # A pure gain error of 10 %: the bound is 0.1 at all frequencies, the margin 10 / max |T|.
    z = np.exp(1j * found.uncertainty.omega * DT)
    loop = plant(z) * pi_controller(0.5, 0.1)(z)
    assert found.margin == pytest.approx(10 / np.abs(loop / (1 + loop)).max(), rel=1e-6)
    np.testing.assert_allclose(found.uncertainty.bound, 0.1, rtol=1e-9)


def test_a_loop_that_some_plant_destabilizes_is_not_called_robust(valve, pi_controller):
    plant = valve(37)
    gm = cr.design.margins(plant, pi_controller(0.5, 0.1)).gain_margin
    found = cr.design.uncertainty_bound([1.01 * gm * plant], plant).check(pi_controller(0.5, 0.1))
    assert not found.robust
    assert found.performance == np.inf
    assert "NOT guaranteed" in found.report()


def test_the_bound_is_a_control_frd(valve):
    bound = cr.design.uncertainty_bound([valve(36)], valve(37), np.array([1.0, 10.0, 100.0]))
    assert isinstance(bound.frd, ct.FrequencyResponseData)
    np.testing.assert_allclose(bound.frd.magnitude, bound.bound)
    assert "%" in bound.report()


def test_wrong_arguments_are_refused(valve):
    make = cr.design.uncertainty_bound
    with pytest.raises(OptionError, match="Campaign or a list"):
        make(valve(3))
    with pytest.raises(OptionError, match="no nominal"):
        make([])
    with pytest.raises(DataError, match="rise"):
        make([valve(3)], valve(4), [2.0, 1.0])
    with pytest.raises(DataError, match=r"dt=0\.1"):
        make([ct.ss(0.5, 1, 1, 0, 0.1)], valve(4))
    with pytest.raises(OptionError, match="low <= high"):
        make([], valve(4), dead_time_interval=(2.0, 1.0))


@dataclass(frozen=True)
class FitWithFraction:
    dead_time: float
    dead_time_interval: tuple[float, float]


def test_an_interval_is_around_the_dead_time_and_not_around_the_delay_that_holds_it(valve):
    continuous = cr.design.to_continuous(valve(0)).core
    truth = 36.25 * DT  # held as z^-37 and a direct term
    fit = FitWithFraction(truth, (truth - 2 * DT, truth + 2 * DT))
    plant = cr.delayed_ss(continuous, dead_time=truth, dt=DT, fit=fit)
    assert plant.delay == 37
    bound = cr.design.uncertainty_bound([], plant)
    np.testing.assert_allclose(
        bound.delay_part, 2 * np.sin(np.minimum(2 * DT * bound.omega, np.pi) / 2), rtol=1e-6
    )
    checked = cr.design.delay_robustness(plant, cr.design.PIDController(0.5, 0.2, dt=DT))
    np.testing.assert_allclose(checked.dead_times / DT, np.arange(34.25, 38.5), rtol=1e-9)
    np.testing.assert_allclose(checked.table()["dead_time"], checked.dead_times)
