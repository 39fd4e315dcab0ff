"""Spikes of a sensor: left out where neither the plant nor its noise explains them (simulated)."""

from functools import cache

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.numerics.signals.noise import spikes
from tests.rigs import codes

DELAY, GAIN, NOISE = 12.4, 2.0, 0.01
PLANT = cr.delayed_ss(ct.tf([GAIN], [30, 1]), dead_time=DELAY, dt=1.0)
TIME = np.arange(400.0)
STEP = 1.0 * (TIME >= 100)
BINARY = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 40), 10)


def fitted(u, y, **options):
    return cr.identify(cr.Record(TIME, u, y), **options).fit


@cache
def noise():
    return NOISE * np.random.default_rng(3).standard_normal(TIME.size)


@cache
def plain(kind):
    """Fit of a record without spikes."""
    u = {"step": STEP, "any input": BINARY}[kind]
    return fitted(u, np.ravel(PLANT.simulate(u)) + noise(), structures="FOPDT")


@cache
def with_gap(where):
    """Fit of the response to a step without one sample."""
    y = np.ravel(PLANT.simulate(STEP)) + noise()
    y[where] = np.nan
    return cr.identify(cr.Record(TIME, STEP, y, missing="keep"), structures="FOPDT").fit


@pytest.mark.parametrize(
    ("u", "where", "size", "structures"),
    [
        (STEP, [129, 383], -5 * GAIN, [(1, 1), (2, 2)]),
        (STEP, [250, 251, 252], 0.5 * GAIN, "FOPDT"),
        (STEP, [30, 31, 70], 2 * GAIN, "FOPDT"),
        (BINARY, [50, 200, 333], 4 * GAIN, [(1, 1), (2, 2)]),
    ],
    ids=["apart", "three in a row", "at rest", "any input"],
)
def test_spikes_change_a_fit_as_missing_samples_do(u, where, size, structures):
    y = np.ravel(PLANT.simulate(u)) + noise()
    gaps, y = y.copy(), y.copy()
    gaps[where] = np.nan
    y[where] += size
    fit = fitted(u, y, structures=structures)
    told = cr.identify(cr.Record(TIME, u, gaps, missing="keep"), structures=structures).fit
    assert fit.structure == told.structure == (1, 1)
    assert_allclose([fit.dead_time, fit.gain], [told.dead_time, told.gain], rtol=1e-12)
    assert fit.interval == told.interval
    assert fit.interval[0] <= DELAY <= fit.interval[1]
    assert codes(fit) - codes(told) == {"outliers"}
    (said,) = [flag.message for flag in fit.flags if flag.code == "outliers"]
    assert said.startswith(f"{len(where)} sample(s), the first at {where[0]} s were left out")


def test_a_code_for_missing_values_does_not_hide_a_spike():
    y = np.ravel(PLANT.simulate(STEP)) + noise()
    y[[150, 300]], y[250] = -9999.0, 8.0
    fit = fitted(STEP, y)
    assert fit.structure == (1, 1)
    assert fit.interval[0] <= DELAY <= fit.interval[1]
    said = " ".join(flag.message for flag in fit.flags if flag.code == "outliers")
    assert "1 sample(s), the first at 250 s were left out" in said
    assert "2 sample(s), the first at 150 s, are -9999" in said


@pytest.mark.parametrize("where", [30, 109, 150, 399])
@pytest.mark.parametrize("value", [-999.0, -9999.0, 1e6])
def test_a_code_for_missing_values_is_left_out_wherever_it_is(where, value):
    y = np.ravel(PLANT.simulate(STEP)) + noise()
    y[where] = value
    fit, told = fitted(STEP, y, structures="FOPDT"), with_gap(where)
    assert (fit.dead_time, fit.interval, fit.gain) == (told.dead_time, told.interval, told.gain)
    assert codes(fit) - codes(told) == {"outliers"}


@pytest.mark.parametrize(
    ("kind", "where", "value"),
    [
        ("step", 30, 1000.0),
        ("any input", 250, -9999.0),
        ("step", 250, 4.0),
        ("any input", 250, 4.0),
    ],
)
def test_an_error_code_of_the_input_is_none_if_the_output_responds(kind, where, value):
    u = {"step": STEP, "any input": BINARY}[kind]
    pulsed = u.copy()
    pulsed[where] = value
    code = fitted(pulsed, np.ravel(PLANT.simulate(u)) + noise(), structures="FOPDT")
    same = plain(kind)
    assert (code.dead_time, code.interval, code.gain) == (same.dead_time, same.interval, same.gain)
    (said,) = [flag.message for flag in code.flags if flag.code == "outliers"]
    assert said.startswith(f"of the input 1 sample(s), the first at {where} s, are {value:g}")
    pulse = fitted(pulsed, np.ravel(PLANT.simulate(pulsed)) + noise(), structures="FOPDT")
    assert "outliers" not in codes(pulse)
    assert pulse.interval[0] <= DELAY <= pulse.interval[1]
    assert pulse.gain == pytest.approx(GAIN, abs=0.01)


@pytest.mark.parametrize(("heights", "hold"), [((1.0, -1.0), 25), ((1.0, 0.0, 2.0), 15)])
def test_pulses_of_a_test_are_no_error_codes_of_the_input(heights, hold):
    """Their first or last was held: gains of 0.02 and 4.7, a dead time of 120 s."""
    u = np.zeros(600)
    u[60 : 60 + hold * len(heights)] = np.repeat(heights, hold)
    y = np.ravel(PLANT.simulate(u)) + 2 * NOISE * np.random.default_rng(0).standard_normal(600)
    fit = cr.identify(cr.Record(np.arange(600.0), u, y)).fit
    assert "outliers" not in codes(fit)
    assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]
    assert fit.interval[0] <= DELAY <= fit.interval[1]


def test_samples_are_spikes_where_they_are_far_from_the_model_and_from_their_neighbours():
    rng = np.random.default_rng(0)
    fitted = np.where(np.arange(300) < 150, 0.0, 1.0)
    output = fitted + 0.01 * rng.standard_normal(300)
    assert not spikes(output, fitted).any()  # a jump that the model has
    assert not spikes(output, np.roll(fitted, 2)).any()  # one that it has too late
    output[[20, 200, 201]] += 0.8
    assert np.flatnonzero(spikes(output, fitted)).tolist() == [20, 200, 201]
    assert not spikes(output, output).any()  # samples that the model has
    output[40:44] += 0.5  # four in a row may be what the plant did
    assert not spikes(output, fitted)[40:44].any()
    coarse = np.round(-20.0 * np.expm1(-np.maximum(np.arange(300) - 150, 0) / 20))
    steps = coarse.copy()
    steps[[30, 90]] += 1.0  # steps of a converter, from a level that stands else
    assert not spikes(steps, coarse).any()


def test_a_kick_of_the_plant_is_no_spike():
    s = ct.tf("s")
    plant = (2 + 40 * s / (0.3 * s + 1)) / (20 * s + 1)  # rises to three times its gain at once
    y = np.ravel(cr.delayed_ss(plant, dead_time=5.0, dt=1.0).simulate(STEP))
    fit = fitted(STEP, y + 0.001 * np.random.default_rng(1).standard_normal(y.size))
    assert "outliers" not in codes(fit)
    assert fit.interval[0] <= 5.0 <= fit.interval[1]
    assert abs(fit.gain - 2.0) < 0.01
