"""Cards say in words what is no number, whatever the case."""

import copy
import pickle
import re

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests.rigs import R1, step_record

PLANT = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
INTEGRATING = cr.delayed_ss(ct.tf([1], [1, 0]), dead_time=0.1, dt=0.01)
STATIC = cr.delayed_ss(ct.ss([], [], [], [[0.5]], 0.01), 3)


def constant():
    u = np.random.default_rng(0).standard_normal(300)
    return cr.Record(0.001 * np.arange(300), u, np.ones(300))


def untold():
    tracker = cr.DelayTracker(PLANT.replace(delay=4), max_delay=20, forgetting_time=3.0)
    return tracker.track(cr.Record(0.001 * np.arange(200), np.zeros(200), np.zeros(200)))


def single():
    return cr.identify_campaign([cr.bench.valve().step_record(16, rng=1)], method="scan")


CASES = {
    "a campaign of one record": single,
    "a loop that is unstable": lambda: cr.design.margins(PLANT, 100 * cr.design.pid(PLANT)),
    "a loop without crossover": lambda: cr.design.margins(0.01 * PLANT),
    "an integrator": lambda: INTEGRATING,
    "a gain without states": lambda: STATIC,
    "a continuous gain": lambda: cr.design.to_continuous(STATIC),
    "an integrating process": lambda: cr.design.reduce_fopdt(INTEGRATING),
    "an output that rests": lambda: cr.validation.analyse_residuals(PLANT, constant()),
    "a prediction of it": lambda: cr.validation.predict(PLANT, constant(), 3),
    "a tracker without news": untold,
    "a bound that is too large": lambda: cr.design.uncertainty_bound(
        [1.1 * PLANT], PLANT, dead_time_interval=(0.0, 0.5)
    ).check(cr.design.pid(PLANT)),
    "a proportional controller": lambda: cr.design.PIDController(2.0),
}


IMPULSE = cr.ImpulseResponse(PLANT.markov(300), PLANT.dt)
STEP = step_record(R1, noise=1e-3, before=150, after=400)
OMEGA = np.geomspace(0.5, 60, 30)
FRF = cr.MeasuredFRF(PLANT(np.exp(1j * OMEGA * PLANT.dt)), OMEGA / 2 / np.pi)
NOISE = np.random.default_rng(0).standard_normal((30, 2)) @ [0.01, 0.01j]
NOISY = cr.MeasuredFRF(FRF.complex + NOISE, FRF.frequency_hz, std=np.full(30, 0.014))


def driven():
    u = np.random.default_rng(1).standard_normal(400)
    y = PLANT.simulate(u) + 1e-3 * np.random.default_rng(2).standard_normal(400)
    return cr.Record(0.001 * np.arange(400), u, y)


def one_lag(record):
    return cr.fit_output_error(record, structures=[(1, 1)])


RESULTS = {
    "a fit of several records": lambda: one_lag([STEP, STEP]).fit,
    "a scan of orders": lambda: cr.scan_orders(IMPULSE, 2, max_delay=60),
    "an impulse response": lambda: cr.impulse_from_io(driven(), 60, method="least_squares"),
    "a frequency response": lambda: FRF,
    "a comparison": lambda: cr.compare_frf(PLANT, FRF),
    "margins": lambda: cr.design.margins(PLANT, cr.design.pid(PLANT)),
    "a check of residuals": lambda: cr.validation.analyse_residuals(PLANT, driven()),
    "a check of the delay": lambda: cr.validation.compare_delay_estimates(frf=NOISY),
    "a record": lambda: STEP,
    "a step response": lambda: cr.unit_step(STEP),
    "a system": lambda: PLANT,
}


def assert_says_itself(result):
    """In a line, and with units in a report; and comes back the same from a pickle."""
    line = repr(result)
    assert "\n" not in line
    assert not re.search(r"\b(nan|inf)\b", line)
    twin = pickle.loads(pickle.dumps(result))
    assert type(twin) is type(result)
    assert repr(twin) == line
    if hasattr(result, "report"):
        report = result.report()
        assert twin.report() == report
        title, *rows = report.splitlines()
        assert title.strip()
        assert rows
        # a name and its value apart, a choice, or a flag
        assert all(re.match(r"  ([-!] |\S.*\S  +\S| +\S)", row) for row in rows), report
        assert not re.search(r"\b(nan|inf)\b", report)


@pytest.mark.parametrize("case", RESULTS)
def test_a_result_says_itself_in_a_line_and_with_units_in_a_report_and_comes_back(case):
    assert_says_itself(RESULTS[case]())


@pytest.mark.parametrize("case", CASES)
def test_no_card_shows_nan_or_inf(case):
    result = CASES[case]()
    words = re.sub(r"<[^>]*>", " ", result._repr_html_())
    assert not re.search(r"\b(nan|inf)\b", words, re.IGNORECASE), words


def test_a_copy_of_what_a_fit_estimated_can_be_shown():
    """Its line asked the copy for a function that it does not have: AttributeError."""
    estimate = cr.identify(STEP, structures="FOPDT").fit.estimate
    assert type(pickle.loads(pickle.dumps(estimate))).__name__ in repr(copy.deepcopy(estimate))
