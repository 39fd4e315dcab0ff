"""estimate_delay: the dense answers, the conventions and the flags."""

import re

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.numerics.state_space.responses import markov
from tests.oracles import dense
from tests.oracles.plants import modal, valve_pulse
from tests.rigs import TS, codes

KINDS = ["clean", "zero-phase", "causal", "unfiltered"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("seed", "noise"), [(1, 2e-3), (2, 2e-2)])
def test_truncated_scan_is_the_dense_scan(kind, seed, noise):
    pulse = valve_pulse(kind, seed=seed, noise=noise, n=361)
    delays = np.arange(0, 61, 10)
    scan = cr.estimate_delay(pulse, 3, max_delay=60, samples=300, dt=TS).fit
    misfit, values = dense.scan(pulse, delays, 300, [3], 361)
    allowed = 1e-11 * np.abs(pulse).sum() + 1e-9 * misfit[0]  # the promise of the docstring
    assert np.all(np.abs(scan.iae[delays] - misfit[0]) <= allowed)
    assert_allclose(scan.singular_values[delays], values, rtol=0, atol=1e-10 * values[:, :1].max())


@settings(max_examples=15)
@given(delay=st.integers(0, 40), seed=st.integers(0, 1000), order=st.integers(1, 4))
def test_a_delay_of_d_samples_is_found_as_d(delay, seed, order):
    A, B, C, D = modal(np.random.default_rng(seed), order)
    pulse = np.r_[np.zeros(delay), markov(A, B, C, D, 300)[0, 0]]  # D is not zero: one answer
    sys = cr.estimate_delay(pulse, order, max_delay=50, dt=0.1)
    assert sys.delay == delay
    assert sys.dead_time == delay * 0.1


@pytest.mark.parametrize("delay", [0, 1, 37])
def test_of_the_two_exact_delays_of_a_strictly_proper_plant_the_smaller_is_found(delay):
    sys = cr.estimate_delay(valve_pulse("clean", delay=float(delay)), 3, max_delay=50, dt=TS)
    assert sys.delay == delay
    assert sys.fit.delay_interval == (delay, delay + 1)


def test_strictly_proper_models_have_no_direct_term():
    pulse = valve_pulse("zero-phase", n=360)
    sys = cr.estimate_delay(pulse, 3, max_delay=40, samples=300, feedthrough=False, dt=TS)
    scan = sys.fit
    assert not scan.feedthrough
    assert sys.delay_free.D == 0 != pulse[scan.delay]
    other = cr.realize(pulse, 3, delay=30, samples=300, feedthrough=False, dt=TS)
    assert other.delay_free.D == 0
    assert np.abs(pulse[:341] - other.markov(341)).sum() == pytest.approx(scan.iae[30], rel=1e-9)


# -- what the scan says about itself ---------------------------------------------------------


# -- input that cannot be used ---------------------------------------------------------------


def test_a_causal_filter_is_named_with_its_delay():
    causal = cr.data.FilterSpec(5, 50.0, zero_phase=False, dt=TS)
    fit = cr.estimate_delay(
        cr.ImpulseResponse(valve_pulse("causal"), TS, filter=causal), 3, max_delay=100
    ).fit
    assert "filter_delay" in codes(fit)
    assert "13.1 samples" in fit.report()


def test_the_report_tells_the_part_of_the_gain_that_is_before_the_delay():
    # what a zero-phase filter moves ahead of the delay is not realized: 2 % of the gain and more
    t = 0.01 * np.arange(400)
    y = -2 * np.expm1(-np.clip(t - 0.63, 0, None) / 0.2)
    record = cr.Record(
        t, (t >= 0.5) + 0.0, y + 4e-4 * np.random.default_rng(0).standard_normal(400)
    )
    model = cr.identify(record, method="scan")
    left = float(re.search(r"before the delay +([\d.]+) %", model.fit.report())[1])
    markov, delay = model.fit.impulse.markov, model.fit.delay
    # two digits are shown
    assert left == pytest.approx(100 * markov[:delay].sum() / markov.sum(), rel=0.05)
    assert left > 1
    assert model.dcgain() < 2 * (1 - 0.01)


@pytest.mark.parametrize(
    "lags", [(5.0, 8.0, 20.0, 30.0), (4, 6, 10, 20, 30), (3, 4, 6, 10, 20, 30)]
)
def test_the_delay_of_exact_data_depends_on_no_scale_or_sign(lags):
    # d and d + 1 are exact (see Notes), up to the stated accuracy
    plant = cr.delayed_ss(ct.tf([1.0], np.poly(-1 / np.array(lags))), 49, dt=1.0)
    pulse = plant.markov(800)
    for scale in (1.0, -1.0, 3.0, 1e5, 1e-6):
        found = cr.estimate_delay(scale * pulse, len(lags), max_delay=100, dt=1.0)
        assert (found.delay, found.fit.delay_interval) == (49, (49, 50))
        assert found.fit.iae[[49, 50]].max() <= 1e-11 * abs(scale) * pulse.sum()
