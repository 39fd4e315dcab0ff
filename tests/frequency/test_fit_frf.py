"""Transfer function with dead time from a frequency response."""

import re
from functools import cache

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import invgauss

import ctrl_realize as cr
from ctrl_realize.numerics.rational.spectra import hold_response

F = np.geomspace(0.1, 30, 80)
S = 2j * np.pi * F


def second_order(s, tau=0.04):
    """Gain 2, poles at 2 and 5 Hz, relative degree 2."""
    return 2 * np.exp(-s * tau) / (s / (4 * np.pi) + 1) / (s / (10 * np.pi) + 1)


def measured(exact, f, std, seed):
    """Points with errors in proportion to the response, which are known."""
    noise = std / np.sqrt(2) * np.random.default_rng(seed).standard_normal((f.size, 2)) @ [1, 1j]
    return cr.MeasuredFRF(exact * (1 + noise), f, std=std * np.abs(exact))


def noisy(seed, *, f=F, level=0.01, plant=second_order):
    rng = np.random.default_rng(seed)
    exact = plant(2j * np.pi * f)
    std = np.full(f.size, level)
    noise = std * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)) / np.sqrt(2)
    return cr.MeasuredFRF(exact + noise, f, std=std)


@settings(max_examples=4)
@given(
    tau=st.floats(0, 0.5),
    gain=st.floats(0.01, 100),
    slow=st.floats(0.3, 3),
    pair=st.floats(4, 12),
    damping=st.floats(0.1, 0.95),
)
def test_exact_data_give_the_exact_model_without_a_guess(tau, gain, slow, pair, damping):
    w = 2 * np.pi * pair
    response = gain * np.exp(-S * tau) / (S / (2 * np.pi * slow) + 1)
    response = response * w**2 / (S**2 + 2 * damping * w * S + w**2)
    fit = cr.fit_frf(cr.MeasuredFRF(response, F), 3, relative_degree=3, dt=1e-3).fit
    # Rounding (1e-16) over curvature: three superfluous digits are lost at low damping.
    assert fit.dead_time == pytest.approx(tau, abs=1e-7)
    assert fit.gain == pytest.approx(gain, rel=1e-6)
    assert fit.weighted_rms < 1e-7


def test_model_is_the_continuous_fit_behind_a_hold_with_its_fractional_delay():
    model = cr.fit_frf(noisy(0), 2, dt=1 / 1280)
    assert isinstance(model, cr.DelayedStateSpace)
    omega = 2 * np.pi * np.array([0.3, 2.0, 13.0])
    expected = model.fit.response(omega) * hold_response(omega, 1 / 1280)
    # Aliases of a plant of relative degree 2 at 13 Hz of 1280: (13/1280)^2.
    assert_allclose(model(np.exp(1j * omega / 1280)), expected, rtol=3e-4)
    assert model.dead_time == pytest.approx(model.fit.dead_time, abs=1 / 1280)
    omega = np.array([1.0, 5.0])
    by_hand = model.fit.core(1j * omega) * np.exp(-1j * omega * model.fit.dead_time)
    assert_allclose(model.fit.response(omega), by_hand, rtol=1e-12)


@pytest.fixture(scope="module")
def thirty():
    return [cr.fit_frf(noisy(seed), 2, relative_degree=2, dt=1e-3).fit for seed in range(30)]


def test_dead_times_scatter_as_the_stated_deviation_and_are_covered(thirty):
    fits = thirty
    error = np.array([fit.dead_time - 0.04 for fit in fits])
    std = np.array([fit.std_given_structure for fit in fits])
    # Standard deviation of 30 runs is known to 13 %; more than two of them.
    assert error.std() == pytest.approx(std.mean(), rel=0.3)
    assert abs(error.mean()) < 3 * std.mean() / np.sqrt(30)
    inside = np.mean([fit.interval[0] <= 0.04 <= fit.interval[1] for fit in fits])
    assert 0.88 <= inside <= 1.0  # 95 +- 4.0 %, nearly two of them
    assert np.mean([fit.weighted_rms for fit in fits]) == pytest.approx(1.0, abs=0.03)


def bound_of(level):
    """Cramer-Rao bounds of dead time and the two poles, from differences of the model."""

    def model(p):
        return p[0] * np.exp(-S * p[1]) / (S / p[2] + 1) / (S / p[3] + 1)

    truth = np.array([2, 0.04, 4 * np.pi, 10 * np.pi])
    J = np.stack(
        [
            (model(truth + h) - model(truth - h)) / (2 * np.abs(h).max())
            for h in np.diag(1e-6 * truth)
        ],
        axis=1,
    )
    information = 2 * (J.conj().T @ J).real / level**2
    return np.sqrt(np.diag(np.linalg.inv(information)))[1:]


def test_delay_and_poles_reach_their_cramer_rao_bounds(thirty):
    truth = np.array([0.04, -4 * np.pi, -10 * np.pi])
    found = np.array([[fit.dead_time, *fit.poles.real] for fit in thirty])
    rms = np.sqrt(np.mean((found - truth) ** 2, axis=0))
    # The rms of 30 runs is known to 13 %: two of them.
    assert rms / bound_of(0.01) == pytest.approx(np.ones(3), abs=0.27)


def test_what_is_no_noise_does_not_buy_orders():
    """A smooth error of 1 %, as of a plant that is not quite linear, a hundred times the noise."""
    f = np.geomspace(0.1, 30, 200)
    s = 2j * np.pi * f
    rng = np.random.default_rng(1)
    noise = 1e-4 * (rng.standard_normal(200) + 1j * rng.standard_normal(200)) / np.sqrt(2)
    wave = 1 + 0.01 * np.sin(6 * np.log(f))
    frf = cr.MeasuredFRF(second_order(s) * wave + noise, f, std=np.full(200, 1e-4))
    fit = cr.fit_frf(frf, dt=1e-3).fit
    assert fit.order <= 5
    assert "structured_misfit" in {flag.code for flag in fit.flags}
    assert fit.interval[0] <= 0.04 <= fit.interval[1]


