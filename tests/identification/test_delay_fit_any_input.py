"""Output-error fits of records whose input is no step."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from tests.rigs import R1, R3, lag, pair

DT = 0.01
DELAY = 12.4


def cut_from_operation(kind, plant, seed, n=1200, skip=300):
    """A record that starts while the plant is moving; 5 % noise."""
    rng = np.random.default_rng(seed)
    k = np.arange(n + skip)
    if kind == "prbs":
        u = np.repeat(rng.choice([-1.0, 1.0], k.size // 10 + 1), 10)[: k.size]
    else:
        u = np.sin(2 * np.pi * np.cumsum(np.geomspace(0.1, 8, k.size)) * DT)
    y = cr.delayed_ss(plant, dead_time=DELAY * DT, dt=DT).simulate(u)
    y = y + 0.05 * y.std() * rng.standard_normal(k.size)
    return cr.Record(k[skip:] * DT, 4 + u[skip:], 3 + y[skip:], name=kind)


@pytest.mark.parametrize(("kind", "plant"), [("prbs", R1), ("prbs", R3), ("chirp", R3)])
def test_the_dead_time_is_found_from_operation_with_unknown_start(kind, plant):
    fit = cr.fit_output_error(cut_from_operation(kind, plant, seed=1)).fit
    error = fit.dead_time / DT - DELAY
    assert abs(error) < 4 * fit.std_given_structure / DT
    assert fit.std_given_structure / DT < 0.2
    assert fit.interval[0] <= DELAY * DT <= fit.interval[1]
    assert fit.structure == ((1, 1) if plant is R1 else (3, 3))


def test_an_input_that_never_holds_is_no_step(shared_data):
    # the first half of this record has moves that pass for one edge
    table = np.loadtxt(shared_data / "exchanger" / "record.csv", delimiter=",", skiprows=1)
    whole = cr.Record(*table.T)
    first, second = whole.between(0, 2000), whole.between(2001, 4000)
    model = cr.fit_output_error(first)
    assert np.isnan(model.fit.onset)
    assert model.fit.dead_time <= 1.0  # s, one sample: the delay is 0
    assert cr.validation.analyse_residuals(model, second).fit_percent[0] > 35


@pytest.mark.parametrize(("plant", "structure"), [(pair(1.5, 0.05), (2, 2)), (lag(0.05), (1, 1))])
def test_what_was_before_the_record_may_ring_or_creep_through_all_of_it(plant, structure):
    # decay times of 2.1 s and 3.2 s, in a record of 12 s that starts in the middle of motion
    fit = cr.fit_output_error(cut_from_operation("prbs", plant, seed=2)).fit
    assert fit.structure == structure
    assert abs(fit.dead_time / DT - DELAY) < 4 * fit.std_given_structure / DT
    assert fit.std_given_structure / DT < 0.06
    assert fit.measured.shape == fit.fitted.shape == fit.time.shape


def test_an_output_that_does_not_follow_the_input_gets_no_answer():
    good = cut_from_operation("prbs", R1, seed=0, n=600)
    for seed in range(3):
        y = np.random.default_rng(seed).standard_normal(600)
        with pytest.raises(DataError, match="does not follow the input"):
            cr.fit_output_error(cr.Record(good.time, good.input, y))


def bound(plant, u, noise):
    """Cramer-Rao bound of the dead time, in s, with gain, poles and level unknown."""

    def response(delay, scale):
        slower = ct.ss(plant)
        slower = ct.ss(slower.A / scale, slower.B / scale, slower.C, slower.D)
        return cr.delayed_ss(slower, dead_time=delay, dt=DT).simulate(u)

    h, tau = 1e-3, DELAY * DT
    columns = [
        (response(tau + h * DT, 1.0) - response(tau - h * DT, 1.0)) / (2 * h * DT),
        (response(tau, 1 + h) - response(tau, 1 - h)) / (2 * h),
        response(tau, 1.0),
        np.ones(u.size),
    ]
    J = np.stack(columns, axis=1)[300:]
    return noise * float(np.sqrt(np.linalg.inv(J.T @ J)[0, 0]))


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_all_samples_of_a_long_record_count(colour):
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-1.0, 1.0], 3000), 10)
    clean = cr.delayed_ss(R1, dead_time=DELAY * DT, dt=DT).simulate(u)
    noise = 0.05 * float(np.std(clean))
    y = clean + lfilter([1.0], [1.0, -colour], noise * rng.standard_normal(u.size))
    fit = cr.fit_output_error(cr.Record(DT * np.arange(u.size), u, y), structures=[(1, 1)]).fit
    # coloured noise leaves no more than white noise of its innovations would, filtered alike
    white = lfilter([1.0, -colour], [1.0], u)
    limit = bound(R1, white, noise)
    assert fit.std_given_structure == pytest.approx(limit, rel=0.1)
    assert abs(fit.dead_time - DELAY * DT) < 3.5 * limit
    assert "cut" not in [flag.code for flag in fit.flags]
    assert any("condensed" in choice for choice in fit.choices)
    # what is shown is a stretch
    assert fit.time.size < 4000
    assert np.std(fit.measured - fit.fitted) < 1.1 * noise / np.sqrt(1 - colour**2)


def test_a_long_record_of_a_slow_plant_is_cut_and_says_so():
    slow = lag(0.02)  # responses of 5000 samples
    u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 100), 60)
    y = cr.delayed_ss(slow, dead_time=DELAY * DT, dt=DT).simulate(u)
    y += 0.01 * np.random.default_rng(1).standard_normal(u.size)
    fit = cr.fit_output_error(cr.Record(DT * np.arange(u.size), u, y), structures=[(1, 1)]).fit
    assert fit.time.size < 4000
    assert "cut" in [flag.code for flag in fit.flags]


@pytest.mark.parametrize("seed", range(3))
def test_a_long_dead_time_is_found_under_an_input_that_moves_at_every_sample(seed):
    # A lag of ten samples behind 150: the valley is as narrow as the lag.
    rng = np.random.default_rng(seed)
    plant = cr.DelayedStateSpace(ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], DT), 150)
    u = rng.choice([-1.0, 1.0], 1000)
    y = plant.simulate(u) + 0.05 * rng.standard_normal(1000)
    fit = cr.fit_output_error(cr.Record(DT * np.arange(1000), u, y)).fit
    assert fit.structure == (1, 1)
    assert abs(fit.delay - 150) < 0.5
    assert fit.delay_interval[0] <= 150 <= fit.delay_interval[1]


def random_binary(poles, noise, disturbance=0.0, seed=0):
    """Lags behind 0.8 s under a random binary input; per cent of noise, and a slow sine."""
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(2000)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 20)
    plant = ct.tf([float(np.prod(poles))], np.poly(-np.asarray(poles)))
    y = cr.delayed_ss(plant, dead_time=0.8, dt=0.05).simulate(u)
    y = y + noise * rng.standard_normal(t.size) + disturbance * np.sin(2 * np.pi * t / 60)
    return cr.Record(t, u, y)


@pytest.mark.parametrize("noise", [0.005, 0.03])
def test_many_lags_are_no_dead_time_under_any_input(noise):
    five = cr.fit_output_error(random_binary([1, 1.5, 2, 3, 5], noise)).fit
    assert five.interval[0] <= 0.8 <= five.interval[1]
    # three poles with two zeros, the best of the smaller models, say 1.15 s
    assert abs(five.dead_time - 0.8) < 0.2
    eight = cr.fit_output_error(random_binary([3.0] * 8, noise)).fit
    assert eight.interval[0] <= 0.8 <= eight.interval[1]
    assert abs(eight.dead_time - 0.8) < 0.05
    assert eight.order == 8
    assert eight.at_noise_level


@pytest.mark.parametrize("seed", [0, 1])
def test_a_slow_disturbance_does_not_move_the_dead_time(seed):
    # a fifth of the response, over a period of 60 s: the fit was half a second late
    fit = cr.fit_output_error(random_binary([0.5, 1.25], 0.02, disturbance=0.2, seed=seed)).fit
    assert fit.interval[0] <= 0.8 <= fit.interval[1]
    assert abs(fit.dead_time - 0.8) < 0.1


@pytest.mark.parametrize("rest", [4500, 20000])
def test_an_input_that_rests_for_longer_than_is_fitted_is_fitted_where_it_moves(rest):
    rng = np.random.default_rng(0)
    u = np.concatenate([np.zeros(rest), np.repeat(rng.choice([-1.0, 1.0], 250), 10)])
    y = cr.delayed_ss(R1, dead_time=DELAY * DT, dt=DT).simulate(u)
    y += 0.02 * np.ptp(y) * rng.standard_normal(y.size)
    fit = cr.fit_output_error(cr.Record(DT * np.arange(u.size), 4 + u, y), structures=[(1, 1)]).fit
    assert abs(fit.dead_time / DT - DELAY) < 4 * fit.std_given_structure / DT
    # what is shown lies where the input moves
    assert fit.time[-1] > DT * rest
