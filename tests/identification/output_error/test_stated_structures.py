"""Orders and structures that were stated: the interval holds if they are right, and says so."""

import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr
from benchmarks.acceptance import cases
from ctrl_realize import report
from tests import rigs
from tests.rigs import codes, covers

DELAY = 28.906  # ms, of the simulated valve: 37 samples


@pytest.fixture(scope="module")
def record():
    """A simulated valve of order four: the paper's order is one too small."""
    return cr.bench.valve().step_record(16, rng=103)


@pytest.mark.parametrize("stated", [{"order": 3}, {"structures": "P3D"}])
def test_a_stated_order_that_is_too_small_is_no_unconditional_answer(record, stated):
    system = cr.identify(record, **stated)
    fit = system.fit
    low, high = (1e3 * end for end in fit.interval)
    assert not low <= DELAY <= high
    assert fit.interval_kind == "conditional"
    assert "if the structure is right" in fit.report()
    assert codes(fit) & {"structure_not_certain", "apparent_dead_time"}
    assert report.verdict_of(system).level != "good"


def test_beside_a_stated_order_stands_what_the_next_one_says(record):
    fit = cr.identify(record, structures=[(3, 3)]).fit
    others = fit.estimate.others.not_ruled_out
    assert {other.order for other in others} == {4}
    low, high = (1e3 * end for end in others[0].interval)
    assert low <= DELAY <= high
    assert "with order 4" in fit.report()


def test_a_stated_structure_that_is_right_is_conditional_without_a_flag():
    record = rigs.step_record(rigs.R1, noise=0.005, before=300, after=900)
    system = cr.identify(record, structures=[(1, 1)])
    assert system.fit.interval_kind == "conditional"
    assert codes(system) == set()
    assert covers(system.fit, 37)
    assert report.verdict_of(system).level == "good"
    assert cr.identify(record).fit.interval_kind == "confidence"


def test_of_any_input_a_stated_structure_is_conditional_too():
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-1.0, 1.0], 40), 12)
    first, second = np.exp(-1 / 9), np.exp(-1 / 6)
    y, one, two = np.zeros(u.size), 0.0, 0.0
    for k in range(u.size):
        y[k] = two
        two = second * two + (1 - second) * one
        one = first * one + (1 - first) * (u[k - 5] if k >= 5 else 0.0)
    y += 0.01 * rng.standard_normal(u.size)
    record = cr.Record(np.arange(u.size) * 1.0, u, y)
    fit = cr.fit_output_error(record, structures=[(1, 1)]).fit
    assert fit.interval_kind == "conditional"
    assert "apparent_dead_time" in codes(fit)
    right = cr.fit_output_error(record, structures=[(2, 2)]).fit
    assert right.interval_kind == "conditional"
    assert "apparent_dead_time" not in codes(right)


def _in_slow_noise(seed):
    """Simulated: gain 2, lag 10 s, 3.03 s, in AR(1) noise with a pole at 0.9, two samples a s."""
    rng = np.random.default_rng(seed)
    u = np.repeat([0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0], [20, 12, 8, 30, 4, 60, 106])
    time, y = np.arange(u.size) / 2, np.zeros(u.size)
    for at in np.flatnonzero(np.diff(u)) + 1:
        since = np.maximum(time - time[at] - 3.03, 0.0)
        y += 2.0 * (u[at] - u[at - 1]) * -np.expm1(-since / 10.0)
    noise = lfilter([1.0], [1.0, -0.9], rng.standard_normal(u.size + 200))[200:]
    return cr.Record(time, u, y + 0.01 * noise)


def test_a_stated_structure_of_any_input_is_fitted_with_the_noise_made_white():
    errors, plain = [], []
    for seed in (3, 4, 5):
        record = _in_slow_noise(seed)
        fit = cr.identify(record, structures="P1D").fit
        assert fit.estimate.residual.noise_lags >= 1
        assert not codes(fit) & {"coloured_residual", "apparent_dead_time"}
        errors.append(fit.dead_time - 3.03)
        assert covers(fit, 2 * 3.03)
        assert fit.gain_interval[0] <= 2.0 <= fit.gain_interval[1]
        plain.append(cr.identify(record, structures="P1D", noise="white").fit.dead_time - 3.03)
    assert np.sqrt(np.mean(np.square(errors))) < 0.5 * np.sqrt(np.mean(np.square(plain)))


def test_what_a_stated_structure_cannot_describe_is_no_coloured_noise():
    rng = np.random.default_rng(4)
    u = np.repeat(rng.choice([-1.0, 1.0], 30), 16)
    ringing = np.real(np.poly(np.exp([-0.02 + 0.25j, -0.02 - 0.25j])))
    y = lfilter([0.0, ringing.sum()], ringing, np.concatenate([np.zeros(5), u[:-5]]))
    record = cr.Record(np.arange(u.size) * 1.0, u, y + 0.02 * rng.standard_normal(u.size))
    fit = cr.identify(record, structures="P1D").fit
    assert "apparent_dead_time" in codes(fit)
    assert fit.estimate.residual.noise_lags == 0


def test_a_stated_structure_with_zeros_needs_no_optimum_without_them_to_start_from():
    plant = cases.PLANTS["Rao and Garnier"]
    record, sigma = cases.made("Rao and Garnier", "binary", 797)
    fit = cr.identify(record, structures=plant.structure).fit
    least = cases.bounds(plant, "binary", record.input.ravel(), sigma)
    table = fit.parameter_table()
    assert fit.residual_std < 1.1 * sigma
    for name, value in plant.values.items():
        assert abs(table.loc[name, "value"] - value) < 4 * least[name]
