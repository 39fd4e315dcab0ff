"""Oscillating loops: indices in closed form, and verdicts on simulated and measured loops."""

import numpy as np
import pytest
from scipy.signal import sawtooth

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from ctrl_realize.numerics.actuators.friction import kano, kano_rows
from ctrl_realize.numerics.oscillation.cross_correlation import cross_correlation
from ctrl_realize.numerics.oscillation.cycles import crossings, find_cycles, without_drift
from ctrl_realize.numerics.oscillation.ellipse import fit_ellipse
from ctrl_realize.numerics.oscillation.half_cycles import half_cycles
from ctrl_realize.numerics.oscillation.movements import movement_indices
from tests import measured

STICKS, NOT_SO = "stiction", "no stiction: tuning or external oscillation"
TIME = np.arange(2000.0)


def diagnosed(op, pv, **options):
    return cr.valves.diagnose_loop(op, pv, dt=1.0, **options)


def test_period_and_areas_of_a_sine_are_those_of_the_closed_form():
    period, amplitude = 37.3, 2.5
    drift = 1e-3 * TIME
    found = find_cycles(amplitude * np.sin(2 * np.pi * TIME / period) + drift)
    assert found.period == pytest.approx(period, rel=1e-3)
    assert found.regularity > 10
    assert found.alike == 1
    # a moving average over a quarter of the period leaves sinc(1/4) of the fundamental
    assert found.area == pytest.approx(amplitude * period / np.pi * np.sinc(0.25), rel=0.03)


def test_the_moving_average_over_a_period_takes_drift_and_leaves_the_cycle():
    for period in (40, 41):
        wave = np.where(TIME % period < 7, 1.0, 0.0)
        clean = without_drift(wave + 0.01 * TIME, period)
        half = period // 2
        assert np.allclose(clean, (wave - 7 / period)[half : half + clean.size], atol=1e-9)


@pytest.mark.parametrize("kind", ["lag", "walk"])
def test_noise_is_rarely_taken_for_an_oscillation(kind):
    said = []
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal(800)
        if kind == "lag":
            for k in range(1, noise.size):
                noise[k] += 0.9 * noise[k - 1]
        value = np.cumsum(noise) if kind == "walk" else noise
        said.append(diagnosed(np.roll(value, 3), value).oscillates is True)
    # binomial with 10 %: more than 6 of 20 with a probability below 1 %
    assert sum(said) <= 6


@pytest.mark.parametrize("seed", range(4))
def test_a_tight_linear_loop_with_few_samples_in_a_cycle_does_not_stick(seed):
    """Nine samples in a cycle: noise chose the half cycles that are long, and they had a shape."""
    rng, decay = np.random.default_rng(seed), np.exp(-1 / 3)
    op, pv = np.zeros(1500), np.zeros(1500)
    integral = lag = 0.0
    for k in range(op.size):
        pv[k] = lag + 0.05 * rng.standard_normal()
        integral -= 1.5 / 6 * pv[k]
        op[k] = integral - 1.5 * pv[k]
        lag = decay * lag + (1 - decay) * op[max(k - 2, 0)]
    found = diagnosed(op[200:], pv[200:])
    assert found.verdict != STICKS
    assert "few_samples_per_cycle" in {flag.code for flag in found.flags}


def test_the_range_of_stiction_holds_none_where_there_is_none():
    margin = cr.design.margins(cr.bench.valve_loop().open_loop).gain_margin
    loop = cr.bench.valve_loop(tightness=0.93 * margin, noise=0.3)
    for seed in range(3):  # it was excluded in 13 of 40
        record = loop.simulate(1500.0, rng=100 + seed).record
        assert cr.valves.diagnose_loop(record).stiction_fit.S_range[0] == 0