@pytest.mark.parametrize(("top", "level", "told"), [(40.0, 0.001, False), (5.0, 0.02, True)])
def test_structures_disagree_is_said_where_they_do_by_a_tenth_of_the_dead_time(top, level, told):
    # a fast pole more takes 0.7 ms of 40 at 30 Hz, and tens of ms where the band ends early
    def plant(s):
        fast = (s / (20 * np.pi) + 1) * (s / (24 * np.pi) + 1)
        return second_order(s) / (fast if told else 1)

    f = np.geomspace(0.1, top, 60)
    fit = cr.fit_frf(noisy(0, f=f, level=level, plant=plant), dt=1e-3).fit
    assert ("structures_disagree" in {flag.code for flag in fit.flags}) is told
    # a superfluous parameter must gain 5 in BIC: 2 % of runs
    assert told or (fit.order, fit.relative_degree) == (2, 2)
    assert fit.interval[0] <= 0.04 <= fit.interval[1]


PLAIN = cache(lambda: cr.fit_frf(noisy(5), 2, dt=1e-3).fit)


@settings(max_examples=5)
@given(st.floats(1e-6, 1e6), st.floats(1e-3, 1e3))
def test_units_of_output_and_time_change_nothing_else(size, rate):
    frf, plain = noisy(5), PLAIN()
    moved = cr.MeasuredFRF(frf.complex * size, F * rate, std=frf.std * size)
    other = cr.fit_frf(moved, 2, dt=1e-3 / rate).fit
    # Minima are found to 1e-9 of the cost, so to 1e-5 of a standard deviation or better.
    assert other.dead_time * rate == pytest.approx(
        plain.dead_time, abs=1e-3 * plain.std_given_structure
    )
    assert other.gain == pytest.approx(plain.gain * size, rel=1e-5)
    assert other.weighted_rms == pytest.approx(plain.weighted_rms, rel=1e-6)
    assert_allclose(np.array(other.interval) * rate, plain.interval, rtol=1e-3)


def test_simulated_valve_gives_37_samples_within_a_tenth(valve_frf):
    valve = cr.bench.valve()
    fit = cr.fit_frf(valve_frf, dt=valve.dt).fit
    assert (fit.order, fit.relative_degree) == (4, 4)
    assert fit.dead_time / valve.dt == pytest.approx(37, abs=0.3)
    assert fit.interval[0] <= 37 * valve.dt <= fit.interval[1]
    assert fit.total_delay == pytest.approx(valve.truth.total_delay, rel=1e-3)
    assert np.sort(np.abs(fit.poles)) / (2 * np.pi) == pytest.approx([2.2, 8, 8, 30], rel=0.05)


def test_motor_with_tacho_has_2_9_ms_of_dead_time_and_one_lag(shared_data):
    fit = cr.fit_frf(cr.read_frf(shared_data / "dc_motor_tacho" / "frf.csv"), 1, dt=73e-6).fit
    assert fit.dead_time == pytest.approx(2.9e-3, abs=0.1e-3)
    assert fit.gain == pytest.approx(2.03, abs=0.02)
    assert -1 / fit.poles[0].real == pytest.approx(11.75e-3, rel=0.01)
    assert not fit.noise_known


def test_leading_phase_is_told_and_a_missing_delay_is_not_taken_for_it():
    rng = np.random.default_rng(0)
    noise = 1e-3 * (rng.standard_normal(F.size) + 1j * rng.standard_normal(F.size))
    std = np.full(F.size, 1e-3 * np.sqrt(2))

    def codes(tau):
        frf = cr.MeasuredFRF(second_order(S, tau=tau) + noise, F, std=std)
        return {flag.code for flag in cr.fit_frf(frf, (2, 3), dt=1e-3).fit.flags}

    assert "phase_leads" in codes(-0.05)
    # a lead so long that the best of the wrong models has a trace of dead time
    assert "phase_leads" in codes(-0.2)
    assert "phase_leads" not in codes(0.0)


def test_noise_alone_is_refused():
    u, y = np.random.default_rng(0).standard_normal((2, 20_000))
    frf = cr.spectral_frf(cr.Record(0.01 * np.arange(20_000), u, y))
    with pytest.raises(cr.CtrlRealizeError, match="does not excite"):
        cr.fit_frf(frf, dt=0.01, hold="zoh")


def test_superfluous_zero_takes_the_dead_time_away_and_is_said():
    # Theorem: no information on the dead time where the numerator is freer than the plant's.
    fit = cr.fit_frf(noisy(1), 2, relative_degree=1, dt=1e-3).fit
    exact = cr.fit_frf(noisy(1), 2, relative_degree=2, dt=1e-3).fit
    assert fit.interval[1] - fit.interval[0] > 5 * (exact.interval[1] - exact.interval[0])
    assert fit.interval[0] <= 0.04 <= fit.interval[1]
    assert fit.total_delay == pytest.approx(exact.total_delay, rel=0.01)


def test_two_mass_set_up_has_three_samples_beyond_its_hold(shared_data):
    data = np.load(shared_data / "tue_load_500k.npz")
    dt = float(data["dt"])
    record = cr.Record(dt * np.arange(data["u"].size), data["u"], data["y"])
    frf = cr.spectral_frf(record).trusted(0.85)
    fit = cr.fit_frf(frf, dt=dt, hold="zoh").fit
    assert np.abs(fit.poles).max() / (2 * np.pi) == pytest.approx(58, abs=0.5)
    # Against the phase of two masses without friction, no model involved: what is left grows
    # with frequency as 3.5 samples do, half a sample of which is the hold.
    omega = 2 * np.pi * frf.between_hz(20, 50).frequency_hz
    masses = 1 / (1 - (omega / np.abs(fit.poles).max()) ** 2)
    phase = np.angle(np.asarray(frf.between_hz(20, 50).complex) / masses)
    lag = -np.median(phase / omega) / dt - 0.5
    assert lag == pytest.approx(3.1, abs=0.2)
    assert fit.dead_time / dt == pytest.approx(lag, abs=0.2)
    # Up to 80 Hz a fast lag would look the same, so part of the three samples may be one. An
    # earlier look at these data, 1.5 to 2 samples, is at the lower end of what that leaves.
    assert [flag.code for flag in fit.flags] == ["structures_disagree"]
    assert 1.5 < fit.interval[0] / dt < 2.3
    assert 3.3 < fit.interval[1] / dt < 5.5


