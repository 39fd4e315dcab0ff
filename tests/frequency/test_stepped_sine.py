"""Frequency response from stepped sines."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

import ctrl_realize as cr


def sine_record(f, response, *, n=400, dt=0.01, noise=0.0, rng=None, offset=0.3):
    t = dt * np.arange(n)
    u = 2 * np.sin(2 * np.pi * f * t) + offset
    y = (response * -2j * np.exp(2j * np.pi * f * t)).real - offset
    if noise:
        y = y + noise * rng.standard_normal(n)
    return cr.Record(t, u, y)


def test_clean_sines_give_the_exact_response_at_the_measured_frequencies():
    f = np.array([0.61, 3.3, 7.77, 20.0])
    H = np.array([1.0, 0.5 - 0.5j, -0.1j, -0.01 + 0.002j])
    frf = cr.stepped_sine_frf([sine_record(*pair) for pair in zip(f, H, strict=True)])
    assert_allclose(frf.frequency_hz, f, rtol=1e-9)
    assert_allclose(frf.complex, H, rtol=1e-8)
    assert_allclose(frf.coherence, 1, atol=1e-12)


def test_simulated_valve_is_measured_within_its_stated_deviation(valve_frf):
    valve, frf = cr.bench.valve(), valve_frf
    error = np.abs(frf.complex - valve.truth.frf(frf.frequency_hz).complex)
    # Mean of chi-square/2 over 120 points, std from 5 repeats each: 1 +- 0.13; three of them.
    assert np.sum(error**2) / np.sum(frf.std**2) == pytest.approx(1.0, abs=0.4)
    assert np.median(error / frf.std) < 1.2
    assert np.max(error / frf.std) < 6  # five repeats: heavy tails of a complex t


def test_valve_is_trusted_to_13_hz_as_in_the_paper():
    frf = cr.stepped_sine_frf(cr.bench.valve().stepped_sine(1, points=250, repeats=3))
    assert frf.frequency_hz.size == 250
    trusted = frf.trusted(0.95).frequency_hz
    # Our noise is chosen so; the paper says that coherence starts to drop at 13 Hz.
    assert 12.5 < np.percentile(trusted, 99) < 14.5


def test_std_of_single_records_agrees_with_the_scatter_of_many():
    rng = np.random.default_rng(2)
    records = [sine_record(3.3, 0.5, noise=0.1, rng=rng) for _ in range(300)]
    single = [cr.stepped_sine_frf([record]) for record in records[:40]]
    many = cr.stepped_sine_frf([records])
    scatter = many.std[0] * np.sqrt(300)
    # sigma sqrt(4 / N) / amplitude of u, by hand
    assert scatter == pytest.approx(0.1 * np.sqrt(4 / 400) / 2, rel=0.12)
    assert np.mean([frf.std[0] for frf in single]) == pytest.approx(scatter, rel=0.1)


@pytest.mark.parametrize("hz", [0.6, 4.0, 20.0])
def test_std_of_single_records_counts_slow_noise_where_it_is_strong(hz):
    rng = np.random.default_rng(6)
    truth = 0.5 - 0.2j
    inside, size = 0, []
    for _ in range(60):
        record = sine_record(hz, truth)
        slow = lfilter([0.02], [1, -0.9], rng.standard_normal(600))[200:]
        noisy = cr.Record(record.time, record.input, np.ravel(record.output) + slow)
        frf = cr.stepped_sine_frf([noisy], settle=0.0)
        inside += abs(frf.complex[0] - truth) <= frf.circle()[0]
        size.append(frf.std[0])
    # 95 % of 60 are 57; taken for white they would be 7 at 0.6 Hz
    assert inside >= 52
    # by hand: sigma sqrt(4 / N) / amplitude of u, with the noise at this frequency
    gain = 0.02 / abs(1 - 0.9 * np.exp(-2j * np.pi * hz * 0.01))
    overall = 0.02 / np.sqrt(1 - 0.9**2)
    expected = np.sqrt(4 / 400) / 2 * max(gain, overall)
    assert np.median(size) == pytest.approx(expected, rel=0.3)


def test_coherence_falls_when_repeats_disagree():
    repeats = [sine_record(3.3, np.exp(1j * angle)) for angle in (0.0, 1.0, -1.0)]
    frf = cr.stepped_sine_frf([repeats])
    assert frf.coherence[0] == pytest.approx((1 + 2 * np.cos(1.0)) ** 2 / 9, rel=1e-9)


def test_given_frequencies_start_the_fit_or_are_kept():
    records = [sine_record(3.3, 0.5)]
    free = cr.stepped_sine_frf(records, frequency_hz=[3.25])
    kept = cr.stepped_sine_frf(records, frequency_hz=[3.25], free_frequency=False)
    assert free.frequency_hz[0] == pytest.approx(3.3, rel=1e-9)
    assert kept.frequency_hz[0] == pytest.approx(3.25, rel=1e-12)


def test_drift_is_taken_out_on_request():
    record = sine_record(0.9, 0.5)
    drifting = cr.Record(record.time, record.input, record.output + 0.7 * record.time)
    frf = cr.stepped_sine_frf([drifting], drift=True)
    assert frf.complex[0] == pytest.approx(0.5, rel=1e-8)


def test_an_output_without_a_signal_is_refused():
    t = 0.01 * np.arange(400)
    with pytest.raises(cr.errors.DataError, match=r"output of .* is constant"):
        cr.stepped_sine_frf([cr.Record(t, np.sin(6 * t), 0 * t)])
