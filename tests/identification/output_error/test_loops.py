"""Records of running loops whose set point is known (simulated)."""

import re
from dataclasses import replace

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

import ctrl_realize as cr
from benchmarks.accuracy import factors
from benchmarks.closed_loop.cases import CASES, GAIN, PLANTS, looped, record
from benchmarks.worlds.judge import judged
from benchmarks.worlds.loops import relay_with_load
from tests.rigs import codes

PLANT = PLANTS["0.4"]
TOTAL = PLANT.dead_time + sum(PLANT.lags)
TIME = np.arange(900.0)


def loop(case, moves="three", seed=7, plant=PLANT):
    """Record of a loop, by default with the plant above."""
    wanted, bare = record(plant, CASES[case], moves, seed)
    return cr.Record(bare.time, bare.input, bare.output, reference=wanted)


def flag(fit, code):
    """Message of the one flag with a code."""
    (found,) = [one.message for one in fit.flags if one.code == code]
    return found


@pytest.fixture(scope="module")
def slow():
    """Noise with a pole at 0.9, of a tenth of the moves: the second lag hardly shows."""
    return cr.identify(loop("AR(0.9)")).fit


@pytest.fixture(scope="module")
def stated():
    return cr.identify(loop("AR(0.9)"), structures="P2D").fit


def test_the_interval_holds_and_the_delay_in_all_is_known(slow):
    low, high = slow.interval
    assert low <= PLANT.dead_time <= high
    first, last = slow.total_delay_interval
    assert first <= TOTAL <= last
    assert slow.gain_interval[0] <= GAIN <= slow.gain_interval[1]


def test_it_is_said_what_was_used_and_that_noise_hides_the_lags(slow):
    said = " ".join(slow.choices)
    for words in ("direct identification", "mean over 1 to 3 real lags", "noise model of order 1"):
        assert words in said
    assert "its set point moved" in flag(slow, "closed_loop")
    hidden = flag(slow, "small_set_point")
    assert f"total delay, {slow.total_delay:.3g} s" in hidden
    assert "moved by 1. " in hidden


def test_slow_noise_in_a_loop_leaves_no_good_dead_time():
    """Lags that the noise hides are taken for dead time, beside an interval that looks narrow."""
    case = replace(CASES["AR(0.9)"], noise=0.01)
    wanted, bare = record(PLANT, case, "nine", 7)
    fit = cr.identify(cr.Record(bare.time, bare.input, bare.output, reference=wanted)).fit
    verdict = fit.verdicts[0]
    assert verdict.level == "with care"
    assert verdict.sentence.startswith("known to ")
    assert verdict.sentence.endswith("slow noise in a loop")


def test_a_step_in_manual_beside_loops_is_fitted_as_they_are():
    """It switched their rules off: a false `feedback`, and pairs of poles in 5 of 8."""
    loops = [loop("AR(0.9)", seed=0)]
    step = (loops[0].time >= 60) * 1.0
    lags = ct.tf([GAIN], np.polymul([PLANT.lags[0], 1], [PLANT.lags[1], 1]))
    y = np.ravel(cr.delayed_ss(lags, dead_time=PLANT.dead_time, dt=loops[0].dt).simulate(step))
    noise = lfilter([0.05], [1, -0.9], np.random.default_rng(0).standard_normal(y.size))
    fit = cr.identify([cr.Record(loops[0].time, step, y + noise), *loops]).fit
    assert codes(fit) & {"feedback", "closed_loop"} == {"closed_loop"}
    assert np.isreal(fit.poles).all()
    assert fit.interval[0] <= PLANT.dead_time <= fit.interval[1]


def test_the_move_that_the_flag_names_is_enough_to_a_factor_of_two(slow):
    named = float(flag(slow, "small_set_point").split("moves of about ")[1].split()[0])
    assert 1.4 < named < 16
    # Noise tells the evidence for a lag: of 18 other records the move itself was enough in 15,
    # twice that in 17, half of it in 6. In units of the moves these are 1, and the noise is less.
    plant, case = PLANT, CASES["AR(0.9)"]
    reference, bare = record(plant, replace(case, noise=case.noise / (2 * named)), "three", 7)
    fit = cr.identify(cr.Record(bare.time, bare.input, bare.output, reference=reference)).fit
    low, high = fit.interval
    assert "small_set_point" not in {one.code for one in fit.flags}
    assert high - low <= 0.5 * fit.dead_time
    assert low <= plant.dead_time <= high