def test_the_gain_of_an_integrating_plant_is_not_known():
    f = np.geomspace(0.001, 0.3, 60)
    integrating = noisy(0, f=f, level=1e-2, plant=lambda s: 0.1 * np.exp(-3 * s) / s / (10 * s + 1))
    fit = cr.fit_frf(integrating).fit
    assert fit.interval[0] <= 3.0 <= fit.interval[1]
    assert "gain_not_resolved" in {flag.code for flag in fit.flags}
    assert "not determined from 0.001 Hz on" in fit.report()
    settling = noisy(0, f=f, level=1e-2, plant=lambda s: 2 * np.exp(-3 * s) / (10 * s + 1))
    assert cr.fit_frf(settling).fit.flags == ()


def test_a_standard_deviation_of_zero_is_one_that_was_not_measured():
    whole = noisy(1)
    std = np.array(whole.std)
    std[40] = 0.0
    one = cr.fit_frf(cr.MeasuredFRF(whole.complex, F, std=std)).fit
    same = cr.fit_frf(whole).fit
    assert (one.order, one.dead_time, one.gain) == (same.order, same.dead_time, same.gain)


def test_times_of_a_slow_plant_are_told_in_seconds():
    slow = 1e4
    frf = cr.MeasuredFRF(second_order(S, tau=0.05), F / slow)
    fit = cr.fit_frf(frf, (2, 3)).fit
    assert repr(fit).startswith("<FRFFit order 2, dead time 500.0")
    assert repr(fit).endswith(" s)>")
    early = cr.MeasuredFRF(second_order(S, tau=-0.05), F / slow)
    flags = {flag.code: str(flag) for flag in cr.fit_frf(early, (2, 3)).fit.flags}
    assert "negative dead time of -500 s" in flags["phase_leads"]


def test_a_response_that_leads_is_not_told_to_look_for_a_longer_dead_time():
    # As on the page on frequency responses; the noise unknown, and known.
    f = np.geomspace(0.5, 100, 80)
    s = 2j * np.pi * f
    early = 2 / ((0.08 * s + 1) * (0.016 * s + 1)) * np.exp(0.02 * s)
    for std in (None, np.full(80, 1e-3)):
        fit = cr.fit_frf(cr.MeasuredFRF(early, f, std=std), 2, dt=0.002).fit
        told = {flag.code: str(flag) for flag in fit.flags}
        assert "negative dead time of -20 ms" in told["phase_leads"]
        assert not told.keys() & {"delay_at_bound", "structured_misfit", "structures_disagree"}
        assert not any("max_dead_time" in text for text in told.values())


@pytest.mark.parametrize("seed", [206, 210, 104])
def test_noise_that_does_not_fall_with_the_response_makes_no_poles(seed):
    # with relative weights orders 9 and 10 won, and no interval held the truth
    f = np.geomspace(0.05, 10, 40)
    s, rng = 2j * np.pi * f, np.random.default_rng(seed)
    noise = 0.05 / 2**0.5 * (rng.standard_normal(40) + 1j * rng.standard_normal(40))
    fit = cr.fit_frf(cr.MeasuredFRF(2 * np.exp(-0.1 * s) / (0.3 * s + 1) + noise, f)).fit
    assert fit.order <= 4
    assert fit.interval[0] <= 0.1 <= fit.interval[1]


def total_row(report):
    return next(line for line in report.splitlines() if line.startswith("  total delay"))


@pytest.mark.parametrize(("slow", "told"), [(0.99, False), (-1.0, True)])
def test_a_total_delay_over_a_gain_that_may_be_zero_is_no_number(slow, told):
    # The gain is 0.01 or 2, with a standard deviation of 0.1 over such measurements.
    f = np.geomspace(0.002, 0.3, 60)
    s = 2j * np.pi * f
    exact = np.exp(-4 * s) * (1 / (5 * s + 1) - slow / (300 * s + 1))
    for seed in range(4):
        noise = 0.01 * np.random.default_rng(seed).standard_normal((60, 2)) @ [1, 1j]
        frf = cr.MeasuredFRF(exact + noise, f, std=np.full(60, 0.01 * np.sqrt(2)))
        fit = cr.fit_frf(frf, 2, relative_degree=1).fit
        assert ("not determined" not in total_row(fit.report())) == told


def test_hydrophone_answers_before_its_input_and_that_is_said(shared_data):
    frf = cr.read_frf(shared_data / "hydrophone" / "frf.csv")
    fit = cr.fit_frf(frf, 4, relative_degree=1, band_hz=(1e6, 60e6)).fit
    assert fit.dead_time == 0
    assert [flag.code for flag in fit.flags] == ["phase_leads", "gain_not_resolved"]
    assert "dead time of -0.0073 µs" in str(fit.flags[0]) or "-0.00726 µs" in str(fit.flags[0])


def test_what_an_unstable_plant_does_is_left_and_that_is_said():
    s = 2j * np.pi * np.geomspace(1e-3, 0.25, 60)
    frf = cr.MeasuredFRF(2 * np.exp(-3 * s) / (20 * s - 1), s.imag / (2 * np.pi))
    flags = {flag.code: str(flag) for flag in cr.fit_frf(frf, (1, 2, 3)).fit.flags}
    assert "If the plant is unstable" in flags["structured_misfit"]
    # what a stable plant leaves in loud noise is noise
    loud = 1 + 0.3 * np.random.default_rng(0).standard_normal(60)
    frf = cr.MeasuredFRF(2 * np.exp(-3 * s) / (20 * s + 1) * loud, s.imag / (2 * np.pi))
    flags = cr.fit_frf(frf, (1, 2, 3)).fit.flags
    assert "structured_misfit" not in [flag.code for flag in flags]


