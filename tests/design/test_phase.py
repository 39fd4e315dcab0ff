"""Unwrapped phase against closed forms, on grids that unwrapping alone gets wrong."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError, UnsuitableSystemError
from ctrl_realize.numerics.rational.phase import dead_time_from_phase

DT = 7.8125e-4


@pytest.mark.parametrize("delay", [0, 37, 100, 300, 1000])
def test_phase_is_that_of_a_fine_grid_on_any_grid(valve, delay):
    plant = valve(delay)
    fine = np.linspace(0.001, 0.99 * np.pi / DT, 400_000)
    expected = np.unwrap(np.angle(plant(np.exp(1j * fine * DT))))
    some = np.array([17, 40_000, 200_000, 399_999])
    found = cr.design.unwrapped_phase(plant, fine[some])
    np.testing.assert_allclose(found, expected[some], rtol=1e-9, atol=1e-9)


def test_order_of_frequencies_and_unit_do_not_matter(valve):
    omega = np.array([300.0, 1.0, 20.0])
    found = cr.design.unwrapped_phase(valve(300), omega)
    np.testing.assert_array_equal(cr.design.unwrapped_phase(valve(300), omega[::-1]), found[::-1])
    np.testing.assert_allclose(
        cr.design.unwrapped_phase(valve(300), omega, deg=True), np.degrees(found)
    )


@pytest.mark.parametrize("integrators", [0, 1, 2, 3])
def test_integrators_start_at_minus_90_degrees_each(integrators):
    loop = ct.tf([1.0], [1.0, *[0.0] * integrators])
    found = cr.design.unwrapped_phase(loop, [0.1, 10.0], dead_time=2.0, deg=True)
    expected = -90 * integrators - np.degrees(2.0 * np.array([0.1, 10.0]))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_negative_gain_starts_half_a_turn_lower(valve):
    omega = np.array([1.0, 50.0])
    found = cr.design.unwrapped_phase(-valve(37), omega) - cr.design.unwrapped_phase(
        valve(37), omega
    )
    np.testing.assert_allclose(found, -np.pi, rtol=1e-12)


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


def test_wrong_uses_are_refused(valve):
    data = cr.MeasuredFRF([1.0, 0.5, 0.2], [1, 2, 3])
    with pytest.raises(OptionError, match="omega is missing"):
        cr.design.unwrapped_phase(valve(3))
    with pytest.raises(OptionError, match="leave it out"):
        cr.design.unwrapped_phase(data, [1.0])
    with pytest.raises(DataError, match="frequencies >= 0"):
        cr.design.unwrapped_phase(valve(3), [-1.0])
    with pytest.raises(UnsuitableSystemError, match="2 inputs"):
        cr.design.unwrapped_phase(cr.MeasuredFRF(np.ones((1, 2, 3)), [1, 2, 3]))


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_how_long_a_dead_time_can_be_told_depends_on_the_spacing_and_not_its_unit(unit):
    # 4.5 rad from point to point at least: beyond half a turn, within one
    uneven = np.cumsum([1.0, 1.0, 1.3, 1.1, 1.5, 1.2, 1.0, 1.4, 1.7, 1.3])
    found = dead_time_from_phase(uneven / unit, np.exp(-4.5j * uneven))
    assert found == pytest.approx(4.5 * unit, rel=1e-6)
    # evenly spaced, 4.5 rad is 1.8 rad the other way round, which no delay is
    even = np.arange(1.0, 11.0)
    assert dead_time_from_phase(even / unit, np.exp(-2.5j * even)) == pytest.approx(2.5 * unit)
    # the last delay tried is half a turn, or a sixty-fourth more
    assert dead_time_from_phase(even / unit, np.exp(-4.5j * even)) < 1.05 * np.pi * unit
