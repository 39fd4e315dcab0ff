"""Frequency responses from noise and periodic records."""

import pickle
import weakref

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal

import ctrl_realize as cr
from ctrl_realize.errors import DataWarning

DT = 0.01
PLANT = ct.sample_system(ct.tf([400], [1, 8, 400]), DT, "zoh")


def respond(u):
    numerator, denominator = PLANT.num[0][0], PLANT.den[0][0]
    # In powers of 1/z the strictly proper plant has a leading zero.
    return signal.lfilter(np.concatenate([[0.0], numerator]), denominator, u)


def noise_record(n=40_000, *, delay=0, noise=0.0, input_noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(n)
    y = respond(u)
    y = np.concatenate([np.zeros(delay), y[: n - delay]])
    y = y + noise * rng.standard_normal(n)
    return cr.Record(DT * np.arange(n), u + input_noise * rng.standard_normal(n), y)


def exact(frf, delay=0):
    z = np.exp(2j * np.pi * frf.frequency_hz * DT)
    return PLANT(z) * z**-delay


def multisine_record(periods=6, length=500, *, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    lines = np.arange(3, 120, 2)
    t = np.arange(length)
    one = sum(np.cos(2 * np.pi * k * t / length + rng.uniform(0, 6.28)) for k in lines)
    u = np.tile(one, periods)
    y = respond(u)
    y = y + noise * rng.standard_normal(u.size)
    return cr.Record(DT * np.arange(u.size), u, y), lines


def test_welch_estimates_are_scipys():
    record = noise_record(noise=0.3)
    frf = cr.spectral_frf(record, segment=512)
    f, yu = signal.csd(record.input, record.output, 1 / DT, nperseg=512)
    _, uu = signal.welch(record.input, 1 / DT, nperseg=512)
    _, coherence = signal.coherence(record.input, record.output, 1 / DT, nperseg=512)
    assert_allclose(frf.frequency_hz, f[1:-1])
    assert_allclose(frf.complex, (yu / uu)[1:-1], rtol=1e-9)
    assert_allclose(frf.coherence, coherence[1:-1], rtol=1e-9)


def test_errors_scatter_as_the_stated_deviation_says():
    errors, stated = [], []
    for seed in range(12):
        frf = cr.spectral_frf(noise_record(noise=0.7, seed=seed), segment=512).between_hz(4, 12)
        errors.append(frf.complex - exact(frf))
        stated.append(frf.std)
    # 12 x 40 lines, neighbours under a Hann window are correlated: 4 % of scatter.
    ratio = np.sqrt(np.mean(np.abs(errors) ** 2 / np.square(stated)))
    assert ratio == pytest.approx(1.0, abs=0.08)


def test_h1_is_unmoved_by_output_noise_and_h2_by_input_noise():
    out = noise_record(noise=0.7, n=200_000)
    into = noise_record(input_noise=0.7, n=200_000)
    band = {
        (name, method): np.mean(np.abs(f.complex / exact(f)))
        for name, record in (("out", out), ("in", into))
        for method in ("H1", "H2", "Hv")
        for f in [cr.spectral_frf(record, method=method, segment=1024).between_hz(0.5, 2.5)]
    }
    # Gain there is about 1: noise power .49 beside it.
    assert band["out", "H1"] == pytest.approx(1.0, abs=0.01)
    assert band["in", "H2"] == pytest.approx(1.0, abs=0.01)
    assert band["in", "H1"] == pytest.approx(1 / 1.49, rel=0.02)
    assert band["out", "H2"] > 1.3
    assert band["out", "Hv"] ** 2 == pytest.approx(band["out", "H1"] * band["out", "H2"], rel=0.02)


def test_pieces_of_a_long_record_are_not_kept():
    made, most = [], 0

    def pieces():
        nonlocal most
        for seed in range(8):
            piece = noise_record(4000, seed=seed)
            made.append(weakref.ref(piece.output))
            yield piece
            del piece
            most = max(most, sum(one() is not None for one in made))

    frf = cr.spectral_frf(pieces(), segment=500)
    whole = cr.spectral_frf([noise_record(4000, seed=seed) for seed in range(8)], segment=500)
    assert_allclose(frf.complex, whole.complex)
    assert most <= 2  # the first, with which the others are compared, and the present one


def test_known_delay_taken_out_removes_its_bias():
    record = noise_record(delay=100)
    blind = cr.spectral_frf(record, segment=512).between_hz(5, 25)
    aligned = cr.spectral_frf(record, segment=512, delay=100).between_hz(5, 25)
    biased = np.median(np.abs(blind.complex / exact(blind, 100)))
    # Hann windows that overlap by 412 of 512 samples share 0.91 of their product.
    window = signal.get_window("hann", 512)
    shared = window[100:] @ window[:-100] / (window @ window)
    assert biased == pytest.approx(shared, abs=0.02)
    # What is left is leakage of the plant's own decay, 0.25 s in segments of 5 s.
    assert_allclose(aligned.complex, exact(aligned, 100), rtol=0.06)
    assert np.median(aligned.coherence) > 0.99


def test_whole_periods_have_no_leakage():
    record, lines = multisine_record()
    frf = cr.spectral_frf(record, period=500, skip_periods=2)
    assert_allclose(frf.frequency_hz, lines / (500 * DT), rtol=1e-12)
    # The transient is exp(-4 s^-1 * 10 s) = 4e-18 after two periods.
    assert_allclose(frf.complex, exact(frf), rtol=1e-9)
    assert_allclose(frf.coherence, 1, atol=1e-12)


@pytest.mark.parametrize("period", [250, 450, 499, 501, 750])
def test_a_period_that_is_not_that_of_the_input_is_refused(period):
    record, _ = multisine_record(periods=12)
    with pytest.raises(cr.errors.DataError, match=f"does not repeat after {period} samples"):
        cr.spectral_frf(record, period=period)


def test_deviation_of_periodic_estimates_is_that_of_their_scatter():
    errors, stated, inside = [], [], []
    for seed in range(40):
        record, _ = multisine_record(periods=9, noise=1.0, seed=seed)
        frf = cr.spectral_frf(record, period=500)
        errors.append(frf.complex - exact(frf))
        stated.append(frf.std)
        inside.append(np.abs(errors[-1]) <= frf.circle())
    # 40 x 59 lines; variances from 8 periods each: 2 %.
    ratio = np.sqrt(np.mean(np.abs(errors) ** 2) / np.mean(np.square(stated)))
    assert ratio == pytest.approx(1.0, abs=0.07)
    assert frf.repeats == 8
    # 0.45 % of scatter; with eight values taken for many it would be 91.7 %
    assert np.mean(inside) == pytest.approx(0.95, abs=0.014)


def two_by_two(n, *, noise=0.0, seed=0, together=False):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((2, n))
    u[1] = u[0] if together else u[1] + 0.5 * u[0]
    y = np.stack([respond(u[0]) - 0.3 * u[1], 2 * u[0] + respond(u[1])])
    return cr.Record(DT * np.arange(n), u, y + noise * rng.standard_normal((2, n)))


def exact_two_by_two(frf):
    g = PLANT(np.exp(2j * np.pi * frf.frequency_hz * DT))
    one = np.ones_like(g)
    return np.array([[g, -0.3 * one], [2 * one, g]])


def test_deviations_of_several_channels_are_those_of_their_scatter():
    score = []
    for seed in range(8):
        frf = cr.spectral_frf(two_by_two(20_000, noise=1.0, seed=seed), segment=512)
        frf = frf.between_hz(6, 40)
        score.append(np.abs(frf.frdata - exact_two_by_two(frf)) ** 2 / frf.std**2)
    # independent segments, less what the second input takes
    assert frf.repeats == cr.spectral_frf(noise_record(20_000), segment=512).repeats - 1
    # 8 x 174 lines, neighbours correlated: 3 %; leakage adds a little.
    assert np.sqrt(np.mean(score, axis=(0, 3))) == pytest.approx(np.ones((2, 2)), abs=0.1)


def test_an_estimate_from_samples_knows_its_hold_and_every_function_reckons_with_it():
    dt = 0.1
    core = ct.tf([2.0], [0.8, 1])
    plant = cr.delayed_ss(core, dead_time=0.37, dt=dt)
    rng = np.random.default_rng(0)
    u = rng.standard_normal(40_000)
    y = plant.simulate(u) + 0.02 * rng.standard_normal(u.size)
    record = cr.Record(dt * np.arange(u.size), u, y)
    frf = cr.spectral_frf(record, segment=1024, delay=plant.delay)
    assert frf.sample_time == dt
    band = pickle.loads(pickle.dumps(frf.between_hz(0.02, 0.2 / dt)))
    assert band.sample_time == dt
    free = cr.fit_frf(band, 1)
    asked = cr.fit_frf(band, 1, dt=dt, hold="zoh")
    assert free.dt == dt
    assert free.fit.hold_time == dt
    assert free.fit.dead_time == asked.fit.dead_time
    assert "hold" in free.fit.report()
    # a tenth of a sample is what noise and leakage leave; the hold is half of one
    assert abs(free.fit.dead_time - 0.37) < 0.1 * dt
    without = cr.fit_frf(band, 1, hold=None)
    assert without.fit.hold_time is None
    assert without.dt == dt
    assert without.fit.dead_time - 0.37 == pytest.approx(0.5 * dt, abs=0.15 * dt)
    pulses = cr.impulse_from_frf(band, dt, 200).markov
    np.testing.assert_array_equal(pulses, cr.impulse_from_frf(band, dt, 200, hold="zoh").markov)
    # the same plant at two sample times, and half a sample is 9 degrees in the middle of the band
    for system in (plant, cr.delayed_ss(core, dead_time=0.37, dt=0.01)):
        assert abs(cr.compare_frf(system, band).phase_error_deg.mean()) < 1.0


def test_inputs_that_move_together_are_refused():
    with pytest.raises(ValueError, match="independently"):
        cr.spectral_frf(two_by_two(5000, together=True))
    with pytest.raises(ValueError, match="'H1'"):
        cr.spectral_frf(two_by_two(5000), method="H2")
    with pytest.raises(ValueError, match="expected one of each with period"):
        cr.spectral_frf(two_by_two(5000), period=500)


def test_motor_bench_resonates_at_77_hz_and_is_still_at_53():
    frf = cr.spectral_frf(cr.datasets.load("motor_bench").record, period=2500)
    assert frf.frequency_hz.tolist() == pytest.approx(list(range(11, 251)))
    near = frf.between_hz(30, 120)
    assert near.frequency_hz[np.argmax(np.abs(near.complex))] == pytest.approx(77)
    assert near.frequency_hz[np.argmin(np.abs(near.complex))] == pytest.approx(53)
    assert np.all(frf.std < 0.02 * np.abs(frf.complex).max())


def test_a_record_of_a_loop_is_told_and_the_quotient_is_the_plant():
    """Noise that a controller answers pulls the ratio of spectra to -1 / C."""
    rng, n = np.random.default_rng(3), 60_000
    r = np.repeat(rng.choice([-1.0, 1.0], n // 20), 20)
    noise = signal.lfilter([0.3], [1, -0.9], rng.standard_normal(n))
    u, x, y = np.zeros((3, n))
    for k in range(4, n):
        x[k] = 0.9 * x[k - 1] + 0.1 * u[k - 4]
        y[k] = x[k] + noise[k]
        u[k] = 0.8 * (r[k] - y[k])
    t = 1.0 * np.arange(n)
    with pytest.warns(DataWarning, match="has a set point: noise"):
        direct = cr.spectral_frf(cr.Record(t, u, y, reference=r), segment=512)
    to_output = cr.spectral_frf(cr.Record(t, r, y), segment=512)
    quotient = to_output.complex / cr.spectral_frf(cr.Record(t, r, u), segment=512).complex
    z = np.exp(2j * np.pi * direct.frequency_hz)
    band = direct.frequency_hz < 0.02
    plant = (0.1 * z**-4 / (1 - 0.9 / z))[band]
    # ten lines that scatter by 0.1 (three standard errors), and a bias
    assert np.abs(np.mean(quotient[band] / plant - 1)) < 0.1
    assert np.abs(np.mean(direct.complex[band] / plant - 1)) > 0.2