@pytest.mark.parametrize(("lowest", "others"), [(0.1, ()), (0.5, (1.0,))])
def test_an_unstable_plant_that_a_stable_model_imitates_is_named(lowest, others):
    """2 exp(-0.3 s) / (s - 0.7) with further lags; orders 9 and 10 leave only its noise."""
    omega = np.geomspace(lowest, 20, 60)
    s, rng = 1j * omega, np.random.default_rng(0)
    plant = 2 * np.exp(-0.3 * s) / (s - 0.7) / np.prod([lag * s + 1 for lag in others], axis=0)
    noise = 0.01 * (rng.standard_normal(60) + 1j * rng.standard_normal(60))
    fit = cr.fit_frf(cr.MeasuredFRF(plant * (1 + noise), omega / (2 * np.pi))).fit
    told = [str(flag) for flag in fit.flags if flag.code == "unstable"]
    number = r"([\d.]+)"
    found = re.search(rf"pole at \+{number} rad/s and a dead time of {number} ms", told[0])
    assert_allclose([float(found[1]), float(found[2])], [0.7, 300], rtol=0.03)


def test_a_stable_plant_of_high_order_is_not_taken_for_an_unstable_one():
    rng, omega = np.random.default_rng(1), np.geomspace(0.1, 20, 70)
    s = 1j * omega
    pairs = [s**2 / w**2 + 0.2 * s / w + 1 for w in (0.5, 2.0, 8.0)]
    noise = 0.01 * (rng.standard_normal(70) + 1j * rng.standard_normal(70))
    plant = np.exp(-0.3 * s) * (1 - s) / np.prod(pairs, axis=0)
    fit = cr.fit_frf(cr.MeasuredFRF(plant * (1 + noise), omega / (2 * np.pi))).fit
    assert fit.order == 6
    assert "unstable" not in {flag.code for flag in fit.flags}


def test_resonances_over_three_decades_are_found_in_noise():
    """Six pairs, damping 1 %, 3 % noise: nothing tells where they are but the response."""
    f = np.geomspace(1, 1000, 300)
    s = 2j * np.pi * f
    centres = 2 * np.pi * np.array([2.0, 7.0, 20.0, 55.0, 160.0, 480.0])
    response = sum(1 / (s**2 / w**2 + 0.02 * s / w + 1) / (k + 1) for k, w in enumerate(centres))
    rng = np.random.default_rng(3)
    scatter = 0.03 * (rng.standard_normal(300) + 1j * rng.standard_normal(300)) / np.sqrt(2)
    measured = response * np.exp(-s * 2e-4) * (1 + scatter)
    fit = cr.fit_frf(cr.MeasuredFRF(measured, f), 12, relative_degree=2).fit
    assert fit.weighted_rms == pytest.approx(0.03, rel=0.15)
    for w in centres:
        k = int(np.argmin(np.abs(fit.poles - w * complex(-0.01, 1))))
        assert abs(fit.poles[k] - w * complex(-0.01, 1)) < 4 * fit.pole_std[k] < 0.02 * w
    assert fit.dead_time == pytest.approx(2e-4, abs=4 * fit.std_given_structure)


def test_motor_bench_resonance_and_one_sample_of_delay():
    record = cr.datasets.load("motor_bench").record
    dt = record.dt
    frf = cr.spectral_frf(record, period=2500)
    fit = cr.fit_frf(frf, dt=dt, hold="zoh").fit
    assert fit.dead_time / dt == pytest.approx(1, abs=0.3)
    assert np.abs(fit.poles[-1]) / (2 * np.pi) == pytest.approx(76.6, abs=1)
    assert [flag.code for flag in fit.flags] == ["structures_disagree", "structured_misfit"]
    assert 0.9 < fit.interval[0] / dt < 1 < fit.interval[1] / dt
    # A zero more is never worse, whatever minimum it was found at first: it was by 0.8 %. Up to
    # 1e-8 the structures that may be chosen are settled afterwards.
    cost = {(one.order, one.relative_degree): one.cost for one in fit.structures}
    nested = [(n, r) for n, r in cost if (n, r + 1) in cost]
    assert all(cost[n, r] <= cost[n, r + 1] * (1 + 1e-6) for n, r in nested)


@pytest.mark.parametrize("lag", [np.inf, 1000.0])
@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_an_integrator_and_a_lag_far_below_the_band_have_the_dead_time(lag, noise):
    f = np.geomspace(0.05, 5, 60)
    s = 2j * np.pi * f
    true = 0.5 / (s + 1 / lag) * np.exp(-0.33 * s)
    for seed in range(2):
        error = np.random.default_rng(seed).standard_normal((60, 2)) @ [1, 1j] / np.sqrt(2)
        measured = true * (1 + noise * error)
        fit = cr.fit_frf(cr.MeasuredFRF(measured, f, std=noise * np.abs(true))).fit
        assert fit.order == 1
        assert fit.interval[0] <= 0.33 <= fit.interval[1]
        # the lag of 1000 s moves the phase by 0.2 degrees: one percent of noise does not show it
        seen = lag == 1000 and noise == 0.001
        assert ("not determined from 0.05 Hz on" in fit.report()) != seen


def test_direct_term_is_fitted_and_its_delay_rounded_and_said():
    response = np.exp(-S * 0.0105) * (S + 40) / (S + 10)
    model = cr.fit_frf(cr.MeasuredFRF(response, F), 1, relative_degree=0, dt=0.002)
    assert model.fit.dead_time == pytest.approx(0.0105, abs=1e-7)
    assert model.delay == 5
    assert model.fit.matrices[3][0, 0] == pytest.approx(1.0, rel=1e-6)
    assert model.fit.flags[0].code == "dead_time_rounded"