def test_lags_that_are_stated_are_fitted_in_the_same_noise(stated, slow):
    assert stated.order == 2
    assert any("P2D: as requested" in one for one in stated.choices)
    assert any("noise model of order 1" in one for one in stated.choices)
    assert stated.interval[0] <= PLANT.dead_time <= stated.interval[1]
    # one of the structures over which the other is the mean
    assert slow.interval[0] < stated.dead_time < slow.interval[1]


def test_units_do_not_change_the_dead_time(stated):
    data = loop("AR(0.9)")
    other = cr.Record(
        data.time / 60, 3 * data.input + 5, 10 * data.output - 7, reference=10 * data.reference - 7
    )
    fit = cr.identify(other, structures="P2D").fit
    # the search ends within a thousandth of a standard error
    assert 60 * fit.dead_time == pytest.approx(stated.dead_time, abs=0.02)
    assert fit.gain == pytest.approx(stated.gain * 10 / 3, rel=0.01)


def test_in_white_noise_the_dead_time_is_known_to_half_a_sample():
    fit = cr.identify(loop("white", "nine"), structures="P2D").fit
    assert abs(fit.dead_time - PLANT.dead_time) < 0.5
    assert fit.interval[0] <= PLANT.dead_time <= fit.interval[1]
    assert "small_set_point" not in {one.code for one in fit.flags}


@pytest.mark.parametrize(
    ("case", "moves"),
    [("white", "three"), ("quantised", "one")],
    ids=["no lag seen", "begins early"],
)
def test_a_long_dead_time_is_within_the_interval(case, moves):
    """Where a second lag does not show, and where the first lag alone seems to begin at once."""
    plant = PLANTS["3"]
    low, high = cr.identify(loop(case, moves, 500, plant)).fit.interval
    assert low <= plant.dead_time <= high


def test_three_lags_that_are_nearly_equal_are_not_taken_for_two():
    """Two lags fit as well, and begin 5 samples later."""
    plant = PLANTS["0.3"]
    fit = cr.identify(loop("white", "three", 502, plant)).fit
    assert fit.interval[0] <= plant.dead_time <= fit.interval[1]


def test_in_white_noise_two_lags_are_seldom_taken_for_three():
    fit = cr.identify(loop("white", "nine", 502)).fit
    assert abs(fit.dead_time - PLANT.dead_time) < 1.0


def test_stretches_in_manual_are_told():
    data = loop("white", "nine")
    wanted = np.where(data.time < 250, np.nan, data.reference)
    partly = cr.Record(data.time, data.input, data.output, reference=wanted)
    fit = cr.identify(partly, structures="P2D").fit
    assert any("manual: 0 to 249 s" in one for one in fit.choices)
    # the same samples, whoever moved the input
    assert fit.interval[0] <= PLANT.dead_time <= fit.interval[1]


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_single_samples_that_are_missing_do_not_open_a_loop(share):
    """One of 900 missing samples left the noise without a model: gains of 18 of 25 were held."""
    whole = loop("AR(0.9)", seed=1)
    gap = np.random.default_rng(1).random(TIME.size) < share
    gap[300] = True
    y = np.where(gap, np.nan, whole.output.ravel())
    data = cr.Record(TIME, whole.input, y, reference=whole.reference, missing="keep")
    fit = cr.identify(data, structures="P2D").fit
    assert fit.estimate.residual.noise_lags
    assert f"{gap.sum()} missing sample(s)" in " ".join(one.message for one in fit.flags)
    assert fit.interval[0] <= PLANT.dead_time <= fit.interval[1]
    assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]
    assert fit.total_delay_interval[0] <= TOTAL <= fit.total_delay_interval[1]


