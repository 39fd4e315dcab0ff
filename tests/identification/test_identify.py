"""One call from record to model."""

from __future__ import annotations

import pickle

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import paper
from ctrl_realize.errors import DelayRangeError, NoStepError, OptionError
from ctrl_realize.identification import identify as identify_module
from tests.rigs import R3, TS, step_record


def test_the_papers_settings_are_those_of_the_paper():
    # The layer below cannot read ctrl_realize.paper; the two must not drift apart.
    settings = paper.SETTINGS
    assert settings.order == identify_module.PAPER_ORDER
    assert settings.samples == identify_module.PAPER_SAMPLES
    assert settings.max_delay == identify_module.PAPER_MAX_DELAY
    assert settings.cutoff_hz == identify_module.PAPER_CUTOFF_HZ


def test_the_papers_method_is_the_paper_step_by_step():
    record = step_record(noise=1e-3, seed=4)
    g = cr.impulse_from_step(
        cr.unit_step(record), cutoff_hz=50.0, zero_phase=False, difference="central"
    )
    by_hand = cr.estimate_delay(g, 3, max_delay=100, samples=1000, feedthrough=True)
    at_once = cr.identify(record, method="paper")
    assert at_once.delay == by_hand.delay
    assert_allclose(at_once.markov(1101), by_hand.markov(1101), rtol=0, atol=0)
    assert isinstance(at_once.fit, cr.identification.DelayScan)


def test_the_paper_is_13_samples_late_and_says_so():
    # paper.md 4.1: at 0.1 % noise the causal scan is +12.9 +- 2.2 samples off on this plant.
    sys = cr.identify(step_record(noise=1e-3, seed=1), method="paper")
    assert 37 + 12.9 - 4 * 2.2 < sys.delay < 37 + 12.9 + 4 * 2.2
    assert any(flag.code == "filter_delay" for flag in sys.fit.flags)
    assert "13.1 samples" in sys.fit.report()


@pytest.mark.parametrize("method", ["scan", "paper"])
def test_a_scan_returns_the_model_with_names_choices_and_every_step(method):
    record = cr.Record(
        step_record().time,
        step_record().input,
        step_record(noise=1e-3).output,
        name="valve.16mA",
        input_labels=["i"],
        output_labels=["x"],
    )
    sys = cr.identify(record, method=method)
    assert isinstance(sys, ct.StateSpace)
    assert (sys.name, sys.input_labels, sys.output_labels) == ("valve_16mA", ["i"], ["x"])
    assert sys.fit.impulse.step.record is record
    assert all(choice in sys.fit.report() for choice in sys.fit.choices)
    assert pickle.loads(pickle.dumps(sys)).fit.delay == sys.fit.delay


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"method": "magic"}, OptionError, "'output_error', 'scan', 'paper'"),
        ({"method": "scan", "known": R3}, OptionError, "known: not for method='scan'"),
        ({"method": "output_error", "samples": 5}, OptionError, "samples: not for method"),
        ({"method": "paper", "max_delay": 5000}, DelayRangeError, "need 6001 samples"),
        ({"method": "scan", "order": 0}, OptionError, ">= 1"),
        ({"order": 0}, OptionError, "order=0"),
        ({"order": 9}, OptionError, "order=9"),
        ({"order": 2, "structures": [(1, 1)]}, OptionError, "not both"),
        ({"method": "scan", "max_delay": -1}, OptionError, ">= 0"),
        ({"method": "scan", "max_delay": 10**6}, DelayRangeError, "needs more than"),
    ],
)
def test_unusable_choices_are_refused(options, error, match):
    with pytest.raises(error, match=match):
        cr.identify(step_record(), **options)


@pytest.mark.parametrize("method", ["output_error", "scan", "paper"])
def test_a_step_at_the_last_sample_is_refused_by_every_method(method):
    t = TS * np.arange(2000)
    u = np.zeros(2000)
    u[-1] = 5.0
    noise = np.random.default_rng(0).standard_normal(2000)
    with pytest.raises(NoStepError, match="nothing was recorded after it"):
        cr.identify(cr.Record(t, u, noise), method=method)
