import re

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.errors import DataError

DT = 0.1
CORE = ct.ss(
    [[0.8, 0.3, 0.0], [-0.3, 0.8, 0.1], [0.0, 0.0, 0.5]],
    [[1.0, 0.2], [0.0, 1.0], [0.5, -1.0]],
    [[1.0, 0.0, 0.3], [0.4, 1.0, 0.0]],
    np.zeros((2, 2)),
    DT,
)
PLANT = cr.DelayedStateSpace(CORE, (2, 5), output_delay=(0, 7))


def record(seed=0, samples=600, noise=0.1, plant=PLANT, scale=1.0, **kwargs):
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], (plant.ninputs, samples)).squeeze()
    y = plant.simulate(u)
    y = 3.0 + y + noise * np.std(y, axis=-1, keepdims=True) * rng.standard_normal(y.shape)
    return cr.Record(DT * np.arange(samples), u, scale * y, **kwargs)


@pytest.fixture(scope="module")
def model():
    return cr.fit_state_space(record())


def test_order_delays_and_direct_term_are_found(model):
    fit = model.fit
    assert (fit.order, fit.input_delays, fit.output_delays, fit.feedthrough) == (
        3,
        (2, 5),
        (0, 7),
        False,
    )
    assert (model.input_delays, model.output_delays) == ((2, 5), (0, 7))
    assert fit.flags == ()
    # noise of a tenth of the output, 600 samples, 12 parameters: about 1 % of the response
    truth = PLANT.markov(80)
    assert np.abs(model.markov(80) - truth).max() < 0.02 * np.abs(truth).max()
    # the size of the noise to 3 x 3 %
    assert_allclose(fit.fit_percent, 100 * (1 - 0.1 / np.sqrt(1.01)), rtol=0, atol=0.9)


@pytest.mark.parametrize("missing", [False, True])
def test_a_drift_of_an_output_leaves_its_gains(missing):
    """Of ten records nine had a pole at 1 in place of the drift, and gains of -2400 to 15 500."""
    time = np.arange(800.0)
    plants = [
        cr.delayed_ss(ct.tf([1.0], [5, 1]), dead_time=3, dt=1.0),
        cr.delayed_ss(ct.tf([0.5], [8, 1]), dead_time=6, dt=1.0),
    ]
    rng = np.random.default_rng(14)
    u = np.repeat(rng.choice([-1.0, 1.0], (2, 200)), 4, axis=1)
    y = sum(one.simulate(row) for one, row in zip(plants, u, strict=True)) + time / 800
    y += 0.05 * rng.standard_normal(800)
    y[300:340] = np.nan if missing else y[300:340]
    sys = cr.fit_state_space(cr.Record(time, u, y, missing="keep" if missing else "refuse"))
    assert_allclose(np.ravel(sys.dcgain()), [1.0, 0.5], rtol=0, atol=0.03)  # 3 standard errors
    told = [str(flag) for flag in sys.fit.flags if flag.code == "drift"]
    rate = float(re.search(r"a drift of (\S+) per s", told[0])[1])
    assert rate == pytest.approx(1 / 800, rel=0.05)
    assert all(check.independent and check.white for check in sys.fit.checks)


def test_an_output_without_samples_is_refused():
    data = record()
    y = np.stack([data.output[0], np.full(data.n_samples, np.nan)])
    with pytest.raises(DataError, match="0 samples have a complete past"):
        cr.fit_state_space(cr.Record(data.time, data.input, y, missing="keep"))


@pytest.mark.parametrize("units", [(1e-6, 1e6), (1e6, 1e-6), (1e-9, 1e9)])
def test_units_of_the_outputs_change_nothing_else(model, units):
    """Orders were 2 for 5, and delays (0, 2) and (0, 11) for (3, 5) and (0, 7)."""
    data = record()
    scaled = cr.Record(data.time, data.input, np.reshape(units, (2, 1)) * data.output)
    found = cr.fit_state_space(scaled)
    assert (found.fit.order, found.fit.input_delays, found.fit.output_delays) == (3, (2, 5), (0, 7))
    same = found.markov(40) / np.reshape(units, (2, 1, 1))
    assert_allclose(same, model.markov(40), rtol=0, atol=1e-4)  # where the fits end