def test_long_gaps_in_a_loop_are_told():
    whole = loop("AR(0.9)")
    y = np.where((TIME > 400) & (TIME < 440), np.nan, whole.output.ravel())
    data = cr.Record(TIME, whole.input, y, reference=whole.reference, missing="keep")
    fit = cr.identify(data, structures="P2D").fit
    assert "long gaps" in flag(fit, "feedback")


def test_a_set_point_that_is_the_measured_value_is_none():
    whole = loop("AR(0.9)")
    data = cr.Record(TIME, whole.input, whole.output, reference=whole.output)
    fit = cr.identify(data, structures="P2D").fit
    assert "closed_loop" not in codes(fit)
    assert "feedback" in codes(fit)


def test_regulation_alone_is_told():
    data = loop("AR(0.9)")
    first = data[0:99]  # before the set point moves
    fit = cr.identify(first).fit
    assert "the set point does not move" in flag(fit, "feedback")


def test_lags_that_are_ruled_out_are_not_fitted():
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.standard_normal(14), 25)
    ringing = ct.sample_system(ct.tf([0.01], [1, 0.04, 0.01]), 1.0)
    output = ct.forced_response(ringing, TIME[:350], drive).outputs
    output = np.r_[np.zeros(5), output[:-5]] + 0.02 * rng.standard_normal(350)
    fit = cr.fit_output_error(cr.Record(TIME[:350], drive, output, reference=drive)).fit
    assert "closed_loop" not in {one.code for one in fit.flags}  # the set point alone moves it
    assert np.abs(fit.poles.imag).max() == pytest.approx(np.sqrt(0.01 - 0.02**2), rel=0.02)
    assert fit.interval[0] <= 5 <= fit.interval[1]


def test_three_lags_that_stand_for_four_leave_the_dead_time_open():
    # noise is a tenth of the output: three lags reach it too, with a dead time that is too long
    plant = factors.PLANTS["slow, four lags"]
    made, _ = factors.record(plant, "binary, to Nyquist", 100.0, "closed", 100)
    fit = cr.identify(made).fit
    assert fit.structure == (3, 3)
    assert fit.interval[0] <= plant.dead_time <= fit.interval[1]


def test_without_a_set_point_what_a_controller_does_is_no_step():
    """Its output moves on after the edges of the set point: as steps it has no dead time."""
    rng = np.random.default_rng(1)
    noise = lfilter([0.01 * np.sqrt(1 - 0.81)], [1, -0.9], rng.standard_normal(600))
    wanted = np.repeat([1.0, -1.0, -1.0, -1.0, -1.0, 1.0], 100)
    u, y, state, left = np.zeros(600), np.zeros(600), 0.0, 0.0
    for k in range(600):
        state += (1 - np.exp(-0.1)) * ((u[k - 4] if k > 3 else 0.0) - state)
        y[k] = state + noise[k]
        left += wanted[k] - y[k]
        u[k] = 1.2 * (wanted[k] - y[k] + 0.04 * left)
    fit = cr.identify(cr.Record(np.arange(600.0), u, y)).fit
    low, high = fit.interval
    assert low <= 3 <= high < low + 1
    assert fit.gain_interval[0] <= 1 <= fit.gain_interval[1]


def test_in_coloured_noise_a_loop_is_no_feedthrough():
    """u = K (r - y) gives the output by the input of the same sample, noise included."""
    rng = np.random.default_rng(1)
    wanted = np.repeat(rng.choice([-1.0, 1.0], 15), 100)
    noise = lfilter([0.1 * np.sqrt(1 - 0.49)], [1, -0.7], rng.standard_normal(1500))
    u, y, state = np.zeros(1500), np.zeros(1500), 0.0
    for k in range(1500):
        state += (1 - np.exp(-0.1)) * ((u[k - 4] if k > 3 else 0.0) - state)
        y[k] = state + noise[k]
        u[k] = 1.2 * (wanted[k] - y[k])
    fit = cr.identify(cr.Record(np.arange(1500.0), u, y)).fit
    assert fit.interval[0] <= 3 <= fit.interval[1] < 5
    assert "feedback" in [one.code for one in fit.flags]
    assert isinstance(fit, cr.identification.OutputErrorFit)


