"""The simulated valve, against independent simulations of the same equations."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal
from scipy.linalg import expm

import ctrl_realize as cr
from ctrl_realize import bench, paper
from ctrl_realize.actuators import Backlash, Stiction

CLEAN = {"noise": 0, "input_noise": 0, "spikes": 0, "bits": None}
DT = 1 / 1280
GAIN = 0.125


def continuous_step(truth, times):
    """Unit-step response by the matrix exponential at each time, dead time by shifting it."""
    A, B, C, _ = truth.matrices
    grown = np.block([[A, B], [np.zeros((1, A.shape[0] + 1))]])
    start = np.append(np.zeros(A.shape[0]), 1.0)
    late = times - truth.dead_time
    return np.array(
        [(C @ (expm(grown * t) @ start)[:-1])[0] if t > 0 else 0.0 for t in late.tolist()]
    )


@pytest.mark.parametrize("samples", [37.0, 0.0, 36.4, 0.25])
def test_clean_step_is_the_continuous_step_at_the_samples(samples):
    valve = bench.valve(dead_time=samples * DT, pre_step_time=0.05, hold=0.5, **CLEAN)
    record = valve.step_record(8)
    start = round(0.05 / DT)
    picked = np.arange(start, record.n_samples, 23)
    expected = 0.27 + 8 * continuous_step(valve.truth, (picked - start) * DT)
    assert_allclose(record.output[picked], expected, atol=1e-12)  # exact sampling, rounding only
    assert_allclose(record.output[:start], 0.27, atol=1e-13)


def test_default_truth_is_a_valve_of_2_2_hz_behind_37_samples():
    truth = bench.valve(lvdt_hz=None).truth
    magnitude = np.abs(truth.response(2 * np.pi * np.array([1e-6, 2.20])))
    assert magnitude[0] == pytest.approx(GAIN, rel=1e-9)
    assert 20 * np.log10(magnitude[1] / magnitude[0]) == pytest.approx(-3.0, abs=0.05)
    assert truth.delay == pytest.approx(37, abs=1e-12)
    # Rig R3 of a real pole and a pair: 37 + 92.6 + 35.7 samples of lag in all.
    expected = 37 * DT + 1 / (2 * np.pi * 2.2) + 1.4 / (2 * np.pi * 8) + 1 / (2 * np.pi * 1e4)
    assert truth.total_delay == pytest.approx(expected, rel=1e-9)


def test_analog_anti_aliasing_adds_1_06_samples_to_the_truth():
    plain, analog = (bench.valve(anti_aliasing=kind).truth for kind in ("linear-phase", "analog"))
    # Fourth-order Butterworth: group delay at DC 2.6131 / w_c, w_c = 2 pi 500 Hz.
    extra = 2.6131259 / (2 * np.pi * 500)
    assert analog.total_delay - plain.total_delay == pytest.approx(extra, rel=1e-6)
    poles = np.linalg.eigvals(analog.matrices[0])
    _, expected, _ = signal.butter(4, 2 * np.pi * 500, analog=True, output="zpk")
    for pole in expected:
        assert np.abs(poles - pole).min() < 1e-6 * abs(pole)


def test_campaign_is_the_papers():
    records = bench.valve(pre_step_time=0.2, hold=0.3).step_campaign(rng=0)
    assert len(records) == 40
    assert records[0].name == "valve_16mA_01"
    assert records[39].name == "valve_4mA_10"
    assert records[0].dt == paper.SETTINGS.sample_time
    sizes = [np.median(r.input[-100:]) - np.median(r.input[:100]) for r in records]
    assert_allclose(sizes, np.repeat([16, 12, 8, 4], 10), atol=0.01)
    assert not np.array_equal(records[0].output, records[1].output)


@pytest.mark.parametrize("place", ["stem", "input"])
def test_a_sine_through_an_actuator_is_that_of_the_simulated_current(place):
    # Slow enough for the analyser to sample the current finely; both start at rest at 12 mA.
    valve = bench.valve(actuator=Stiction(2, 0.5), actuator_at=place, sine_amplitude=4.0, **CLEAN)
    (sine,) = valve.stepped_sine(0, points=1, repeats=1, band_hz=(10.0, 10.0), settle=0.1)[0]
    frequency = cr.stepped_sine_frf([sine]).frequency_hz[0]
    t = (np.arange(640) + 0.5) * sine.dt
    held = valve.record(np.append(12.0, 12 + 4 * np.sin(2 * np.pi * frequency * t)))
    # A current that is held changes where the stem breaks away, by part of a sample.
    assert_allclose(sine.output, held.output[1:], atol=0.004)
    assert np.ptp(sine.output) > 0.05


def test_the_static_test_shows_the_dead_band_and_the_linear_relation():
    valve = bench.valve(actuator=Backlash(1.0))
    report = cr.valves.valve_report(
        valve.static_test(rng=1, levels=6, cycles=1, ramp=60.0),
        command_range=(4, 20), travel_range=valve.travel_range, fit=False,
    )  # fmt: skip
    band, hysteresis, linearity = (
        report.metric(key).interval for key in ("dead_band", "hysteresis", "linearity")
    )
    assert band.low <= 1.0 <= band.high < 1.05
    # Hysteresis beyond the dead band, and linearity: there is none in this valve but for noise.
    assert max(hysteresis.value, linearity.value) < 0.1
    record = valve.static_test(rng=1, levels=6, cycles=2, ramp=None)
    each = round(2.0 / record.dt)
    at, shown = (x.reshape(-1, each)[:, each // 2 :].mean(axis=1) for x in
                 (record.input, record.output))  # fmt: skip
    rising, falling = np.diff(at) > 0, np.diff(at) < 0
    # The play is 1 % of 2 mm, half of it on each side; the mean of a level has noise of 0.0002.
    away = shown[1:] - (0.27 + GAIN * (at[1:] - 4))
    assert_allclose(away[rising], -0.01, atol=0.001)
    assert_allclose(away[falling], 0.01, atol=0.001)


@pytest.mark.parametrize("shape", ["normal", "exponential"])
def test_dead_time_may_scatter_from_record_to_record(shape):
    valve = bench.valve(dead_time_scatter=2 * DT, scatter_shape=shape, **CLEAN)
    records = valve.step_campaign(3, amplitudes=[8], repeats=60)
    # rising there all the way, so that interpolation is unique
    crossings = [np.interp(0.77, r.output[3840:4600], r.time[3840:4600]) for r in records]
    exact = bench.valve(**CLEAN).step_record(8)
    late = (crossings - np.interp(0.77, exact.output[3840:4600], exact.time[3840:4600])) / DT
    # 60 values: 9 % of scatter, twice that for an exponential, which has an upper edge
    assert np.std(late) == pytest.approx(2, rel=0.27 if shape == "normal" else 0.4)
    assert np.mean(late) == pytest.approx(0, abs=3 * 2 / np.sqrt(60))
    assert shape == "normal" or (late.max() < 2.001 and late.min() < -3)


def test_the_papers_method_on_the_papers_valve_gives_table_1():
    valve = bench.paper_valve()
    records = valve.step_campaign(0, repeats=2)
    campaign = cr.identify_campaign(records, method="paper", progress=False)
    delays = np.array([row.delay for row in campaign.rows])
    # Eight values of a deviation of 1.8: twice that of their mean.
    assert delays.mean() == pytest.approx(36.48, abs=1.3)
    assert delays.max() <= 39
    assert 10 < delays.mean() - valve.truth.delay < 25
    sweep = valve.stepped_sine(0, points=40, repeats=3, band_hz=(1.0, 50.0))
    frf = cr.stepped_sine_frf(sweep)
    assert cr.compare_frf(valve.truth.sampled, frf).band_hz[1] == pytest.approx(13, rel=0.25)
    gain = np.abs(valve.truth.response(2 * np.pi * np.array([1e-3, 2.0])))
    assert 20 * np.log10(gain[1] / gain[0]) == pytest.approx(-3, abs=0.6)  # "around 2 Hz"


def test_steps_of_a_campaign_are_one_number_or_several():
    one, same = (
        cr.bench.valve().step_campaign(1, amplitudes=sizes, repeats=1) for sizes in (8, (8.0,))
    )
    assert np.array_equal(one[0].output, same[0].output)
    assert one[0].name == same[0].name
    with pytest.raises(cr.errors.DataError, match="amplitudes holds"):
        cr.bench.valve().step_campaign(1, amplitudes="large", repeats=1)