def test_the_headline_of_a_report_has_the_delay_of_every_pair(model):
    """It had the largest, 12 samples, as the dead time of all of them."""
    headline = cr.report.verdict_of(model).headline
    delays = [inputs + outputs for outputs in (0, 7) for inputs in (2, 5)]  # of `PLANT`
    said = re.match(r"Delays of ([\d,; ]+) samples of 100 ms, ", headline).group(1)
    assert [int(one) for one in re.findall(r"\d+", said)] == delays
    assert "Dead time" not in headline


@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_a_report_says_that_the_measured_line_has_no_drift(tmp_path, rate):
    """The line was called measured, and was off by the drift that was taken from it."""
    still = record()
    moved = cr.Record(still.time, still.input, still.output + rate * still.time)
    path = cr.report.write_identification(tmp_path / "a.html", cr.fit_state_space(moved, 3), moved)
    told = "Measured and simulated, both without the drift of the remarks." in path.read_text()
    assert told == (rate > 0)


def test_several_records_and_missing_outputs_are_used():
    first, second = record(2, 300), record(3, 300)
    y = second.output + 40.0
    y[0, 100:120] = np.nan
    gaps = cr.Record(second.time, second.input, y, missing="keep")
    found = cr.fit_state_space([first, gaps], 3)
    assert found.fit.input_delays == (2, 5)
    assert len(found.fit.checks) == 1
    truth = PLANT.markov(80)
    assert np.abs(found.markov(80) - truth).max() < 0.04 * np.abs(truth).max()


def test_a_direct_term_is_found_or_asked_for():
    core = ct.ss(CORE.A, CORE.B, CORE.C, [[2.0, 0.0], [0.0, 0.0]], DT)
    assert cr.fit_state_space(record(plant=cr.DelayedStateSpace(core, 0)), 3).fit.feedthrough
    with_term = cr.fit_state_space(record(), 3, feedthrough=True)
    without = cr.fit_state_space(record(), 3, feedthrough=False)
    assert with_term.fit.feedthrough
    assert np.any(with_term.delay_free.D)
    assert not without.fit.feedthrough
    assert not np.any(without.delay_free.D)


def test_another_start_is_tried_where_the_first_leads_nowhere():
    # a chirp: the slow beginning, by which a lag shows, is past only for a FIR of 100 lags
    t = 0.05 * np.arange(600)
    plant = cr.delayed_ss(ct.ss([[0.97]], [[1.0]], [[0.03]], [[0.0]], 0.05), 20)
    y = plant.simulate(np.sin(t**2))
    y = y + 0.01 * y.std() * np.random.default_rng(0).standard_normal(t.size)
    found = cr.fit_state_space(cr.Record(t, np.sin(t**2), y), [1, 2])
    assert (found.fit.order, found.delay) == (1, 20)


def test_an_integrator_beside_a_lag_that_is_left_out_is_told_with_what_finds_it():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 10)
    plant = cr.delayed_ss(ct.tf([0.1], [10, 1, 0]), dead_time=3, dt=1.0)
    data = cr.Record(np.arange(600.0), u, plant.simulate(u) + 0.05 * rng.standard_normal(600))
    (flag,) = (f for f in cr.fit_state_space(data, 1).fit.flags if f.code == "coloured_residual")
    assert "use fit_output_error" in str(flag)
    found = cr.identify(data)
    assert found.fit.interval[0] <= 3 <= found.fit.interval[1]
    assert_allclose(np.ravel(found.markov(100))[-1], 0.1, rtol=0.05)


@pytest.mark.parametrize("constant", [True, False])
def test_inputs_that_do_not_excite_are_refused(constant):
    first = record()
    u = np.ones_like(first.input) if constant else np.stack([first.input[0]] * 2)
    why = r"the input 'u\[0\]' is constant" if constant else "does not excite"
    with pytest.raises(DataError, match=why):
        cr.fit_state_space(cr.Record(first.time, u, first.output))


def test_refining_brings_a_rough_model_to_the_fit(model):
    core = ct.ss(CORE.A * 0.9, 0.5 * CORE.B, CORE.C, CORE.D, DT)
    rough = cr.DelayedStateSpace(core, (2, 5), output_delay=(0, 7))
    found = cr.identification.refine_state_space(rough, record())
    assert found.fit.order == 3
    expected = model.markov(60)
    assert_allclose(found.markov(60), expected, rtol=0, atol=2e-3 * np.abs(expected).max())
    assert rough.delay_free.B[0, 0] == 0.5