def test_poles_beside_zeros_in_the_band_do_not_hide_the_gain_of_accurate_points():
    # two equal poles in noise of a millionth: order 4, whose poles are uncertain by far
    f = np.geomspace(0.01, 3, 50)
    exact = np.exp(-0.7 * 2j * np.pi * f) / (1 + 2j * np.pi * f) ** 2
    noise = np.random.default_rng(0).standard_normal((2, 50))
    fit = cr.fit_frf(cr.MeasuredFRF(exact * (1 + 1e-6 * (noise[0] + 1j * noise[1])), f)).fit
    assert "gain_not_resolved" not in {flag.code for flag in fit.flags}
    assert fit.gain == pytest.approx(1, abs=1e-6)  # its standard error is 2e-7


def repeated(seed, repeats, count=35):
    """Mean of the repeats of a lag behind a dead time in white noise, with their scatter."""
    rng = np.random.default_rng(seed)
    lag, dead_time, f = (
        np.exp(rng.uniform(-1, 0.5)),
        rng.uniform(0.1, 2),
        np.geomspace(0.01, 2, count),
    )
    exact = np.exp(-2j * np.pi * f * dead_time) / (1 + 2j * np.pi * f * lag)
    noise = rng.standard_normal((2, repeats, count)) * 0.02 / np.sqrt(2)
    values = exact + noise[0] + 1j * noise[1]
    std = np.sqrt(np.var(values.real, axis=0, ddof=1) + np.var(values.imag, axis=0, ddof=1))
    std /= np.sqrt(repeats)
    return cr.MeasuredFRF(values.mean(axis=0), f, std=std, repeats=repeats), dead_time


@pytest.mark.parametrize("repeats", [2, 3, 6])
def test_intervals_hold_where_the_noise_is_known_from_few_repeats_of_few_points(repeats):
    # with the weights as they are 65, 84 and 92 % of some 600 did. Of 60 with 95 % fewer than 50
    # hold once in 1500 times
    held = 0
    for seed in range(60):
        frf, dead_time = repeated(seed, repeats)
        low, high = cr.fit_frf(frf, 1, relative_degree=1).fit.interval
        held += low <= dead_time <= high
    assert held >= 50


def test_deviations_of_many_repeats_stay_and_those_of_few_lose_their_scatter():
    frf, _ = repeated(0, 2)
    often = cr.MeasuredFRF(frf.complex, frf.frequency_hz, std=frf.std, repeats=10**6)
    assert_allclose(cr.fit_frf(often, 1).fit.sigma, frf.std, rtol=1e-4)
    # an exponential variance: the mean of its logarithm is Euler's constant below that of the mean
    even = cr.MeasuredFRF(frf.complex, frf.frequency_hz, std=0 * frf.std + 0.02, repeats=2)
    assert_allclose(cr.fit_frf(even, 1).fit.sigma, 0.02 * np.exp(np.euler_gamma / 2), rtol=1e-9)
    assert np.log(cr.fit_frf(frf, 1).fit.sigma).std() < 0.5 * np.log(frf.std).std()


@pytest.mark.parametrize("beside", ["std", "coherence"])
def test_noisy_points_count_for_little(beside):
    rng = np.random.default_rng(9)
    coherence = np.where(F > 10, 0.01, 0.9999)
    relative = np.sqrt((1 - coherence) / coherence)
    noise = relative * (rng.standard_normal(F.size) + 1j * rng.standard_normal(F.size))
    response = second_order(S) * (1 + noise / np.sqrt(2))
    given = {"std": relative * np.abs(second_order(S)), "coherence": coherence}
    weighted = cr.MeasuredFRF(response, F, **{beside: given[beside]})
    known = cr.fit_frf(weighted, 2, relative_degree=2, dt=1e-3).fit
    blind = cr.fit_frf(cr.MeasuredFRF(response, F), 2, relative_degree=2, dt=1e-3).fit
    assert known.dead_time == pytest.approx(0.04, abs=2e-3)
    assert abs(blind.dead_time - 0.04) > 3 * abs(known.dead_time - 0.04)
    assert known.noise_known == (beside == "std")


@pytest.mark.parametrize(("seed", "at_the_bound"), [(0, True), (1, False)])
def test_a_dead_time_that_may_lie_beyond_the_bound_is_said(seed, at_the_bound):
    # of 40 ms; one more lag takes what the bound leaves over
    fit = cr.fit_frf(noisy(seed, level=0.02), 3, max_dead_time=0.036).fit
    assert (fit.dead_time == pytest.approx(0.036, rel=1e-6)) == at_the_bound
    assert fit.interval[1] == 0.036
    assert "delay_at_bound" in {flag.code for flag in fit.flags}
    free = cr.fit_frf(noisy(seed, level=0.02), 3).fit
    assert "delay_at_bound" not in {flag.code for flag in free.flags}


def of_modes(centres, damping, *, level=0.01, points=100):
    """Resonances in rad/s behind 20 ms, with noise in proportion to the response."""
    f = np.geomspace(0.05, 20, points)
    s = 2j * np.pi * f
    exact = sum(w**2 / (s * s + 2 * damping * w * s + w * w) for w in centres) * np.exp(-0.02 * s)
    rng = np.random.default_rng(0)
    noise = level * (rng.standard_normal(points) + 1j * rng.standard_normal(points)) / np.sqrt(2)
    return f, exact * (1 + noise), level * np.abs(exact)


@pytest.mark.parametrize(("damping", "known"), [(0.02, False), (0.2, True)])
def test_three_resonances_are_order_six_without_being_told(damping, known):
    # four poles are no better than one there, and five no better than four
    f, measured, std = of_modes((2, 9, 40), damping)
    fit = cr.fit_frf(cr.MeasuredFRF(measured, f, std=std if known else None)).fit
    assert (fit.order, fit.relative_degree) == (6, 2)
    assert fit.dead_time == pytest.approx(0.02, abs=4 * fit.std_given_structure)
    assert fit.interval[0] <= 0.02 <= fit.interval[1] < fit.interval[0] + 2e-3
    assert fit.weighted_rms == pytest.approx(1.0 if known else 0.01, rel=0.15)