@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0, 70.0, 90.0])
def test_cross_correlation_and_ellipse_of_two_sines_are_those_of_the_closed_form(degrees):
    phase, period, amplitude = np.radians(degrees), 40.0, 3.0
    op = amplitude * np.sin(2 * np.pi * TIME / period)
    pv = -5 * np.sin(2 * np.pi * TIME / period - phase)
    found = cross_correlation(op, pv, period)
    assert found.shift == pytest.approx(2 * phase / np.pi, abs=0.02)
    height = (1 - np.cos(phase)) / (1 + np.cos(phase))
    assert found.height == pytest.approx(height, abs=0.03)
    ellipse = fit_ellipse(op, pv, period)
    assert ellipse.width == pytest.approx(2 * amplitude * np.sin(phase), abs=1e-6)


def test_half_cycles_are_told_apart_by_the_error_of_their_shape():
    period = 50.0
    angle = 2 * np.pi * TIME / period
    lag = np.exp(-1 / 10)
    relay, level = np.zeros(TIME.size), 0.0
    for k, up in enumerate(np.sin(angle) > 0):
        level = lag * level + (1 - lag) * (1.0 if up else -1.0)
        relay[k] = level
    waves = {"sine": np.sin(angle), "triangle": np.arcsin(np.sin(angle)), "relay": relay}
    for name, wave in waves.items():
        settled = wave[200:]
        errors = half_cycles(settled, crossings(settled), period).errors
        assert errors[name] < 3e-3  # of the power: the grid of vertices and lags is that coarse
        others = {"sine", "triangle", "relay"} - {name}
        assert min(errors[other] for other in others) > 3 * errors[name]


def test_movements_of_a_valve_that_sticks_half_of_the_time():
    op = np.abs((TIME % 64) - 32)
    position = np.clip(np.abs(((TIME - 8) % 64) - 32), 8, 24)  # rests after each reversal
    found = movement_indices(op, position, 64.0)
    assert found == pytest.approx((0.5, 0.5), abs=2 / 16)  # at a reversal OP rests, too
    assert movement_indices(op, op, 64.0) == pytest.approx((0.0, 0.0), abs=0.03)


def test_commands_of_many_pairs_of_S_and_J_move_the_stem_as_those_of_one():
    command = np.cumsum(np.random.default_rng(3).standard_normal(300))
    stick, jump = np.array([0.0, 2.0, 3.0, 3.0]), np.array([0.0, 0.5, 0.0, 3.0])
    moved = kano_rows(command, stick, jump, {0: 1.0})
    for row, S, J in zip(moved, stick, jump, strict=True):
        assert np.allclose(row, kano(command, S, J, start=1.0))
    # on a ramp the last move is up: to be told so changes nothing, the contrary puts the stem down
    ramp = np.arange(20.0)
    plain, up, down = (
        kano_rows(ramp, stick, jump, {0: 1.0, **more}) for more in ({}, {12: 1.0}, {12: -1.0})
    )
    assert np.array_equal(plain, up)
    assert np.array_equal(plain[:, :12], down[:, :12])
    assert np.allclose(down[:, 12], 12 + (stick - jump) / 2)


@pytest.mark.parametrize("process", ["flow", "integrating"])
def test_the_fit_finds_the_stiction_of_a_simulated_loop_and_none_in_a_linear_one(process):
    sticking = cr.bench.valve_loop(cr.actuators.KanoStiction(5, 2), process=process, noise=0.05)
    period = {"flow": 15.0, "integrating": 100.0}[process]
    linear = cr.bench.valve_loop(process=process, oscillation=(2.0, period), noise=0.05)
    for loop, truth in ((sticking, 5.0), (linear, 0.0)):
        record = loop.simulate(15 * period, rng=1).record
        found = cr.valves.diagnose_loop(record, process=process)
        assert found.verdict == (STICKS if truth else NOT_SO)
        fit = found.stiction_fit
        # of the swing: a linear loop has a stem that could stick by as much unseen
        assert abs(fit.S - truth) < 0.1 * truth + 0.25 * (truth == 0) * fit.swing
        assert fit.S_range[0] <= fit.S <= fit.S_range[1]
        if truth:  # the model of valve and process is the true one, and the noise white
            assert fit.independent
            assert pytest.approx(truth, rel=0.01) == fit.S
            assert fit.S_range[0] <= truth <= fit.S_range[1] < 1.1 * truth
            assert fit.J_range[0] <= 2 <= fit.J_range[1] < 5
        assert (fit.significance > 2 and fit.error < 0.7 * fit.linear_error) == (truth > 0)
        assert fit.gain > 0
    if process == "flow":
        assert diagnosed(-record.input, record.output).stiction_fit.gain < 0


