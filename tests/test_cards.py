"""Cards say in words what is no number, whatever the case."""

from __future__ import annotations

import re

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.report.verdict import campaign_verdict

PLANT = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
INTEGRATING = cr.delayed_ss(ct.tf([1], [1, 0]), dead_time=0.1, dt=0.01)
STATIC = cr.delayed_ss(ct.ss([], [], [], [[0.5]], 0.01), 3)


def constant():
    u = np.random.default_rng(0).standard_normal(300)
    return cr.Record(0.001 * np.arange(300), u, np.ones(300))


def untold():
    tracker = cr.DelayTracker(PLANT.replace(delay=4), max_delay=20, memory=3.0)
    return tracker.run(cr.Record(0.001 * np.arange(200), np.zeros(200), np.zeros(200)))


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
    "an output that rests": lambda: cr.check_residuals(PLANT, constant()),
    "a prediction of it": lambda: cr.predict(PLANT, constant(), 3),
    "a tracker without news": untold,
    "a bound that is too large": lambda: cr.design.uncertainty_bound(
        [1.1 * PLANT], PLANT, dead_time_interval=(0.0, 0.5)
    ).check(cr.design.pid(PLANT)),
    "a proportional controller": lambda: cr.design.PIDController(2.0),
}


@pytest.mark.parametrize("case", CASES)
def test_no_card_shows_nan_or_inf(case):
    result = CASES[case]()
    words = re.sub(r"<[^>]*>", " ", result._repr_html_())
    assert not re.search(r"\b(nan|inf)\b", words, re.IGNORECASE), words


def test_the_verdict_on_one_record_knows_no_scatter():
    facts = dict(campaign_verdict(single()).facts)
    assert facts["scatter (std)"] == "unknown: one record has none"