@pytest.mark.parametrize("relative", [False, True])
def test_errors_of_unknown_kind_leave_the_dead_time_inside(relative):
    # with relative weights alone the last few points, of errors of 20 %, were fitted by four poles:
    # the interval held the dead time in two of these four, and in all of relative errors
    held = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        lag, tau = rng.uniform(8, 30), rng.uniform(1, 20)
        f = np.geomspace(0.02, 1.5, 14) / lag
        exact = np.exp(-2j * np.pi * f * tau) / (2j * np.pi * f * lag + 1)
        size = np.abs(exact) if relative else 1.0
        noise = 0.02 / np.sqrt(2) * size * (rng.standard_normal((14, 2)) @ [1, 1j])
        fit = cr.fit_frf(cr.MeasuredFRF(exact + noise, f), dt=1.0).fit
        held.append(fit.interval[0] <= tau <= fit.interval[1])
    assert sum(held) >= 3  # two of four are outside of 95 % once in seventy times


@pytest.mark.parametrize("seed", [5003, 5015, 5021])
def test_ten_points_do_not_tell_constant_errors_from_relative_ones(seed):
    # three of 45 records of this kind whose intervals missed the dead time where evidence counted
    # as that of many points; the true kind of errors, stated, is one of those that are covered
    rng = np.random.default_rng(seed)
    tau, f = rng.uniform(0.1, 1), np.geomspace(0.02, 2, 10)
    s = 2j * np.pi * f
    noise = 0.05 / np.sqrt(2) * (rng.standard_normal(10) + 1j * rng.standard_normal(10))
    frf = cr.MeasuredFRF(np.exp(-tau * s) / (s + 1) + noise, f)
    low, high = cr.fit_frf(frf).fit.interval
    assert low <= tau <= high
    assert low <= cr.fit_frf(frf, weighting="uniform").fit.dead_time <= high


def test_noise_at_an_anti_resonance_does_not_outweigh_the_response():
    """Error of 1 % and a floor, which is many times the response at two anti-resonances."""
    f = np.linspace(0.1, 24, 100)
    s = 2j * np.pi * f

    def pair(w, z):
        return (s * s + 2 * z * w * s + w * w) / w**2

    exact = 0.1 * np.exp(-0.004 * s) * pair(25, 1e-3) * pair(140, 1e-3)
    exact = exact / (pair(46, 3e-3) * pair(100, 5e-3) * pair(230, 0.04))
    rng = np.random.default_rng(0)
    scatter = np.hypot(0.01 * np.abs(exact), 0.01)
    noise = scatter * (rng.standard_normal(100) + 1j * rng.standard_normal(100)) / np.sqrt(2)
    fit = cr.fit_frf(cr.MeasuredFRF(exact + noise, f), 6, relative_degree=2).fit
    found = fit.response(2 * np.pi * f)
    # 12 parameters of 200 numbers are a quarter of the noise; the floor is known to a factor
    assert np.sqrt(np.mean(np.abs((found - exact) / scatter) ** 2)) < 0.5
    assert fit.interval[0] <= 0.004 <= fit.interval[1]


def test_noise_that_does_not_fall_with_the_response_buys_no_orders():
    # 1 % of a lag's response at low frequencies is its size at 200 times its corner, 60 Hz
    frf = noisy(0, plant=lambda s: np.exp(-0.02 * s) / (s / (0.6 * np.pi) + 1))
    fit = cr.fit_frf(cr.MeasuredFRF(frf.complex, F)).fit
    assert (fit.order, fit.relative_degree) == (1, 1)
    assert fit.interval[0] <= 0.02 <= fit.interval[1]


def test_robot_arm_with_two_anti_resonances_is_of_order_six(shared_data):
    frf = cr.read_frf(shared_data / "contsid_robot_arm" / "frf.csv")
    fit = cr.fit_frf(frf, 6, relative_degree=(1, 2)).fit
    error = np.abs(fit.response(2 * np.pi * fit.frequency_hz) - fit.measured)
    # its publishers fit sixth order to 1.5 %, all points alike
    assert np.linalg.norm(error) < 0.025 * np.linalg.norm(fit.measured)


def test_few_points_are_fitted_with_the_orders_that_they_determine():
    f = np.geomspace(0.1, 10, 7)
    s = 2j * np.pi * f
    frf = cr.MeasuredFRF(2 * np.exp(-0.02 * s) / (0.1 * s + 1), f)
    fit = cr.fit_frf(frf).fit
    assert fit.dead_time == pytest.approx(0.02, abs=1e-7)
    assert max(row.order for row in fit.structures) == 3
    with pytest.raises(cr.CtrlRealizeError, match="at least 9; 7 points suffice for order 3"):
        cr.fit_frf(frf, (3, 4))


def test_an_error_that_all_points_share_widens_the_interval_and_is_said():
    """Three bumps of 2 %, as of a fixture; with ten poles nothing is left of them."""
    f = np.linspace(10, 250, 50)
    s = 2j * np.pi * f

    def pair(hz, z):
        w = 2 * np.pi * hz
        return w**2 / (s * s + 2 * z * w * s + w**2)

    rng = np.random.default_rng(1)
    shared = sum(0.02 * s * 0.08 / (2 * np.pi * hz) * pair(hz, 0.04) for hz in (38, 132, 215))
    noise = 0.001 * (rng.standard_normal(50) + 1j * rng.standard_normal(50))
    plant = np.exp(-0.002 * s) / (s / (10 * np.pi) + 1) * pair(85, 0.3) * pair(180, 0.1)
    fit = cr.fit_frf(cr.MeasuredFRF(plant * (1 + shared + noise), f), (5, 10)).fit
    assert fit.order == 10
    assert "systematic_error" in {flag.code for flag in fit.flags}
    assert fit.interval[0] <= 0.002 <= fit.interval[1]


