"""Drawing the noise again: seeded, parallel, and blind to bias."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.identification.bootstrap import bootstrap
from tests import rigs

TS = rigs.TS
R1_FIT = partial(cr.fit_delay, structures=[(1, 1)])


@pytest.fixture(scope="module")
def record():
    return rigs.step_record(rigs.R1, noise=0.01, before=200, after=900)


@pytest.fixture(scope="module")
def drawn(record):
    return bootstrap(record, R1_FIT, repeats=60)


def test_the_scatter_is_that_of_the_likelihood(record, drawn):
    # 60 draws know a standard deviation to 9 %
    assert drawn.std == pytest.approx(R1_FIT(record).fit.std, rel=0.35)
    assert drawn.interval[0] < 37 * TS < drawn.interval[1]
    assert drawn.failed == 0


def test_draws_depend_on_the_seed_alone(record, drawn):
    again = bootstrap(record, R1_FIT, repeats=4, n_jobs=2)
    assert np.array_equal(again.dead_times, bootstrap(record, R1_FIT, repeats=4).dead_times)
    other = bootstrap(record, R1_FIT, repeats=4, seed=1)
    assert not np.any(np.isin(other.dead_times, drawn.dead_times))


def test_bands_hold_the_model_and_have_the_width_of_the_scatter(drawn):
    low, high = drawn.step_band(600)
    own = np.cumsum(drawn.system.markov(600))
    assert np.mean((low <= own + 1e-9) & (own - 1e-9 <= high)) > 0.9
    gain_low, gain_high = drawn.magnitude_band([0.1])
    low_quantile, high_quantile = np.quantile(drawn.gains, [0.025, 0.975])
    np.testing.assert_allclose(
        [gain_low[0], gain_high[0]], [low_quantile, high_quantile], rtol=1e-3
    )
    phase_low, phase_high = drawn.phase_band(2 * np.pi * np.array([1.0, 100.0]))
    assert np.all(phase_high - phase_low < 0.5)


def test_five_records_are_drawn_as_records():
    records = [
        rigs.step_record(rigs.R1, noise=0.01, seed=k, before=100, after=500) for k in range(5)
    ]
    result = bootstrap(records, R1_FIT, repeats=5)
    assert result.kind == "records"
    assert result.block == 0


def test_a_bootstrap_does_not_see_bias():
    # One lag too few: that of the sensor is read as delay, by every draw alike.
    record = rigs.step_record(rigs.R4, noise=0.002, before=200, after=900)
    result = bootstrap(record, partial(cr.fit_delay, structures=[(3, 3)]), repeats=10)
    assert result.interval[0] > 39 * TS  # truth: 37; off by 5.4 for a long record
    assert "bias" in result.report()


def test_unusable_choices_are_refused(record):
    with pytest.raises(cr.errors.OptionError, match="repeats"):
        bootstrap(record, repeats=1)
    with pytest.raises(cr.errors.OptionError, match="function"):
        bootstrap(record, "fit_delay")
    with pytest.raises(cr.errors.DataError, match="no records"):
        bootstrap([])