WORLDS = [  # beside those above
    (STICKS, "first-order", 1500.0, {"actuator": cr.actuators.KanoStiction(8, 4), "noise": 0.1}),
    (NOT_SO, "first-order", 1500.0, {"oscillation": (2.0, 60.0), "noise": 0.1}),
    # of a level at the limit of stability only the fit says that it does not stick; a flow has six
    # samples in a cycle
    (NOT_SO, "first-order", 1500.0, {"tightness": 0.97, "noise": 0.3}),
    ("cannot tell", "integrating", 2500.0, {"tightness": 0.97, "noise": 0.3}),
    ("no oscillation", "flow", 900.0, {"noise": 0.3}),
    ("no oscillation", "first-order", 1500.0, {"noise": 0.3}),
    ("no oscillation", "integrating", 2500.0, {"noise": 0.3}),
]


@pytest.mark.parametrize(("truth", "process", "duration", "options"), WORLDS)
def test_the_cause_of_a_simulated_oscillation_is_told(truth, process, duration, options):
    kind = "self-regulating" if process == "first-order" else process
    if "tightness" in options:  # of the limit of stability
        margin = cr.design.margins(cr.bench.valve_loop(process=process).open_loop).gain_margin
        options = options | {"tightness": options["tightness"] * margin}
    loop = cr.bench.valve_loop(process=process, **options)
    record = loop.simulate(duration, rng=0).record
    assert cr.valves.diagnose_loop(record, process=kind).verdict == truth


def test_units_and_directions_do_not_matter():
    loop = cr.bench.valve_loop(cr.actuators.KanoStiction(5, 2), process="flow", noise=0.1)
    record = loop.simulate(600.0, rng=4).record
    first = diagnosed(record.input, record.output)
    other = cr.valves.diagnose_loop(-40 * record.input - 3, 0.01 * record.output, 7.0, dt=0.1)
    assert other.period == pytest.approx(0.1 * first.period)
    assert other.apparent_stiction == pytest.approx(40 * first.apparent_stiction)
    for one, two in zip(first.methods, other.methods, strict=True):
        assert (one.key, one.verdict) == (two.key, two.verdict)
        assert one.index == pytest.approx(two.index, rel=1e-6, nan_ok=True)
    assert first.verdict == other.verdict == STICKS


def test_stiction_is_fitted_in_units_far_apart_and_movements_at_a_valve_that_acts_in_reverse():
    """OP as a fraction and PV in Pa: a threshold of the fit was in the unit of PV."""
    loop = cr.bench.valve_loop(cr.actuators.KanoStiction(5, 2), process="flow", noise=0.1)
    record = loop.simulate(600.0, rng=4).record
    first = diagnosed(record.input, record.output, process="flow")
    other = diagnosed(0.01 * record.input, 1e6 * record.output, process="flow")
    assert other.verdict == first.verdict == STICKS
    # the grids scale with OP: only rounding differs
    sticks = [one.stiction_fit.S for one in (first, other)]
    assert sticks[1] == pytest.approx(0.01 * sticks[0], rel=1e-3)
    reverse = diagnosed(100 - record.input, record.output, process="flow")
    here, there = (one.method("movements") for one in (first, reverse))
    assert there.second_index == pytest.approx(here.second_index, rel=1e-6)


