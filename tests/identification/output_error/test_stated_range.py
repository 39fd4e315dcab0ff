"""What the user states beforehand: a fastest lag, a range of the dead time; what that gains."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from tests.rigs import codes

DEAD_TIME, LAGS = 4.6, (20.0, 8.9)


def step_record(seed=0, lags=LAGS, noise=0.002, dead_time=DEAD_TIME):
    """Lags behind a dead time, 40 s at rest and 160 s after a step; a sample a second."""
    t = np.arange(200.0)
    since = np.clip(t - 40 - dead_time, 0, None)
    poles = -1 / np.array(lags)
    y = np.ones(t.size)
    for i, pole in enumerate(poles):
        others = np.delete(poles, i)
        y += np.prod(-poles) / (pole * np.prod(pole - others)) * np.exp(pole * since)
    rng = np.random.default_rng(seed)
    return cr.Record(t, t >= 39.5, y + noise * rng.standard_normal(t.size))


@pytest.fixture(scope="module")
def record():
    return step_record()


@pytest.fixture(scope="module")
def plain(record):
    return cr.identify(record).fit


def width(fit):
    return fit.interval[1] - fit.interval[0]


def test_no_fast_lag_narrows_the_interval_which_holds(record, plain):
    fit = cr.identify(record, fastest_lag=5.0).fit
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    assert width(fit) < 0.8 * width(plain)
    # Poles that coincide are set apart by a hundredth.
    assert all(np.abs(line.poles).max() <= 1.05 / 5.0 for line in fit.structures)
    assert "if no lag is faster than 5 s (stated)" in fit.report()
    assert fit.interval_kind == "conditional"
    assert fit.stated.fastest_lag == 5.0


def test_a_stated_lag_that_the_data_contradict_is_told(record):
    fit = cr.identify(record, fastest_lag=16.0, structures=[(1, 1), (2, 2)]).fit
    assert "apparent_dead_time" in codes(fit)
    assert fit.better is not None
    assert "no lag is faster than 16 s was stated, and the data contradict it" in fit.report()


def test_lags_that_are_alike_are_in_the_transfer_function():
    """All of four lags of about 20 s were left out, since none of them is known."""
    fit = cr.identify(step_record(lags=(30.0, 12.0)), fastest_lag=20.0).fit
    assert fit.order > 1
    assert fit.formula.partition("/ (")[2].count("s + 1") == fit.order


def test_a_stated_range_bounds_the_search(record, plain):
    system = cr.identify(record, dead_time=(4.0, 5.0))
    assert system.fit.interval == (4.0, 5.0) or width(system.fit) < 1.0
    assert width(plain) > 1.0
    assert "within 4.00 to 5.00 s (stated)" in system.fit.report()
    assert not codes(system) & {"delay_at_bound", "parameter_at_bound"}


@pytest.mark.parametrize("within", [(0.0, 1.0), (9.0, 12.0)])
def test_a_stated_range_that_the_data_contradict_is_told(record, within):
    fit = cr.identify(record, dead_time=within, structures=[(2, 2)]).fit
    low, high = fit.interval
    assert within[0] <= low <= fit.dead_time <= high <= within[1]
    assert "parameter_at_bound" in codes(fit)
    assert "the data contradict it" in fit.report()


def test_a_contradicted_range_is_told_though_the_dead_time_is_not_at_its_end():
    # a zero and a fast lag make up for 9 s too many: 19.92 s in 19.3 to 25.4 s, all verdicts good
    t, rng = np.arange(222.0), np.random.default_rng(5)
    slow, fast, after = 23.8, 6.6, np.clip(np.arange(222.0) - 60.2, 0, None)
    response = 1 - (slow * np.exp(-after / slow) - fast * np.exp(-after / fast)) / (slow - fast)
    record = cr.Record(t, 10.0 * (t >= 50), 20 * response + 0.1 * rng.standard_normal(222))
    fit = cr.identify(record, dead_time=(19.3, 25.4)).fit
    assert fit.dead_time > 19.8
    assert "the data contradict it" in fit.report()
    assert "good" not in {verdict.level for verdict in fit.verdicts}


def test_statements_hold_for_any_input_and_for_a_frequency_response():
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], 40), 10)
    lags = ct.tf([1], [LAGS[0], 1]) * ct.tf([1], [LAGS[1], 1])
    y = cr.delayed_ss(lags, dead_time=DEAD_TIME, dt=1.0).simulate(u) + 0.01 * rng.standard_normal(
        u.size
    )
    record = cr.Record(np.arange(u.size, dtype=float), u, y)
    few = {"structures": [(1, 1), (2, 2)]}
    free = cr.fit_output_error(record, **few).fit
    fit = cr.identify(record, fastest_lag=5.0, dead_time=(3.0, 4.7), **few).fit
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1] <= 4.7
    assert width(fit) <= width(free)
    hz = np.geomspace(2e-3, 0.1, 20)
    noise = 0.01 * rng.standard_normal((20, 2)) @ [1, 1j]
    s = 2j * np.pi * hz
    values = np.exp(-DEAD_TIME * s) / np.prod([lag * s + 1 for lag in LAGS], axis=0)
    frf = cr.MeasuredFRF(values + noise, hz)
    both = cr.identify(step_record(), frf=frf, order=2, dead_time=(4.0, 5.0)).fit
    assert 4.0 <= both.interval[0] <= DEAD_TIME <= both.interval[1] <= 5.0
    assert "(stated)" in both.report()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"dead_time": (3.0, 2.0)}, "0 <= low < high"),
        ({"dead_time": 3.0}, "expected two numbers"),
        ({"fastest_lag": -1.0}, "expected a positive time in s"),
        ({"fastest_lag": 1.0, "structures": "P2D"}, "bounds of a ProcessStructure"),
        ({"dead_time": (1.0, 2.0), "structures": "P1"}, "'P1' with dead_time; expected an order"),
        ({"dead_time": (1.0, 2.0), "max_delay": 3}, "max_delay with"),
        ({"dead_time": (1.0, 2.0), "actuator": "auto"}, "actuator with"),
        ({"dead_time": (1.0, 2.0), "method": "scan"}, "not an argument of method='scan'"),
    ],
)
def test_wrong_statements(record, options, said):
    with pytest.raises(OptionError, match=said):
        cr.identify(record, **options)


@pytest.mark.parametrize("ends", [(4.0, 5.0), (6.0, 8.0)])
def test_a_process_model_takes_a_range_as_its_own_bounds(record, ends):
    stated = cr.identify(record, structures="P2D", dead_time=ends).fit
    bounded = cr.identification.ProcessStructure("P2D", bounds={"dead_time": ends})
    fit = cr.identify(record, structures=bounded).fit
    # the same minimum, to what its search leaves; beyond it the misfit is weighted otherwise
    binds = fit.dead_time == ends[0]
    assert stated.dead_time == pytest.approx(fit.dead_time, abs=1e-6 * fit.dt)
    difference = fit.gain_std_given_structure if binds else 1e-8
    assert stated.gain == pytest.approx(fit.gain, abs=difference)
    assert ends[0] <= stated.interval[0] <= stated.interval[1] <= ends[1]


def test_a_campaign_passes_statements_on(record):
    campaign = cr.identify_campaign([record], dead_time=(4.0, 5.0), structures=[(2, 2)])
    row = campaign.table().iloc[0]
    assert 4.0 <= row["delay"] <= 5.0
    assert not row["error"]


def test_a_second_line_tells_the_interval_without_short_lags():
    """A fit that is told that there are none gives the same, by other means."""
    record = step_record(0, (20.0,), 0.05, 6.2)
    fit = cr.identify(record).fit
    lag, (low, high) = fit.interval_without_short_lags
    assert lag < 20
    assert low <= 6.2 <= high == fit.interval[1]
    assert high - low < 0.7 * width(fit)
    assert "if no lag is faster than" in fit.report()
    stated = cr.identify(record, fastest_lag=lag).fit
    assert low - 0.1 * (high - low) <= stated.interval[0]
    assert stated.interval_without_short_lags is None