def test_a_heat_exchanger_that_takes_all_poles_is_told():
    """A wall temperature along a pipe: poles without end, part of the dead time among them."""
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    fits = [
        cr.fit_frf(measured(h, f, 0.005, 0)).fit
        for h in (
            (1 - np.exp(-1 - 4 * s)) / (1 + 4 * s) * np.exp(-0.6 * s),
            np.exp(-0.6 * s) / ((2 * s + 1) * (s + 1)),
        )
    ]
    told = [{flag.code for flag in fit.flags} for fit in fits]
    assert "highest_order" in told[0] - told[1]
    assert fits[1].interval[0] <= 0.6 <= fits[1].interval[1]


def root_of_diffusion(s):
    return np.sqrt(4 * s)


def flow(s):
    """Residence times of 2 s that spread by half of that: Peclet number 8."""
    return np.exp(4 * (1 - np.sqrt(1 + s)))


@pytest.mark.parametrize(
    "plant",
    [
        lambda s: 1 / np.cosh(root_of_diffusion(s)),
        lambda s: root_of_diffusion(s) / np.sinh(root_of_diffusion(s)),
        lambda s: 1 / np.cosh(root_of_diffusion(s)) / (s + 1),
        flow,
        lambda s: flow(s) / (s / 2 + 1),
    ],
    ids=["isolated wall", "wall between two", "wall behind a sensor", "pipe", "pipe and sensor"],
)
def test_infinitely_many_lags_leave_the_dead_time_inside(plant):
    """Three or four poles took 0.1 to 0.5 s of them for dead time; intervals began too late."""
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    fit = cr.fit_frf(measured(plant(s) * np.exp(-0.6 * s), f, 0.01, 1)).fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1]
    assert np.ptp(fit.interval) < 1.6  # the longest lag of a wall: 16 / pi^2
    assert "structures_disagree" in {flag.code for flag in fit.flags}


@pytest.mark.parametrize("seed", [0, 1])
def test_a_flow_that_disperses_has_its_own_dead_time(seed):
    """Three lags took 0.4 to 0.5 s of it for dead time."""
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    fit = cr.fit_frf(measured(flow(s) * np.exp(-0.6 * s), f, 0.01, seed)).fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1]
    assert abs(fit.dead_time - 0.6) < 0.05  # a twentieth of the spread of 1 s
    assert "dispersed_flow" in {flag.code for flag in fit.flags}
    assert np.median(fit.relative_error) < 0.02  # lags and zeros follow it


def test_a_flow_behind_a_hold_has_its_own_dead_time():
    """Four to six lags took 0.3 s of it for dead time, in an interval 0.2 s late."""
    dt, k = 0.1, np.arange(600)
    pulses = np.diff(invgauss(mu=0.25, scale=2 / 0.25).cdf(dt * k - 0.6), prepend=0)
    f = np.arange(1, 121) / (dt * k.size)
    sampled = np.exp(-2j * np.pi * dt * np.outer(f, k)) @ pulses
    fit = cr.fit_frf(measured(sampled, f, 0.003, 1), dt=dt, hold="zoh").fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1] < fit.interval[0] + 0.05


def test_of_eight_equal_lags_none_is_dead_time():
    """Five or six free poles took 0.1 to 0.5 s of 2.4 s for dead time."""
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    fit = cr.fit_frf(measured(np.exp(-0.6 * s) / (0.3 * s + 1) ** 8, f, 0.003, 0)).fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1]
    assert abs(fit.dead_time - 0.6) < 0.003  # a hundredth of a lag
    assert fit.order == 8
    assert any("equal lags" in choice for choice in fit.choices)
    assert np.isnan(fit.pole_std).all()  # they are not free
    assert_allclose(fit.total_delay, 3.0, rtol=0.01)


@pytest.mark.parametrize(
    ("lags", "seed"),
    [((0.1, 0.2, 0.4, 0.5, 0.8), 0), ((0.2, 0.3, 0.4, 0.4, 0.5, 0.5, 0.6, 0.8), 1)],
)
def test_of_several_lags_none_is_dead_time(lags, seed):
    """Zeros of four to six poles took 0.1 to 0.4 s of them."""
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    exact = np.exp(-0.6 * s) / np.prod(1 + np.multiply.outer(s, lags), axis=1)
    fit = cr.fit_frf(measured(exact, f, 0.003, seed)).fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1]
    assert abs(fit.dead_time - 0.6) < 0.05  # half of the shortest lag
    assert_allclose(fit.total_delay, 0.6 + sum(lags), rtol=0.01)


def test_twelve_equal_lags_leave_the_dead_time_open():
    """Of 3.6 s of lags 0.3 to 0.7 s were dead time, in intervals 0.1 to 0.5 s late."""
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    fit = cr.fit_frf(measured(np.exp(-0.6 * s) / (0.3 * s + 1) ** 12, f, 0.003, 0)).fit
    assert fit.interval[0] <= 0.6 <= fit.interval[1]
    assert "many_lags" in {flag.code for flag in fit.flags}


@pytest.mark.parametrize(
    ("core", "std"),
    [
        (lambda s: 1 / (0.3 * s + 1) ** 8, 0.001),
        (lambda s: 1 / (s + 1) / ((s / 2) ** 2 + 0.1 * s + 1), 0.01),
    ],
    ids=["as long as the longest chain", "a resonance, which no chain explains"],
)
def test_chains_that_get_better_to_the_last_are_not_always_longer(core, std):
    f = np.geomspace(0.002, 1, 80)
    s = 2j * np.pi * f
    fit = cr.fit_frf(measured(core(s) * np.exp(-0.6 * s), f, std, 0)).fit
    assert 0 < fit.interval[0] <= 0.6 <= fit.interval[1]
    assert "many_lags" not in {flag.code for flag in fit.flags}


