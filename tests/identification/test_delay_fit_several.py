"""Several records of one plant: mean, scatter, trend, outlying records."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests import rigs

TS = rigs.TS


def record(seed, *, delay=37.0, amplitude=16.0, name="", plant=rigs.R3):
    made = rigs.step_record(
        plant, delay=delay, noise=0.005, seed=seed, amplitude=amplitude, before=400, after=1300
    )
    return cr.Record(made.time, made.input, made.output, name=name or f"no. {seed}")


def codes(fit):
    return {flag.code for flag in fit.flags}


@pytest.fixture(scope="module")
def sixteen():
    return cr.fit_output_error([record(seed) for seed in range(16)]).fit


def test_the_mean_of_sixteen_records_is_four_times_as_exact(sixteen):
    assert sixteen.std_given_structure / TS == pytest.approx(0.46 / 4, rel=0.25)
    assert abs(sixteen.delay - 37) < 4 * 0.46 / 4
    assert sixteen.at_noise_level
    assert sixteen.gain == pytest.approx(1.0, abs=0.002)


def test_records_that_differ_by_noise_alone_are_not_called_different(sixteen):
    repeats = sixteen.repeatability
    assert repeats.p_value > 0.01
    assert not repeats.outlying
    # standard error of a shift with known shape: 0.15 samples per 1 % noise
    assert np.median(repeats.errors) / TS == pytest.approx(0.15 * 0.5, rel=0.3)
    assert not codes(sixteen) & {"records_differ", "amplitude_trend", "outlying_records"}


def test_a_delay_that_grows_with_the_amplitude_is_an_alarm():
    records = [
        record(10 * k + a, delay=36 + a / 8, amplitude=float(a))
        for k in range(4)
        for a in (4, 8, 16)
    ]
    fit = cr.fit_output_error(records).fit
    assert "amplitude_trend" in codes(fit)
    assert fit.repeatability.trend / TS == pytest.approx(1 / 8, rel=0.3)


@pytest.mark.parametrize("count", [4, 6])
def test_a_trend_shows_in_few_records_too(count):
    heights = [16.0] * (count // 2) + [8.0] * (count - count // 2)
    alike = [record(k, delay=37, amplitude=a) for k, a in enumerate(heights)]
    apart = [record(k, delay=37 + 2 * (a == 8), amplitude=a) for k, a in enumerate(heights)]
    assert "amplitude_trend" not in codes(cr.fit_output_error(alike).fit)
    assert "amplitude_trend" in codes(cr.fit_output_error(apart).fit)


def moving(seed: int, *, drifts: bool) -> cr.Record:
    """Two lags behind 0.6 s: a drift of its own, or an earlier step 5 to 9 s before."""
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(-400, 1000)
    before = 0.0 if drifts else rng.uniform(-1, 1)
    u = np.select([t < -rng.uniform(5, 9), t < 0], [0.0, before], 2.0 + before)
    plant = cr.delayed_ss(ct.tf([1.5], [5, 6, 1]), dead_time=0.6, dt=0.05)
    y = plant.simulate(u) + 0.01 * rng.standard_normal(t.size)
    drift = rng.uniform(-0.03, 0.03) * t if drifts else 0.0
    return cr.Record(t, u, y + drift, name=f"no. {seed}").between(-4, 50)


@pytest.mark.parametrize("drifts", [True, False])
def test_records_that_were_not_at_rest_are_fitted_together(drifts):
    fit = cr.fit_output_error([moving(seed, drifts=drifts) for seed in range(6)]).fit
    assert ("drift" if drifts else "not_at_rest") in codes(fit)
    assert "records_differ" not in codes(fit)
    assert fit.interval[0] <= 0.6 <= fit.interval[1] < 1.0
    assert fit.total_delay == pytest.approx(6.6, rel=0.01)


def test_a_record_that_came_twice_is_told():
    records = [record(k) for k in range(3)]
    apart, twice = (cr.fit_output_error([*records, more]).fit for more in (record(3), records[1]))
    assert "same_records" not in codes(apart)
    (told,) = (str(flag) for flag in twice.flags if flag.code == "same_records")
    assert "1 of 4 records are duplicates (no. 4 is no. 2)" in told