def test_records_that_cannot_tell_say_why():
    t = TIME[:600]
    wave, lagging = np.sin(2 * np.pi * t / 40), np.sin(2 * np.pi * (t - 7) / 40)
    cases = {
        "constant_signal": (np.full(600, 50.0), wave, {}),
        "saturated_output": (np.clip(wave, -0.7, 0.7), lagging, {}),
        "coarse_quantisation": (np.round(2 * wave), lagging, {}),
        "set_point_moves": (wave, lagging, {"sp": 2 * wave}),
        "few_samples_per_cycle": (np.sin(0.4 * np.pi * t), np.sin(0.4 * np.pi * t - 1), {}),
    }
    for code, (op, pv, options) in cases.items():
        found = diagnosed(op, pv, **options)
        assert found.verdict == "cannot tell", code
        assert code in {flag.code for flag in found.flags}
    assert "few_cycles" in {flag.code for flag in diagnosed(wave[:200], lagging[:200]).flags}
    gaps = lagging.copy()
    gaps[100:110], gaps[400] = np.nan, np.inf
    found = diagnosed(wave, gaps)
    assert found.signals.op.size == 490
    assert {flag.code for flag in found.flags[:2]} == {"missing_samples", "filled_samples"}
    line = 0.5 * (lagging[399] + lagging[401])
    assert found.signals.pv[400 - 110] == pytest.approx(line)
    assert diagnosed(wave[:60] * 0, 0.5 ** t[:60]).verdict == "cannot tell"
    assert diagnosed(wave, np.full(600, 3.0)).verdict == "cannot tell"


def test_a_set_point_in_the_record_moves_as_one_that_is_given():
    """A linear PI loop behind a triangle, as of an outer loop, passed for stiction."""
    n = 2600
    wanted = 3 * sawtooth(2 * np.pi * np.arange(n) / 100, 0.5)
    op, pv, left, integral = np.zeros(n), np.zeros(n), 0.0, 0.0
    noise = 0.1 * np.random.default_rng(1).standard_normal(n)
    for k in range(n):
        left = np.exp(-0.1) * left + (1 - np.exp(-0.1)) * (op[k - 2] if k > 1 else 0.0)
        pv[k] = left + noise[k]
        integral += 0.2 * (wanted[k] - pv[k])
        op[k] = 2 * (wanted[k] - pv[k]) + integral
    record = cr.Record(np.arange(2000.0), op[600:], pv[600:], reference=wanted[600:])
    arrays = diagnosed(record.input, record.output, sp=record.reference)
    for found in (cr.valves.diagnose_loop(record), arrays):
        assert found.verdict == "cannot tell"
        assert "set_point_moves" in {flag.code for flag in found.flags}


def test_wrong_arguments_are_refused():
    wave = np.sin(TIME)
    with pytest.raises(DataError, match="expected a Record, or the arrays"):
        cr.valves.diagnose_loop(wave)
    with pytest.raises(DataError, match="equal lengths"):
        diagnosed(wave, wave[1:])
    with pytest.raises(DataError, match="expected at least 24"):
        diagnosed(wave[:20], wave[:20])
    with pytest.raises(DataError, match="one input"):
        cr.valves.diagnose_loop(cr.Record(TIME, wave, np.stack([wave, wave])))
    with pytest.raises(OptionError, match="process"):
        diagnosed(wave, wave, process="level")
    with pytest.raises(OptionError, match="expected one of"):
        diagnosed(wave, wave).method("vote")


@pytest.mark.parametrize(
    ("name", "truth"),
    [("chem1", STICKS), ("pap2", STICKS), ("chem13", NOT_SO), ("pap9", NOT_SO)],
)
def test_measured_loops_have_the_cause_that_the_literature_gives(name, truth):
    record = measured.record(f"valve_loops/{name}")
    assert cr.valves.diagnose_loop(record).verdict == truth
    # and it is no test of a valve, either
    told = cr.valves.valve_report(record, fit=False).verdict
    assert told == "Cannot tell: the records contain no valve test."
