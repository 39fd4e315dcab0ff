"""Pieces of `benchmarks.acceptance`: responses, bounds by a second method, loops, the table."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from benchmarks.acceptance import __main__ as runs
from benchmarks.acceptance import cases
from benchmarks.acceptance.cases import PLANTS, SAMPLES
from ctrl_realize.identification.bound import Bound, Experiment
from ctrl_realize.identification.noise import NoiseModel
from tests import rigs

STABLE = [name for name, plant in PLANTS.items() if not plant.integrators]
STEP = (np.arange(SAMPLES) >= 100).astype(float)


def transfer_function(values):
    """Written out by the names of the parameters."""
    below = [1.0]
    for name, value in values.items():
        if name.startswith("lag_"):
            below = np.polymul(below, [value, 1])
        if name.startswith("pair_time_"):
            damping = values[name.replace("time", "damping")]
            below = np.polymul(below, [value**2, 2 * damping * value, 1])
    return ct.tf([values["gain"] * values.get("lead_1", 0.0), values["gain"]], below)


@pytest.mark.parametrize("name", STABLE)
def test_a_step_response_is_that_of_the_transfer_function(name):
    plant = PLANTS[name]
    late = plant.dt * (np.arange(SAMPLES) - 100) - plant.values["dead_time"]
    expected = rigs.exact_step(transfer_function(plant.values), late)
    found = cases.response(plant, plant.values, STEP)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_the_ramp_of_the_integrator_is_that_of_its_rate():
    plant = PLANTS["integrator and lag"]
    rate, lag = plant.values["gain"], plant.values["lag_1"]
    late = np.clip(np.arange(SAMPLES) - 100 - plant.values["dead_time"], 0, None)
    expected = rate * (late + lag * np.expm1(-late / lag))
    found = cases.response(plant, plant.values, STEP)
    np.testing.assert_allclose(found, expected, atol=1e-4 * expected.max())


@pytest.mark.parametrize("name", PLANTS)
def test_bounds_are_those_of_the_derivatives_of_the_fit(name):
    plant, sigma = PLANTS[name], 0.01
    found = cases.bounds(plant, "step", STEP, sigma)
    exact = Bound(cases.model(plant.values, plant.integrators), plant.dt)
    test = Experiment(STEP, NoiseModel(np.empty(0), sigma, plant.dt))
    expected = exact.errors([test], exact.gradient(["dead_time", "gain"]))
    assert [found["dead_time"], found["gain"]] == pytest.approx(expected.tolist(), rel=0.01)


def test_an_unknown_drift_leaves_less_information():
    plant = PLANTS["integrator and lag"]
    drive = cases.binary(4, np.random.default_rng(1))
    with_drift, without = (cases.bounds(plant, kind, drive, 0.1) for kind in ("binary", "loop"))
    assert all(with_drift[name] >= without[name] for name in plant.values)
    # a wrong rate is in part a drift, and a wrong lag is not
    apart = {name: with_drift[name] / without[name] for name in plant.values}
    assert apart["gain"] > 1.1 > apart["lag_1"]


@pytest.mark.parametrize("name", ["two lags", "integrator and lag", "Rao and Garnier"])
def test_a_loop_is_that_of_plant_and_controller(name):
    plant = PLANTS[name]
    record, sigma = cases.made(name, "loop", 700)
    drive, output, wanted = (x.ravel() for x in (record.input, record.output, record.reference))
    gain, integral_time = plant.controller
    error = wanted - output
    asked = gain * (error + plant.dt / integral_time * np.cumsum(error))
    np.testing.assert_allclose(drive, asked, atol=1e-9)
    noise = output - cases.response(plant, plant.values, drive)
    assert np.std(noise) == pytest.approx(sigma, rel=0.1)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4 / np.sqrt(SAMPLES)


def test_without_noise_refined_instrumental_variables_find_the_plant():
    plant = PLANTS["Rao and Garnier"]  # its sample time is not 1 s
    drive = cases.binary(plant.clock, np.random.default_rng(2))
    time = plant.dt * np.arange(SAMPLES)
    record = cr.Record(time, drive, cases.response(plant, plant.values, drive))
    found = {name: told[0] for name, told in cases.of_srivc(plant, record).items()}
    assert found == pytest.approx(dict(plant.values), rel=0.01)


def test_a_stated_structure_tells_every_parameter():
    plant = PLANTS["zero on the right"]
    record, sigma = cases.made("zero on the right", "binary", 700)
    told, _ = cases.estimated("zero on the right", "structure", record)
    least = cases.bounds(plant, "binary", record.input.ravel(), sigma)
    assert told.keys() == plant.values.keys()
    for name, (value, error, low, high) in told.items():
        assert low < value < high
        assert 0.8 * least[name] < error < 1.5 * least[name]
        assert abs(value - plant.values[name]) < 4 * least[name]


def test_the_table_counts_errors_and_intervals():
    values = PLANTS["one lag"].values
    rows = [
        {
            "plant": "one lag", "kind": "step", "way": "structure", "seed": seed, "flags": [],
            "bound": dict.fromkeys(values, 0.5),
            "told": {
                name: [true + shift, 0.6, true + shift - 1.5, true + shift + 1.5]
                for name, true in values.items()
            },
        }
        for seed, shift in enumerate([-1.0, 0.0, 1.0, 2.0])
    ]  # fmt: skip
    refused = {key: rows[0][key] for key in ("plant", "kind", "way", "bound")}
    rows.append({**refused, "seed": 4, "refused": "regulation"})
    found = runs.cells(rows)["one lag", "step", "structure"]["dead_time"]
    assert (found.count, found.held, found.intervals) == (4, 3, 4)
    assert found.bias == pytest.approx(0.5)
    assert found.std == pytest.approx(np.sqrt(5 / 3))
    assert found.ratio == pytest.approx(2 * found.std)
    assert found.significance == pytest.approx(1 / found.std)
    text = "\n".join(runs.table(rows))
    assert (
        "| one step | structure | 5 | 1 | 3 | 2.58 (2.58 to 2.58) | 0.46 | 75.0 % of 12 |" in text
    )
    assert "| one lag | lag_1 | 20 | 0.5 | structure | 4 | +0.5 ± 0.6 |" in text
