"""Model against measured frequency response."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.errors import OptionError
from tests.measured import model

DT = 1 / 1280
F = np.geomspace(0.1, 50, 60)
# Relative degree 3: aliases of the sampled plant are below 1e-6 to 50 Hz.
PLANT = ct.tf([1], [1 / 13.8, 1]) * ct.tf([2500], [1, 70, 2500])


def measured(tau=0.0, f=F, **given):
    s = 2j * np.pi * f
    return cr.MeasuredFRF(PLANT(s) * np.exp(-s * tau), f, **given)


def zoh_model(tau=0.0):
    return cr.delayed_ss(ct.ss(PLANT), dead_time=tau, dt=DT)


def test_exact_model_has_no_error_with_the_hold_taken_out():
    comparison = cr.compare_frf(zoh_model(37 * DT), measured(37 * DT))
    assert comparison.hold == "zoh"
    assert comparison.max_relative_error < 1e-9
    assert np.abs(comparison.phase_error_deg).max() < 1e-7
    assert np.abs(comparison.gain_error_db).max() < 1e-8


@pytest.mark.parametrize("dead_time", [0.0, 0.3, 0.33])
@pytest.mark.parametrize("core", [[[2], [1, 1]], [[1], [1, 0]], [[1, 2], [1, 0.4, 4]]])
def test_aliases_of_a_sampled_model_are_no_error_of_it(core, dead_time):
    """A lag behind a fraction of a sample was 12 % off at a quarter of the sample rate."""
    plant = ct.tf(*core)
    s = 2j * np.pi * np.geomspace(0.01, 9.5, 60)
    frf = cr.MeasuredFRF(plant(s) * np.exp(-dead_time * s), s.imag / (2 * np.pi))
    compared = cr.compare_frf(cr.delayed_ss(plant, dead_time=dead_time, dt=0.05), frf)
    assert compared.max_relative_error < 1e-8
    assert not compared.flags


def test_dividing_out_the_hold_alone_would_leave_aliases():
    """The figures of the docstring, for a lag of twenty samples."""
    lag, dt = ct.tf([1], [1, 1]), 0.05
    s = 2j * np.pi * np.array([0.1, 0.25]) / dt
    z = np.exp(s * dt)
    divided = ct.sample_system(lag, dt, "zoh")(z) / ((1 - 1 / z) / (s * dt))
    assert_allclose(np.abs(divided / lag(s) - 1), [0.034, 0.234], atol=5e-4)


def test_without_a_continuous_counterpart_the_hold_is_divided_out():
    # an average of two samples has a pole at z = 0
    average = ct.ss(ct.tf([0.5, 0.5], [1, 0], DT))
    f = np.array([1.0, 10.0])
    z = np.exp(2j * np.pi * f * DT)
    hold = (1 - 1 / z) / (2j * np.pi * f * DT)
    compared = cr.compare_frf(average, cr.MeasuredFRF(0.5 * (1 + 1 / z) / hold, f))
    assert compared.hold == "zoh"
    assert compared.max_relative_error < 1e-12


def test_step_invariant_model_lags_1_83_degrees_at_13_hz_behind_the_plant():
    frf = measured(f=np.array([2.0, 13.0]))
    comparison = cr.compare_frf(zoh_model(), frf, hold=None)
    assert_allclose(comparison.phase_error_deg, [-0.28125, -1.828125], atol=1e-3)


@given(st.integers(0, 2000), st.integers(6, 40))
def test_phases_are_right_at_any_delay_and_on_coarse_grids(delay, points):
    f = np.geomspace(0.1, 50, points)
    comparison = cr.compare_frf(zoh_model(delay * DT), measured(delay * DT, f))
    exact = -np.degrees(2 * np.pi * f * delay * DT) + np.degrees(
        -np.arctan(2 * np.pi * f / 13.8) - np.angle(2500 - (2 * np.pi * f) ** 2 + 140j * np.pi * f)
    )
    assert_allclose(comparison.model_phase_deg, exact, atol=0.01)  # aliases: 1e-3
    assert_allclose(comparison.measured_phase_deg, exact, atol=0.01)
    assert np.abs(comparison.phase_error_deg).max() < 0.01


def test_errors_are_those_of_the_ratio():
    scaled = cr.MeasuredFRF(PLANT(2j * np.pi * F) / (1.1 * np.exp(0.2j)), F)
    comparison = cr.compare_frf(PLANT, scaled)
    assert_allclose(comparison.gain_error_db, 20 * np.log10(1.1), rtol=1e-9)
    assert_allclose(comparison.phase_error_deg, np.degrees(0.2), rtol=1e-9)
    assert_allclose(comparison.relative_error, abs(1.1 * np.exp(0.2j) - 1), rtol=1e-9)
    assert comparison.rms_relative_error == pytest.approx(comparison.relative_error[0])
    assert comparison.rms_gain_error_db == pytest.approx(20 * np.log10(1.1))
    assert comparison.rms_phase_error_deg == pytest.approx(np.degrees(0.2))
    assert comparison.hold is None


def test_band_ends_where_the_coherence_falls_and_not_at_one_bad_point():
    coherence = np.where(F < 13, 0.99, 0.5)
    coherence[10] = 0.1
    comparison = cr.compare_frf(PLANT, measured(coherence=coherence))
    assert comparison.band_from == "coherence"
    assert comparison.band_hz == (F[0], F[F < 13][-1])
    assert comparison.trusted.sum() == (F < 13).sum()
    given = cr.compare_frf(PLANT, measured(coherence=coherence), band_hz=(F[0], 13.0))
    assert given.band_from == "given"
    assert "(as given)" in given.report()
    with pytest.raises(OptionError, match=r"band_hz=\(13, 0\.5\); expected the lower end first"):
        cr.compare_frf(PLANT, measured(), band_hz=(13.0, 0.5))


def test_simulated_valve_agrees_with_its_measured_frf_down_to_the_noise(valve_frf):
    truth = cr.bench.valve().truth.sampled
    comparison = cr.compare_frf(truth, valve_frf)
    assert 12 < comparison.band_hz[1] < 15
    assert comparison.relative_noise < 0.004
    # Error of a model that is exact is the noise. The fifteen points below 13 Hz make most of it,
    # with five repeats each: 20 % of scatter.
    ratio = comparison.rms_relative_error / comparison.relative_noise
    assert ratio == pytest.approx(1.0, abs=0.35)
    # Half a sample too much or too little is five times that.
    wrong = cr.compare_frf(truth, valve_frf, hold=None)
    assert wrong.rms_relative_error > 4 * comparison.rms_relative_error


BAND = np.geomspace(0.1, 20, 60)
S = 2j * np.pi * BAND
LAG = ct.tf([2.0], [0.05, 1.0])
MODEL = cr.delayed_ss(LAG, dead_time=0.02, dt=0.001)


def noisy(response, **beside):
    return cr.MeasuredFRF(response, BAND, **beside)


def exact(scale=1.0):
    return scale * LAG(S) * np.exp(-0.02 * S)


def codes(comparison):
    return [flag.code for flag in comparison.flags]


def test_a_response_that_the_model_follows_is_no_objection():
    found = cr.compare_frf(MODEL, noisy(exact()))
    assert codes(found) == []
    assert report.verdict_of(MODEL, comparison=found).level == "good"


def test_the_band_in_which_the_model_is_off_is_named():
    # a second lag that the model lacks shows from 2 Hz on: |1 + 0.1 s| = 1.2 at 1 Hz
    comparison = cr.compare_frf(MODEL, noisy(exact() / (1 + 0.1 * S)))
    (flag,) = comparison.flags
    assert flag.code == "frf_disagrees"
    off = comparison.frequency_hz[comparison.relative_error > 0.2]
    assert f"from {off[0]:.4g} Hz to {off[-1]:.4g} Hz" in str(flag)


def test_noise_of_the_response_is_no_disagreement():
    rng = np.random.default_rng(3)
    clean = exact()
    std = 0.08 * np.abs(clean)
    noise = std * (rng.standard_normal((BAND.size, 2)) @ [1, 1j]) / np.sqrt(2)
    assert codes(cr.compare_frf(MODEL, noisy(clean + noise, std=std))) == []
    # without its deviation nobody knows that it is noise
    assert codes(cr.compare_frf(MODEL, noisy(clean + noise))) == ["frf_differs"]


def test_the_response_of_the_motor_contradicts_the_model_of_its_step(shared_data):
    system = model("dc_motor_tacho/up")
    comparison = cr.compare_frf(system, cr.read_frf(shared_data / "dc_motor_tacho" / "frf.csv"))
    verdict = report.verdict_of(system, comparison=comparison)
    assert verdict.level == "poor"
    assert "measured frequency response contradicts" in verdict.reasons[0]
    assert f"{100 * comparison.rms_relative_error:.3g} %" in verdict.reasons[0]


@pytest.mark.parametrize(("scale", "code"), [(1.1, "frf_differs"), (1.5, "frf_disagrees")])
def test_a_gain_that_is_off_is_told_and_a_contradiction_comes_first(scale, code):
    found = cr.compare_frf(MODEL, noisy(exact(scale)))
    assert codes(found) == [code]
    first = replace(found, flags=(cr.results.Flag("delay_at_bound", "try more"), *found.flags))
    verdict = report.verdict_of(MODEL, comparison=first)
    if code == "frf_disagrees":
        assert verdict.level == "poor"
        assert "contradicts" in verdict.judgement
        assert "contradicts" in verdict.reasons[0]


def test_points_beyond_nyquist_are_left_out_and_said():
    slow = ct.sample_system(ct.ss(PLANT), 0.02, "zoh")
    comparison = cr.compare_frf(slow, measured())
    assert comparison.frequency_hz.max() < 25
    assert "beyond_nyquist" in codes(comparison)
    assert "25 Hz" in comparison.report()
