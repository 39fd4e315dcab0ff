"""Drawing the noise again: seeded, parallel, and blind to bias."""

from functools import partial

import control as ct
import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.identification.validation.bootstrap import bootstrap
from ctrl_realize.io import FitSummary
from tests import rigs

TS = rigs.TS
R1_FIT = partial(cr.fit_output_error, structures=[(1, 1)])


@pytest.fixture(scope="module")
def record():
    return rigs.step_record(rigs.R1, noise=0.01, before=100, after=600)


@pytest.fixture(scope="module")
def drawn(record):
    return bootstrap(record, R1_FIT, repeats=20)


def test_the_scatter_is_that_of_the_likelihood(record, drawn):
    # 20 draws know a standard deviation to 16 %
    assert drawn.std == pytest.approx(R1_FIT(record).fit.std_given_structure, rel=0.35)
    assert drawn.interval[0] < 37 * TS < drawn.interval[1]
    assert drawn.failed == 0


def test_bands_hold_the_model_and_have_the_width_of_the_scatter(drawn):
    low, high = drawn.step_band(600)
    own = np.cumsum(drawn.system.markov(600))
    assert np.mean((low <= own + 1e-9) & (own - 1e-9 <= high)) > 0.9
    gain_low, gain_high = drawn.magnitude_band([0.1])
    low_quantile, high_quantile = np.quantile(drawn.gains, [0.025, 0.975], method="weibull")
    np.testing.assert_allclose(
        [gain_low[0], gain_high[0]], [low_quantile, high_quantile], rtol=1e-3
    )
    phase_low, phase_high = drawn.phase_band(2 * np.pi * np.array([1.0, 100.0]))
    assert np.all(phase_high - phase_low < 0.5)


def _mean_of_the_end(record):
    """A model whose dead time is the mean of the settled output."""
    wait = float(np.mean(np.ravel(record.output)[100:]))
    core = ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 1.0)
    return cr.DelayedStateSpace(core, 1, fit=FitSummary("Fit", "Fit", (), (("dead_time", wait),)))


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_the_scatter_is_that_of_the_noise_however_coloured(pole):
    rng = np.random.default_rng(7)
    found, true = [], []
    u = np.r_[np.zeros(40), np.ones(960)]
    for seed in range(25):
        noise = lfilter([1], [1, -pole], rng.standard_normal(1200))[200:]
        clean = 2 * (1 - 0.5 ** np.clip(np.arange(1000) - 41.0, 0, None))
        record = cr.Record(np.arange(1000.0), u, clean + noise)
        found.append(bootstrap(record, _mean_of_the_end, repeats=60, seed=seed).std)
        true.append(noise[100:].mean())
    exact = 1 / (1 - pole) / np.sqrt(900)
    assert np.std(true) == pytest.approx(exact, rel=0.4)  # 25 of them: 14 %
    # 25 x 60 draws: 2 %; of coloured noise 53 independent samples tell the correlation to 15 %
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(exact, rel=0.1)


def test_rounding_that_no_draw_sees_is_flagged(record):
    y = np.ravel(record.output)
    quantum = 0.05 * np.ptp(y)
    coarse = cr.Record(record.time, record.input, np.round(y / quantum) * quantum)
    result = bootstrap(coarse, R1_FIT, repeats=3)
    assert [flag.code for flag in result.flags] == ["coarse_quantisation"]
    assert bootstrap(record, R1_FIT, repeats=3).flags == ()


def test_a_bootstrap_does_not_see_bias():
    # One lag too few: that of the sensor is read as delay, by every draw alike.
    record = rigs.step_record(rigs.R4, noise=0.002, before=100, after=600)
    result = bootstrap(record, partial(cr.fit_output_error, structures=[(3, 3)]), repeats=4)
    assert result.interval[0] > 39 * TS  # truth: 37; off by 5.4 for a long record
    assert "bias" in result.report()