def test_without_a_set_point_slow_noise_is_not_taken_for_the_response():
    """Least squares explain noise by the input that answers it: the dead time was too long."""
    truth = PLANTS["1"]
    _, bare = record(truth, CASES["AR(0.97)"], "three", 801)
    fit = cr.identify(bare).fit
    assert fit.interval[0] <= truth.dead_time <= fit.interval[1]
    assert any("the input depends on the output" in one for one in fit.choices)
    assert "feedback" in [one.code for one in fit.flags]


def test_a_relay_test_beside_a_slow_load_has_the_dead_time_of_the_plant():
    # of 16.3 samples; it was 1.7 (0 to 2.7)
    assert "dead time" not in judged(relay_with_load, 0).missed


def test_a_controller_that_rounds_its_output_is_told_by_past_outputs():
    # without its set point the inverse of the controller was found: 0 (0 to 1.0)
    plant = PLANTS["0.3"]
    fit = cr.identify(record(plant, CASES["quantised"], "one", 701)[1]).fit
    assert "feedback" in codes(fit)
    low, high = fit.interval
    assert low <= plant.dead_time <= high
    assert fit.total_delay == pytest.approx(plant.dead_time + sum(plant.lags), rel=0.2)


@pytest.mark.parametrize("seed", [5, 10])
def test_a_loop_about_an_analyser_is_told_though_repeats_are_left_out(seed):
    rng, wanted = (
        np.random.default_rng(seed),
        np.where((TIME >= 100) & (TIME % 300 < 250), 1.0, 0.0),
    )
    noise = 0.08 * lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], rng.standard_normal(900))
    sent, seen, level, whole = np.zeros(912), np.zeros(900), 0.0, 0.0
    for k in range(900):
        seen[k] = seen[k - 1] if k % seed else level + noise[k]
        whole += (wanted[k] - seen[k]) / 25
        sent[k + 12] = 0.5 * (wanted[k] - seen[k] + whole)
        level += (1 - np.exp(-1 / 20)) * (2 * sent[k] - level)
    fit = cr.identify(cr.Record(TIME, sent[12:], seen, reference=wanted)).fit
    assert {"repeats_left_out", "closed_loop"} <= codes(fit)
    assert fit.interval[0] <= 12 <= fit.interval[1]
    assert fit.gain_interval[0] <= 2 <= fit.gain_interval[1]


def beside(*loads, noise=0.03, seed=7):
    """Record of a loop with three moves of 1, and steps of loads (s, size) at its input."""
    case = replace(CASES["white"], noise=noise)
    rng = np.random.default_rng(seed)
    wanted = record(PLANT, case, "three", seed)[0]
    load = sum(size * (at <= TIME) for at, size in loads) + np.zeros(TIME.size)
    y = looped(PLANT, wanted, noise * rng.standard_normal(TIME.size), case, load)
    return cr.Record(TIME, *y, reference=wanted)


def test_one_move_in_the_slowest_noise_is_still_a_response():
    plant = PLANTS["0.4"]
    wanted, made = record(plant, CASES["AR(0.97)"], "one", 700)
    fit = cr.identify(cr.Record(made.time, made.input, made.output, reference=wanted)).fit
    assert fit.interval[0] <= plant.dead_time <= fit.interval[1]
    # the same controller about nothing: its set point moves, and the output does not answer
    rng, integral, lazy = np.random.default_rng(700), 0.0, np.zeros(wanted.size)
    noise = 0.15 * lfilter([np.sqrt(1 - 0.97**2)], [1, -0.97], rng.standard_normal(1400))[500:]
    for k, error in enumerate(wanted - noise):
        integral += 0.01 * error
        lazy[k] = 0.5 * error + integral
    with pytest.raises(cr.errors.DataError, match="does not respond to the input"):
        cr.identify(cr.Record(TIME, lazy, noise, reference=wanted)[0:399], structures="FOPDT")


