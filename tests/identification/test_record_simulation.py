"""Simulation from an unknown start, piece by piece."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.delayed.simulation import as_delayed, simulate_record
from ctrl_realize.errors import DataError, UnsuitableSystemError

DT = 0.1


def core(pole=0.8, D=0.0, dt=DT):
    return ct.ss([[pole]], [[1.0]], [[1 - pole]], [[D]], dt)


def record(u, y, dt=DT):
    return cr.Record(dt * np.arange(np.shape(u)[-1]), u, y)


def test_a_dead_time_longer_than_the_record_leaves_what_the_record_shows():
    system = cr.DelayedStateSpace(core(), 50, output_delay=0)
    rng = np.random.default_rng(0)
    u = np.r_[np.repeat(rng.standard_normal(5), 10), rng.standard_normal(10)]
    y = system.simulate(np.r_[u, np.zeros(10)])[50:60]
    # ten samples of which each may have its own level inside the dead time
    assert_allclose(simulate_record(system, record(np.ones(10), y), "estimate")[0], y, atol=1e-9)
    assert np.ptp(simulate_record(system, record(np.ones(10), y), "rest")) == 0.0


def test_each_output_has_its_own_offset_and_delay():
    system = cr.DelayedStateSpace(
        ct.ss([[0.8]], [[1.0]], [[1.0], [2.0]], np.zeros((2, 1)), DT), 0, output_delay=(0, 4)
    )
    u = np.random.default_rng(0).standard_normal(80)
    y = system.simulate(u) + np.array([[3.0], [-5.0]])
    one = record(u[20:], y[:, 20:])
    assert_allclose(simulate_record(system, one, "estimate"), one.output, rtol=0, atol=1e-9)


def test_units_of_the_outputs_do_not_matter():
    units = np.array([[1e9], [1.0]])
    plant = ct.ss([[0.8]], [[1.0]], [[1.0], [2.0]], np.zeros((2, 1)), DT)
    other = ct.ss(plant.A, plant.B, units * plant.C, plant.D, DT)
    rng = np.random.default_rng(0)
    u = rng.standard_normal(60)
    y = cr.DelayedStateSpace(plant, 3).simulate(u) + 0.1 * rng.standard_normal((2, 60))
    found, scaled = (
        simulate_record(cr.DelayedStateSpace(core, 3), record(u[10:], of[:, 10:]), "estimate")
        for core, of in ((plant, y), (other, units * y))
    )
    # 1e9 in 16 digits
    assert_allclose(scaled / units, found, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("system", "error", "match"),
    [
        ("plant", UnsuitableSystemError, "a str; needed is a discrete"),
        (core(dt=None), UnsuitableSystemError, "not discrete"),
        (core(dt=0), UnsuitableSystemError, "not discrete"),
        (core(dt=True), UnsuitableSystemError, "not discrete with a sample time"),
        (core(dt=1.0011 * DT), DataError, r"0\.1 s, the system 0\.10011 s"),
        (ct.ss([[0.5]], [[1.0, 1.0]], [[1.0]], np.zeros((1, 2)), DT), DataError, "the system 2"),
        (ct.ss([[0.5]], [[1.0]], np.ones((2, 1)), np.zeros((2, 1)), DT), DataError, "1 and 2"),
        (core(1 + 1.1e-6), UnsuitableSystemError, "unstable"),
    ],
)
def test_systems_that_do_not_fit_the_record_are_refused(system, error, match):
    with pytest.raises(error, match=match):
        as_delayed(system, record(np.ones(9), np.ones(9)))
