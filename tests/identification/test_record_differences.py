"""Records of one plant that differ: in gain, in lags, in dead time, or by noise alone."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.report.verdict import campaign_verdict

T = 0.05 * np.arange(400)


def step(height, seed, gain=1.0, lag=1.0, delay=0.5, noise=0.01):
    u = np.where(T < 4, 0.0, height)
    y = gain * height * -np.expm1(-np.maximum(T - 4 - delay, 0) / lag)
    rng = np.random.default_rng(seed)
    return cr.Record(T, u, y + noise * rng.standard_normal(T.size), name=f"step_{height:g}")


def driven(seed, gain=1.0, lag=1.0, delay=0.5, noise=0.02):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 80), 5)
    plant = cr.delayed_ss(
        cr.design.ProcessModel(gain=gain, lag=lag, dead_time=delay).system(0.05).delay_free,
        round(delay / 0.05),
    )
    y = plant.simulate(u) + noise * rng.standard_normal(u.size)
    return cr.Record(T, u, y, name=f"driven_{seed}")


def codes(records):
    return {flag.code for flag in cr.fit_output_error(records, structures=[(1, 1)]).fit.flags}


def test_steps_of_different_gain_are_no_plant_without_objection():
    records = [step(1.0, 0, 1.0), step(2.0, 1, 0.5), step(4.0, 2, 0.25)]
    system = cr.identify(records)
    found = {flag.code: str(flag) for flag in system.fit.flags}
    assert {"gains_differ", "no_common_gain"} <= set(found)
    verdict = report.verdict_of(system)
    assert verdict.level == "poor"
    assert verdict.reasons[0].startswith("No single gain fits all records")
    # their gains over each other, whatever the common one is
    gains = system.fit.repeatability.gains * system.fit.gain
    np.testing.assert_allclose(gains, [1.0, 0.5, 0.25], rtol=0.02)
    assert (system.fit.repeatability.fit_percent < 90).all()


def test_records_of_one_plant_are_not_told_apart():
    alarms = [codes([step(h, 100 * seed + h) for h in (1, 2, 4)]) for seed in range(8)]
    assert not set().union(*alarms) & {"gains_differ", "lags_differ", "records_differ"}


@pytest.mark.parametrize(
    ("name", "values", "code"),
    [
        ("gain", (1.0, 1.05, 1.1), "gains_differ"),
        ("lag", (1.0, 1.2, 1.4), "lags_differ"),
        ("delay", (0.5, 0.55, 0.6), "records_differ"),
    ],
)
def test_what_differs_is_named(name, values, code):
    records = [step(1.0 + i, i, **{name: value}) for i, value in enumerate(values)]
    assert code in codes(records)


def test_a_dead_time_that_differs_is_not_taken_for_lags_or_gains():
    records = [step(1.0 + i, i, delay=0.5 + 0.05 * i) for i in range(3)]
    assert not codes(records) & {"gains_differ", "lags_differ"}


@pytest.mark.parametrize(
    ("name", "value", "code"),
    [("gain", 2.0, "no_common_gain"), ("lag", 1.5, "lags_differ")],
)
def test_records_of_other_inputs_are_compared_too(name, value, code):
    same = [driven(seed) for seed in (1, 2)]
    assert not codes(same) & {"gains_differ", "lags_differ", "no_common_gain"}
    assert code in codes([*same[:1], driven(2, **{name: value})])


def test_the_table_shows_every_record_beside_the_model():
    fit = cr.fit_output_error(
        [step(1.0, 0, lag=0.8), step(2.0, 1), step(4.0, 2, lag=1.3)], structures=[(1, 1)]
    ).fit
    table = fit.repeatability.table()
    assert list(table.index) == ["step_1", "step_2", "step_4"]
    # over each other: 0.8 to 1 to 1.3; the common model fits the mean
    ratio = (table["lags"] / table["lags"]["step_2"]).to_numpy()
    np.testing.assert_allclose(ratio, [0.8, 1.0, 1.3], rtol=0.03)
    assert (table["fit_percent"] < 100).all()


def test_the_gains_of_a_canal_differ_with_the_opening_of_its_gate(shared_data):
    folder = shared_data / "wis_canal"
    records = [
        cr.read_record(folder / f"20210202_step_gate1_2_s{opening}.csv")
        for opening in (25, 100, 255)
    ]
    system = cr.identify(records)
    assert "gains_differ" in {flag.code for flag in system.fit.flags}
    assert report.verdict_of(system).level == "poor"


def test_the_picture_of_a_fit_has_every_record_beside_the_model():
    records = [step(1.0, 0, 1.0), step(2.0, 1, 0.5), step(4.0, 2, 0.25)]
    fit = cr.fit_output_error(records, structures=[(1, 1)]).fit
    drawn = cr.plots.fit_plot(fit).figure.axes[0].get_lines()
    ends = [float(np.mean(line.get_ydata()[-50:])) for line in drawn]
    for gain in (1.0, 0.5, 0.25, fit.gain):
        assert min(abs(end - gain) for end in ends) < 0.02


@pytest.mark.parametrize("method", ["output_error", "scan"])
def test_a_campaign_of_different_gains_is_flagged(method):
    records = [step(1.0, 0, 1.0), step(2.0, 1, 0.5), step(4.0, 2, 0.25)]
    options = {"structures": [(1, 1)]} if method == "output_error" else {}
    campaign = cr.identify_campaign(records, method=method, **options)
    found = {flag.code for flag in campaign.flags}
    assert {"gains_differ", "no_common_gain"} <= found
    assert campaign_verdict(campaign).level == "poor"
    np.testing.assert_allclose(campaign.table()["gain"], [1.0, 0.5, 0.25], rtol=0.05)


def test_a_campaign_of_one_plant_is_not_flagged():
    campaign = cr.identify_campaign([step(h, 50 + h) for h in (1, 2, 4)], structures=[(1, 1)])
    assert campaign.flags == ()


def test_a_campaign_tells_dead_times_that_differ():
    records = [step(2.0, i, delay=0.5 + 0.1 * i) for i in range(3)]
    found = {flag.code for flag in cr.identify_campaign(records, structures=[(1, 1)]).flags}
    assert "records_differ" in found
    assert "gains_differ" not in found


def test_a_campaign_tells_lags_that_differ():
    records = [step(2.0, i, lag=1.0 + 0.3 * i) for i in range(3)]
    assert "lags_differ" in {
        flag.code for flag in cr.identify_campaign(records, structures=[(1, 1)]).flags
    }
