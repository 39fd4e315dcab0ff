"""Step records in coloured noise, which the samples before the step show. Simulated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from tests import rigs

BEFORE, N = 600, 1600


def ringing(rng):
    """Noise like the ripple of a motor: period of 70 samples, unit variance."""
    radius, angle = 0.97, 2 * np.pi / 70
    noise = lfilter(
        [1.0], [1, -2 * radius * np.cos(angle), radius**2], rng.standard_normal(N + 3000)
    )
    return noise[3000:] / noise.std()


def slow(rng):
    """AR(1) noise with a pole at 0.9, unit variance."""
    return lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], rng.standard_normal(N + 200))[200:]


def record(seed, colour, noise, plant=rigs.R1):
    rng = np.random.default_rng([seed, 7])
    delay = float(rng.uniform(30, 45))
    k = np.arange(N)
    y = rigs.exact_step(plant, (k - BEFORE - delay) * rigs.TS) + noise * colour(rng)
    return cr.Record(k * rigs.TS, 1.0 * (k >= BEFORE), y), delay


def errors(colour, noise, way, seeds=4):
    found = []
    for seed in range(seeds):
        data, delay = record(seed, colour, noise)
        found.append(cr.fit_output_error(data, noise=way).fit.delay - delay)
    return np.sqrt(np.mean(np.square(found)))


def test_ripple_hardly_touches_the_delay():
    weighed = errors(ringing, 0.005, "auto")
    # The bound of generalised least squares is 0.012 samples.
    assert weighed < 0.06
    assert errors(ringing, 0.005, "white") > 5 * weighed


def test_slow_noise_leaves_a_narrower_interval_that_holds():
    narrower = 0
    for seed in range(5):
        data, delay = record(seed, slow, 0.005)
        fit = cr.fit_output_error(data).fit
        low, high = fit.delay_interval
        assert low <= delay <= high
        first, last = cr.fit_output_error(data, noise="white").fit.delay_interval
        narrower += high - low < last - first
    assert narrower >= 4


def test_white_noise_is_fitted_as_before_to_the_last_digit():
    data, _ = record(0, lambda rng: rng.standard_normal(N), 0.005)
    found, plain = (cr.fit_output_error(data, noise=way).fit for way in ("auto", "white"))
    assert found.dead_time == plain.dead_time
    assert found.interval == plain.interval


def test_colour_that_only_the_response_has_is_a_misfit():
    # White at rest; a ringing that no model of the toolbox has is left in the response.
    data, _ = record(2, lambda rng: rng.standard_normal(N), 0.005)
    after = np.arange(N) >= BEFORE
    bent = data.output + 0.02 * after * ringing(np.random.default_rng(5))
    fit = cr.fit_output_error(cr.Record(data.time, data.input, bent)).fit
    assert "generalised" not in fit.report()


def test_records_fitted_together_know_the_noise_of_their_mean():
    rng = np.random.default_rng(11)
    k = np.arange(N)
    step = rigs.exact_step(rigs.R1, (k - BEFORE - 36.4) * rigs.TS)
    several = [
        cr.Record(k * rigs.TS, 1.0 * (k >= BEFORE), step + 0.005 * ringing(rng)) for _ in range(4)
    ]
    fit = cr.fit_output_error(several).fit
    assert "generalised" in fit.report()
    assert fit.delay == pytest.approx(36.4, abs=0.1)
    low, high = fit.delay_interval
    assert low <= 36.4 <= high


def test_the_ripple_of_a_measured_motor_leaves_its_delay_narrow(shared_data):
    data = cr.read_record(shared_data / "dc_motor_tacho" / "up.csv")
    fit = cr.identify(data).fit
    low, high = fit.interval
    assert fit.at_noise_level
    assert 31 <= fit.delay <= 42
    assert high - low <= 0.3 * fit.onset
    first, last = cr.identify(data, noise="white").fit.interval
    assert last - first > 2 * (high - low)


def test_a_rest_that_is_silent_but_for_bursts_tells_no_colour():
    rng = np.random.default_rng(1)
    k = np.arange(1400)
    y = np.where(k > 543, -np.expm1(-(k - 543) / 60), 0)
    for burst in rng.integers(0, 1390, 25):
        y[burst : burst + 6] += 0.05 * rng.standard_normal()
    fit = cr.fit_output_error(cr.Record(0.1 * k, 1.0 * (k >= 500), y)).fit
    assert "generalised" not in fit.report()
    low, high = fit.delay_interval
    assert low <= 43 <= high
