"""What an output does before the step: a free response, or nothing that was fitted. Simulated."""

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from tests.rigs import codes, covers

EDGE, SAMPLES = 300, 900


def lagged(signal, constant):
    pole = np.exp(-1 / constant)
    return lfilter([0, 1 - pole], [1, -pole], signal)


def late(signal):
    """A signal 8 samples later."""
    return np.concatenate([np.zeros(8), signal[:-8]])


def heater(seed):
    """Lags of 60 and 20 samples, still cooling when the step comes; dead time 8 samples."""
    k = np.arange(-2000, SAMPLES)
    u = 1.0 * (k < -40) + (k >= EDGE)
    y = 2 * lagged(lagged(late(u), 60), 20)[-SAMPLES:]
    y += 0.01 * np.random.default_rng(seed).standard_normal(SAMPLES)
    return cr.Record(np.arange(SAMPLES) * 1.0, u[-SAMPLES:], y)


def test_a_free_response_holds_at_every_sample_and_not_at_the_means_alone():
    # Modes faster than the means at rest were free to be anything between them: 4.2e4 here.
    fit = cr.fit_output_error(heater(0), structures=[(4, 3)]).fit
    assert fit.data.relaxing
    assert np.abs(fit.measured - fit.fitted).max() < 6 * 0.01
    assert fit.fit_percent > 98


def test_an_input_that_moves_just_before_the_record_leaves_a_dead_time_that_is_not_free():
    # All samples, as a free response from the first one on, say 6.15 s (5.88 to 6.41).
    t, gain, dead_time, lags = np.arange(300.0), -1.9, 7.03, (20.0, 4.2)

    def moved(at):
        since = np.maximum(t - at - dead_time, 0.0)
        parts = [lag * np.exp(-since / lag) for lag in lags]
        return gain * (1 - (parts[0] - parts[1]) / (lags[0] - lags[1]))

    noise = 0.002 * np.random.default_rng(0).standard_normal(t.size)
    record = cr.Record(t, 11.0 + (t >= 100), moved(-2) + moved(100) + noise)
    fit = cr.identify(record, structures="P2D").fit
    assert "not_at_rest" in codes(fit)
    assert covers(fit, dead_time)
    assert abs(fit.dead_time - dead_time) < 0.05


# The record begins so late after one step that it moves, and so early before another that neither
# a line nor an exponential through its rest goes on as it does. Not one of these dead times was
# within its interval: none was sought after the moment at which the output left that line.
@pytest.mark.parametrize(("seed", "more"), [(14, 0), (84, 2)])
def test_a_short_rest_in_motion_does_not_say_when_the_response_begins(seed, more):
    rng = np.random.default_rng(seed)
    dead_time, lag = rng.uniform(8.0, 24.0), rng.uniform(15.0, 40.0)
    rest = int(rng.integers(10, 30))
    t, at = np.arange(400.0), [-40, rest, *rng.integers(rest + 40, 380, more)]
    heights = rng.choice([-1.0, 1.0], 2 + more) * rng.uniform(0.5, 1.5, 2 + more)
    edges = list(zip(at, heights, strict=True))
    u = sum(high * (t >= start) for start, high in edges)
    y = sum(
        -2 * high * np.expm1(-np.maximum(t - start - dead_time, 0) / lag) for start, high in edges
    )
    fit = cr.identify(cr.Record(t, u, y + rng.normal(0, 0.01 * np.std(y), t.size))).fit
    assert "not_at_rest" in codes(fit)
    assert covers(fit, dead_time)
    assert fit.gain == pytest.approx(2.0, rel=0.02)  # beside noise of 1 %


def test_an_earlier_step_that_is_nearly_over_does_not_count_for_the_gain():
    # In 13 samples at rest it does not show, and the gain was 2.12 to 2.14, "good".
    t = np.arange(400.0)

    def moved(at):
        return -2 * np.expm1(-np.maximum(t - at - 20.0, 0) / 40)

    noise = np.random.default_rng(5).normal(0, 0.02, t.size)
    fit = cr.identify(cr.Record(t, t >= 13, 0.9 * moved(-112) + moved(13) + noise)).fit
    assert "not_at_rest" in codes(fit)
    assert covers(fit, 20.0)
    assert fit.gain_interval[0] <= 2.0 <= fit.gain_interval[1]


def test_an_arm_that_still_swings_is_fitted_with_its_free_response():
    dt, frequency = 0.01, 9.0
    plant = ct.tf([2 * frequency**2], [1, 0.04 * frequency, frequency**2])
    k = np.arange(-400, SAMPLES)
    u = 0.5 * (k >= -150) + 0.5 * (k >= EDGE)
    y = ct.forced_response(ct.c2d(plant, dt), dt * (k + 400), late(u)).outputs[-SAMPLES:]
    y = y + 0.002 * np.random.default_rng(0).standard_normal(SAMPLES)
    record = cr.Record(dt * np.arange(SAMPLES), u[-SAMPLES:], y)
    fit = cr.identify(record, structures=[(1, 1), (2, 2), (2, 1), (3, 3)]).fit
    assert "not_at_rest" in codes(fit)
    assert not codes(fit) & {"hum", "cancelled_pair"}
    assert fit.structure == (2, 2)
    assert covers(fit, 8.0)
    assert abs(fit.delay - 8.0) < 0.5
    assert abs(fit.gain - 2.0) < 0.002
    assert fit.residual == pytest.approx(0.002, rel=0.1)
    # what the model says from rest, and why it says less than the fit
    assert fit.simulated_percent < fit.fit_percent - 1
    assert "simulated from rest" in fit.report()


def test_a_drift_is_told_where_it_was_fitted_and_nowhere_else():
    k = np.arange(SAMPLES)
    y = 0.002 * k + 2 * lagged(late(1.0 * (k >= EDGE)), 20)
    y += 0.01 * np.random.default_rng(1).standard_normal(SAMPLES)
    record = cr.Record(k * 1.0, 1.0 * (k >= EDGE), y)
    fit = cr.identify(record, structures=[(1, 1)]).fit
    assert "drift" in codes(fit)
    assert abs(fit.data.drift - 0.002) < 2e-4
    assert fit.fit_percent > fit.simulated_percent + 1
    assert "simulated from rest" in fit.report()