@pytest.mark.parametrize("seed", [100, 104, 105])
def test_a_short_record_is_fitted_from_the_better_of_two_starts(seed):
    # the first start alone ended at an integrator (100), or all were refused: "no output responds"
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 31), 3)[:90]
    plant = cr.delayed_ss(ct.tf([2.0], np.polymul([1, 0.6, 1], [0.5, 1])), 3, dt=0.1)
    y = plant.simulate(u)
    y = 5 + y + 0.05 * y.std() * rng.standard_normal(90)
    found = cr.fit_state_space(cr.Record(0.1 * np.arange(90), u, y))
    z = np.exp(0.1j * np.geomspace(0.29, 25.0, 60))  # from the lowest frequency of the record on
    truth = plant(z)
    # noise of 5 % and 90 samples leave 1 to 5 % of the peak
    assert np.abs(found(z) - truth).max() < 0.1 * np.abs(truth).max()


@pytest.mark.parametrize("seed", range(6, 10))
def test_noise_beside_a_short_input_shows_no_response(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 31), 3)[:90]
    with pytest.raises(DataError, match="no output shows a response"):
        cr.fit_state_space(cr.Record(0.1 * np.arange(90), u, rng.standard_normal(90)))


@pytest.mark.parametrize(("pole", "order", "seed"), [(1.003, 3, 0), (1.01, 5, 1), (1.0, 2, 0)])
def test_slow_poles_that_imitate_an_unstable_plant_are_told(pole, order, seed):
    # they follow 99 % of the output; of the second a drift of 5000 times its range was told instead
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 101), 4)[:400]
    y = lfilter([0, 0, 0, 0, 0.05], [1, -pole], u) + 0.02 * rng.standard_normal(400)
    found = cr.fit_state_space(cr.Record(0.1 * np.arange(400), u, y), order)
    assert ("unstable" in [flag.code for flag in found.fit.flags]) == (pole > 1)


def test_gains_that_slow_noise_made_are_named_with_what_tells_them():
    # -1.3e4 and -6.9e4 for gains of 2 and -1.2, beside the word that the order may be too high
    rng = np.random.default_rng(7)
    u = np.repeat(rng.choice([-1.0, 1.0], (2, 40)), 20, axis=1)
    plants = (2.0, 20.0, 5), (-1.2, 30.0, 3)
    y = sum(
        cr.delayed_ss(ct.tf([gain], [lag, 1]), delay, dt=1.0).simulate(own)
        for (gain, lag, delay), own in zip(plants, u, strict=True)
    )
    y = y + 0.3 * lfilter([np.sqrt(1 - 0.81)], [1, -0.9], rng.standard_normal(800))
    record = cr.Record(np.arange(800.0), u, y)
    flags = {flag.code: str(flag) for flag in cr.identify(record).fit.flags}
    assert "data end too early to determine the gain" in flags["not_died_away"]
    assert "identify(record, structures='FOPDT')" in flags["coloured_residual"]
    gains = cr.identify(record, structures="FOPDT").dcgain().ravel()
    # half widths of their 95 % intervals: 0.10 and 0.13
    np.testing.assert_allclose(gains, [2, -1.2], rtol=0, atol=0.13)


def test_delays_of_no_channel_are_refused():
    u, noise = np.random.default_rng(0).standard_normal((2, 300))
    record = cr.Record(np.arange(300.0), u, u + 0.1 * noise)
    with pytest.raises(cr.errors.DelayRangeError, match="not all -1"):
        cr.fit_state_space(record, 1, delays=[[-1]])


def test_the_order_of_the_inputs_makes_no_other_model():
    # the second input reaches the first output a sample later: the sample may be shared out to
    # the inputs or to the outputs, and with the inputs swapped a model of order 3 was the end
    core = ct.ss([[0.8, 0.1], [0, 0.5]], [[1, 0], [1, 1]], [[1, 0], [1, 1]], np.zeros((2, 2)), DT)
    rng = np.random.default_rng(1)
    u = rng.choice([-1.0, 1.0], (2, 400))
    y = cr.DelayedStateSpace(core, (2, 5)).simulate(u) + 0.1 * rng.standard_normal((2, 400))
    first = cr.Record(DT * np.arange(400), u, y)
    turned = cr.Record(first.time, first.input[::-1], first.output)
    here, there = (cr.fit_state_space(one, [1, 2, 3]) for one in (first, turned))
    assert (here.fit.order, there.fit.order) == (2, 2)
    assert here.input_delays == there.input_delays[::-1] == (2, 5)
    # both have converged to 1e-6 of the log likelihood, a thousandth of a standard error
    assert_allclose(there.markov(60)[:, ::-1], here.markov(60), rtol=0, atol=1e-4)
