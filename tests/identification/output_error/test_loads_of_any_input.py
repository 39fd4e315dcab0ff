"""Loads that move the output of a plant in open loop, whatever its input is (simulated)."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr

GAIN, LAGS, DEAD_TIME, SAMPLES = -2.5, (30.0, 18.0), 9.0, 800
TIME = np.arange(float(SAMPLES))


def lagged(signal, *constants):
    for constant in constants:
        pole = np.exp(-1 / constant)
        signal = np.append(0.0, lfilter([1 - pole], [1, -pole], signal)[:-1])
    return signal


def binary(seed):
    levels = np.random.default_rng(seed).choice([-1.0, 1.0], SAMPLES // 20)
    return np.where(TIME < 30, 0.0, levels.repeat(20))


def record(u, load=0.0, *, noise=0.01, pole=0.0, seed=0):
    """Two lags behind an input and a load, with AR(1) noise in parts of the range."""
    delayed = np.append(np.full(int(DEAD_TIME), u[0]), u)[:SAMPLES]
    y = GAIN * lagged(delayed - u[0] + load, *LAGS)
    white = np.random.default_rng(seed).standard_normal(SAMPLES + 100)
    coloured = lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[100:]
    return cr.Record(TIME, u, y + noise * np.ptp(y) * coloured)


def told(fit):
    return [str(flag) for flag in fit.flags if flag.code == "load_disturbance"]


def loaded(*moves):
    return np.sum([np.where(at > TIME, 0.0, size) for at, size in moves], axis=0)


@cache
def identified(*moves, structures=None):
    return cr.identify(record(binary(4), loaded(*moves), seed=4), structures=structures)


# Two lags that are sampled one after the other are half a sample later, for which a zero stands.
@pytest.mark.parametrize(
    ("moves", "structures"), [([(400, 0.5)], (2, 1)), ([(250, 0.5), (550, -0.5)], None)]
)
def test_a_load_is_told_and_taken_out_of_the_gain(moves, structures):
    # a motion of the plant took their place: -2.25 and -2.45, known to 19 and 43 %
    fit = identified(*moves, structures=structures).fit
    assert fit.gain == pytest.approx(GAIN, rel=0.02)  # half the width of the interval is 0.007
    assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    (words,) = told(fit)
    for at, _ in moves:  # seen to a sixth of the faster lag
        assert any(f" {at + late} s" in words for late in range(-3, 4))


def test_what_a_simulation_follows_is_without_the_load():
    data = record(binary(4), loaded((400, 0.5)), seed=4)
    system = identified((400, 0.5), structures=(2, 1))
    y, simulated = np.ravel(data.output), system.simulate(np.ravel(data.input))
    used = slice(-system.fit.time.size, None)  # the first samples may not be
    alone = 100 * (1 - np.std((y - simulated)[used]) / np.std(y[used]))
    assert system.fit.simulated_percent == pytest.approx(alone, abs=1e-6)  # the same sum
    assert system.fit.fit_percent > alone + 20
    assert "without loads" in system.fit.report()


def test_a_load_beside_samples_that_are_missing_is_told():
    whole = record(binary(1), loaded((400, 0.5)), seed=1)
    y = np.ravel(whole.output).copy()
    y[300:303] = np.nan
    data = cr.Record(TIME, np.ravel(whole.input), y, missing="keep")
    fit = cr.identify(data, structures="P2D").fit
    assert told(fit)
    assert fit.gain == pytest.approx(GAIN, rel=0.01)  # half the width of the interval is 0.003


def test_a_load_in_one_of_two_records_is_taken_out_of_both():
    records = [record(binary(2), seed=2), record(binary(3), loaded((400, 0.5)), seed=3)]
    fit = cr.identify(records, structures="P2D").fit
    assert len(told(fit)) == 1
    assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]
    assert fit.gain == pytest.approx(GAIN, rel=0.01)  # half the width of the interval is 0.002


def test_slow_noise_is_no_load():
    fit = cr.identify(record(binary(5), noise=0.02, pole=0.95, seed=5)).fit
    assert not told(fit)
