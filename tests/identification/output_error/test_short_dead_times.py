"""Dead times of a few samples, where noise at rest, rounding or friction decide on the estimate."""

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from tests import rigs
from tests.rigs import codes


def response(lags, delay, n=700, edge=150):
    """Input and clean output of a step through lags, sampled with 1 s."""
    plant = ct.tf([1.0], [1.0])
    for lag in lags:
        plant = plant * ct.tf([1.0], [lag, 1.0])
    u = np.where(np.arange(n) < edge, 0.0, 1.0)
    return u, np.asarray(cr.delayed_ss(plant, dead_time=delay, dt=1.0).simulate(u))


def fitted(u, y, **options):
    return cr.fit_output_error(cr.Record(np.arange(u.size, dtype=float), u, y), **options).fit


FEW = [(1, 1), (2, 2), (2, 1)]


def test_a_padded_rest_is_no_rest_without_noise():
    u, y = response((20.0, 8.0), 5.3)
    y += 0.01 * np.random.default_rng(0).standard_normal(y.size)
    y[:150] = 0.0
    fit = fitted(u, y, structures=FEW)
    assert "structured_misfit" not in codes(fit)
    assert fit.at_noise_level
    assert fit.residual == pytest.approx(0.01, rel=0.1)
    assert fit.interval[0] <= 5.3 <= fit.interval[1]


def test_a_slope_of_slow_noise_before_the_step_does_not_change_the_gain():
    # Taken for a free response or a drift that goes on, it changes the gain by 2 %.
    rng = np.random.default_rng([22, 7])
    u, y = response((40.0, 12.0), 8.3, n=400, edge=100)
    slow = lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], rng.standard_normal(900))[500:]
    y = y + 0.02 * slow + 0.002 * rng.standard_normal(400)
    fit = fitted(u, y, structures=FEW)
    assert fit.gain == pytest.approx(1.0, abs=0.012)
    assert fit.interval[0] <= 8.3 <= fit.interval[1]


def test_rounding_is_not_taken_for_dispersion():
    # Where each level begins is all that is known; the beginning is between two of them.
    delay = 2.3
    rng = np.random.default_rng([1, int(delay * 10), 3])
    u, y = response((20.0, 8.0), delay)
    level = rng.uniform(-0.5, 0.5)
    y = np.round((y + level + 0.004 * rng.standard_normal(y.size)) / 0.02) * 0.02
    fit = fitted(u, y)
    assert {"coarse_quantisation", "no_delay_resolved"} <= set(codes(fit))
    assert "dispersed_flow" not in codes(fit)
    assert abs(fit.dead_time - delay) < 0.5
    assert fit.interval[0] <= delay <= fit.interval[1]


def test_a_likelihood_that_is_flat_down_to_nothing_gives_way_to_the_first_motion():
    samples = 1.5
    u, y = rigs.drive_with_friction(np.random.default_rng(15), samples, 0.4, 0.03)
    fit = fitted(u, y)
    assert fit.at_noise_level
    assert len(fit.delay_estimates) == 6
    five = sorted(list(fit.delay_estimates.values())[:5])
    assert fit.dead_time == pytest.approx(five[2])
    assert abs(fit.delay - samples) < 0.8
    # What the likelihood cannot rule out stays in the interval.
    assert fit.interval[0] == 0
    assert fit.delay_interval[1] > samples + 0.5
    assert any("agree on a later one" in choice for choice in fit.choices)
    assert "no_delay_resolved" in codes(fit)


def test_a_resonance_is_seen_through_slow_noise_and_a_coarse_encoder():
    # Rounding is alike in neighbouring samples, and so is slow noise: counted twice, there would
    # be too few independent samples to tell a resonance of 10 %.
    rng, slow, step = np.random.default_rng(0), 0.02, 0.05
    k = np.arange(1180)
    after = np.clip(k - 202.5, 0, None)
    ringing = np.exp(-after / 500) * np.sin(2 * np.pi * after / 280) * -np.expm1(-after / 60)
    clean = -np.expm1(-after / 25) + 0.1 * ringing
    noise = slow * lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], rng.standard_normal(k.size))
    noise += 0.4 * step * rng.standard_normal(k.size)
    u = np.where(k >= 200, 1.0, 0.0)
    record = cr.Record(1e-3 * k, u, np.round((clean + noise) / step) * step)
    system = cr.identify(record)
    error = system.simulate(u) - clean
    assert np.std(error) < 0.04 * np.std(clean)
    assert abs(system.fit.delay - 2.5) < 0.5
    assert system.fit.delay_interval[0] <= 2.5 <= system.fit.delay_interval[1]


def test_a_baseline_that_rises_and_falls_is_a_free_response():
    # Of a pulse that ends with the start of the record, and is not in it.
    def clean(t):
        t = np.maximum(t, 0.0)
        return 1 - (100 * np.exp(-t / 100) - 12 * np.exp(-t / 12)) / 88

    k = np.arange(-50, 110)
    y = clean(2.0 * k - 3) + clean(2.0 * k + 106) - clean(2.0 * k + 100)
    y += 5e-4 * np.random.default_rng(0).standard_normal(k.size)
    assert np.ptp(y[:50]) > 20 * 5e-4
    fit = cr.fit_output_error(cr.Record(2.0 * k, (k >= 0).astype(float), y), structures=FEW).fit
    assert "not_at_rest" in codes(fit)
    assert fit.interval[0] <= 3.0 <= fit.interval[1]
    assert fit.gain == pytest.approx(1.0, rel=0.01)
    assert fit.residual == pytest.approx(5e-4, rel=0.1)
    assert fit.noise == pytest.approx(5e-4, rel=0.2)


def late(samples: float, *, radiated: float = 0.0) -> cr.Record:
    """A lag of 8 samples whose input is stored some samples late; a switch may radiate."""
    k = np.arange(-60, 140)
    y = -np.expm1(-np.maximum(k + samples, 0) / 8)
    y[k == 0] += radiated
    noise = 0.01 * np.random.default_rng(0).standard_normal(k.size)
    return cr.Record(0.02 * k, (k >= 0).astype(float), y + noise)


def test_an_output_that_moves_with_the_sample_of_its_input_is_reported():
    for samples in (1, 2):
        fit = cr.fit_output_error(late(samples), structures=[(1, 1)]).fit
        said = next(str(flag) for flag in fit.flags if flag.code == "noncausal")
        assert f"leads the input by {samples} sample" in said
    # What is gone in the next sample is no response.
    for causal in (late(0), late(-5, radiated=0.4)):
        assert "noncausal" not in codes(cr.fit_output_error(causal, structures=[(1, 1)]))