def test_a_load_soon_after_a_move_is_no_part_of_the_gain():
    """Gains were off by 17 to 27 %, outside of the interval in all four records."""
    for at, seed in ((380, 8), (640, 9)):
        fit = cr.identify(beside((at, 0.2), seed=seed), structures="P2D").fit
        assert fit.gain == pytest.approx(GAIN, rel=0.02)
        assert fit.interval[0] <= PLANT.dead_time <= fit.interval[1]
        assert fit.gain_interval[0] <= GAIN <= fit.gain_interval[1]


def test_loads_are_told_with_their_sizes_and_times():
    records = [beside((420, -0.3), (160, 0.2)), beside((510, 0.4), seed=8)]
    fit = cr.identify(records, structures="P2D").fit
    (said,) = [reason for reason in fit.choices if reason.startswith("loads at")]
    told = re.findall(r"(-?[.0-9]+) seen from ([.0-9]+) s on", said)
    sizes, times = np.array(sorted(told, key=lambda pair: float(pair[1])), dtype=float).T
    assert_allclose(times, PLANT.dead_time + np.array([160, 420, 510]), atol=5.0)
    assert_allclose(sizes, [0.2, -0.3, 0.4], rtol=0.1)


@pytest.mark.parametrize("case", ["white", "AR(0.97)"])
def test_noise_is_not_taken_for_a_load(case):
    fit = cr.identify(loop(case, seed=0), structures="P2D").fit
    assert not [reason for reason in fit.choices if "loads at" in reason]


def integrating_loop(dead_time, lag, slope, seed, samples=900):
    """PI loop about an integrator behind a lag and a dead time of whole samples, in white noise."""
    noise = 0.03 * np.random.default_rng(seed).standard_normal(samples)
    wanted = np.select([np.arange(samples) < k for k in (80, 300, 520, 740)], [0, 1, 0, 1], 0)
    slow = max(2 * dead_time, 10) + dead_time
    integral = 2 * slow + lag
    gain = 0.7 * integral / (slope * slow**2)
    u, y, summed, fast, level = np.zeros(samples), np.zeros(samples), 0.0, 0.0, 0.0
    for k in range(samples):
        y[k] = level + noise[k]
        summed += gain * (wanted[k] - y[k]) / (2 * integral)
        u[k] = gain * (wanted[k] - y[k]) + summed
        late = u[k - dead_time] if k >= dead_time else 0.0
        level += slope * (late + (fast - late) * lag * -np.expm1(-1 / lag))
        fast = late + (fast - late) * np.exp(-1 / lag)
    return cr.Record(np.arange(samples) + 0.0, u, y, reference=wanted + 0.0)


@pytest.mark.parametrize("case", [(9, 13.5, 0.054), (12, 3.2, 0.164), (11, 14.6, 0.077)])
def test_an_integrator_in_a_loop_has_a_slope_and_no_gain_of_any_size(case):
    # a lag of 15 to 137 records was in its place, one with a gain of 6707 (6677 to 6736)
    fit = cr.identify(integrating_loop(*case, seed=3)).fit
    assert fit.integrators == 1
    assert fit.interval[0] <= case[0] <= fit.interval[1]
    assert fit.gain_interval[0] <= case[2] <= fit.gain_interval[1]
    assert {"integrating", "gain_not_resolved"} & codes(fit) == {"integrating"}


def test_a_pulse_of_the_set_point_is_no_error_code_of_the_input():
    """Noise hid the response to it: it was left out, and a dead time of 0 to 8 s came of 3 s."""
    noise, lag = np.random.default_rng(0).standard_normal(600), np.exp(-1 / 20)
    wanted, y, u = np.zeros((3, 600))
    wanted[100], state, integral = 20.0, 0.0, 0.0
    for k in range(600):
        y[k] = state + noise[k]
        integral += 1.5 * (wanted[k] - y[k]) / 20
        u[k] = 1.5 * (wanted[k] - y[k]) + integral
        state = lag * state + (1 - lag) * (u[k - 3] if k >= 3 else 0.0)
    record = cr.Record(np.arange(600.0), u, y, reference=wanted)
    fit = cr.fit_output_error(record, structures="FOPDT").fit
    assert "outliers" not in {flag.code for flag in fit.flags}
    low, high = fit.interval
    assert low <= 3 <= high <= 6