@pytest.mark.parametrize("seed", [1, 3])
def test_a_dead_time_of_two_longest_periods_overflows_nowhere(seed):
    f = np.geomspace(1, 5, 12)
    s = 2j * np.pi * f
    noise = 0.03 * np.random.default_rng(seed).standard_normal((12, 2)) @ [1, 1j]
    frf = cr.MeasuredFRF(np.exp(-2 * s) / (s + 1) / (s / 300 + 1) * (1 + noise), f)
    low, high = cr.fit_frf(frf).fit.interval
    assert low <= 2 <= high


def test_two_repeats_of_an_undulator_have_dead_times_in_common(shared_data):
    ends = []
    for name in ("process_1", "process_2"):
        frf = cr.read_frf(shared_data / "undulator" / f"{name}.csv")
        fit = cr.fit_frf(frf, (6, 8, 10), relative_degree=(1, 2)).fit
        assert "systematic_error" in {flag.code for flag in fit.flags}
        ends.append(fit.interval)
    assert max(low for low, _ in ends) < min(high for _, high in ends)


def test_an_interval_of_a_stated_order_holds_if_the_order_is_right():
    f = np.geomspace(0.1, 20, 40)
    s = 2j * np.pi * f
    noise = 0.01 * np.random.default_rng(0).standard_normal((40, 2)) @ [1, 1j]
    frf = cr.MeasuredFRF(2 * np.exp(-0.03 * s) / (0.08 * s + 1) + noise, f)
    assert cr.fit_frf(frf).fit.interval_kind == "confidence"
    assert cr.fit_frf(frf, 1).fit.interval_kind == "conditional"


def test_a_gain_with_dead_time_comes_out_without_a_lag():
    def gain(s):
        return 2 * np.exp(-0.04 * s)

    exact = cr.fit_frf(cr.MeasuredFRF(gain(S), F)).fit
    assert exact.order == 0
    assert exact.dead_time == pytest.approx(0.04, abs=1e-9)
    fits = [cr.fit_frf(noisy(seed, level=0.05, plant=gain)).fit for seed in range(3)]
    for fit in fits:
        # the phase 0.04 w has an error of level / (gain sqrt(2)) at every point
        bound = 0.05 / (2 * np.sqrt(2)) / np.linalg.norm(2 * np.pi * F)
        assert abs(fit.dead_time - 0.04) < 3.5 * bound
        assert fit.std_given_structure == pytest.approx(bound, rel=0.35)
        assert fit.order == 0
        assert fit.interval[0] <= 0.04 <= fit.interval[1]


@pytest.mark.parametrize("dead_time", [8.3, 8.0])
@pytest.mark.parametrize("level", [1e-3, 1e-2])
def test_aliases_of_a_held_input_are_part_of_the_model(dead_time, level):
    # a lag falls so slowly that at a quarter of the sampling rate an alias is a tenth of it
    plant = cr.delayed_ss(ct.tf([2], [12, 1]), dead_time=dead_time, dt=1.0)
    f = np.arange(1, 256) / 512
    exact = np.asarray(plant(np.exp(2j * np.pi * f)))
    noise = np.random.default_rng(0).standard_normal((255, 2)) @ [1, 1j] * level / np.sqrt(2)
    std = level * np.abs(exact)
    frf = cr.MeasuredFRF(exact * (1 + noise), f, std=std, sample_time=1.0)
    fit = cr.fit_frf(frf).fit
    assert fit.order <= 2
    assert fit.weighted_rms == pytest.approx(1, abs=0.1)
    assert fit.interval[0] <= dead_time <= fit.interval[1] < fit.interval[0] + 0.4
    right = cr.fit_frf(frf, 1).fit
    continuous = 2 * np.exp(-2j * np.pi * f * dead_time) / (24j * np.pi * f + 1)
    # what is left are noise and the error of the model, without aliases of up to its own size
    np.testing.assert_allclose(right.measured, continuous, rtol=6 * level)
    assert right.dead_time == pytest.approx(dead_time, abs=max(4 * right.std_given_structure, 1e-4))
    assert right.gain == pytest.approx(2, rel=level)


def test_a_dead_time_is_found_in_spectra_of_a_held_input():
    plant = cr.delayed_ss(ct.tf([2], [12, 1]), dead_time=8.3, dt=1.0)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 800), 5)
        y = plant.simulate(u) + 0.02 * rng.standard_normal(u.size)
        fit = cr.fit_frf(cr.spectral_frf(cr.Record(np.arange(u.size) * 1.0, u, y), delay=8)).fit
        assert fit.dead_time == pytest.approx(8.3, abs=0.05)
        assert fit.interval[0] <= 8.3 <= fit.interval[1] < fit.interval[0] + 0.6


def test_a_gain_behind_a_hold_has_a_dead_time_of_up_to_a_sample_less():
    f = np.arange(1, 128) / 256
    response, std = 3 * np.exp(-2j * np.pi * f * 4), np.full(127, 0.01)
    model = cr.fit_frf(cr.MeasuredFRF(response, f, std=std, sample_time=1.0))
    assert (model.fit.order, model.delay) == (0, 4)
    # all dead times of 3 to 4 samples are the same; the ends are those of 95 % of the mixture
    low, high = model.fit.interval
    assert 3 <= low < 3.1
    assert 3.85 < high <= 4


def test_points_at_one_frequency_and_names_that_are_no_text_are_refused():
    with pytest.raises(cr.errors.DataError, match="1 frequencies with usable points"):
        cr.fit_frf(cr.MeasuredFRF(np.ones(20), np.ones(20)))
    f = np.geomspace(0.1, 2, 12)
    lag = cr.MeasuredFRF(1 / (1 + 2j * np.pi * f), f)
    with pytest.raises(cr.errors.OptionError, match="name is a int; expected text"):
        cr.fit_frf(lag, 1, name=5)
    with pytest.raises(cr.errors.OptionError, match="name is a int; expected text"):
        cr.MeasuredFRF(lag.complex, f, inputs=[1])
    with pytest.raises(cr.errors.DataError, match="real numbers"):
        lag.between_hz("0.1", 1)
