"""Many records: table, statistics, final model, and one bad record among them."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from tests.rigs import TS, step_record


def named(record: cr.Record, name: str) -> cr.Record:
    return cr.Record(record.time, record.input, record.output, name=name)


@pytest.fixture(scope="module")
def records() -> list[cr.Record]:
    return [
        named(step_record(noise=1e-3, seed=s, amplitude=a), f"{a:g}mA_{s}")
        for a in (4.0, 16.0)
        for s in range(4)
    ]


@pytest.fixture(scope="module")
def campaign(records) -> cr.Campaign:
    return cr.identify_campaign(records, method="paper")


def test_statistics_are_those_of_the_trimmed_delays(campaign):
    summary = campaign.statistics(trim=2)
    kept = np.sort(campaign.delays)[2:-2]
    assert_allclose([summary.mean, summary.variance], [kept.mean(), kept.var(ddof=1)])
    assert campaign.statistics().dropped == 4  # a quarter of eight at each end


def test_a_bad_record_is_a_row_with_its_error(records):
    t = TS * np.arange(2000)
    flat = cr.Record(t, np.ones(2000), t, name="flat")
    mixed = cr.identify_campaign([records[0], flat, records[1]], method="paper")
    assert [row.system is None for row in mixed.rows] == [False, True, False]
    assert mixed.rows[1].error.startswith("NoStepError: no step in the input of record 'flat'")
    assert mixed.table().loc["flat", "error"] == mixed.rows[1].error
    assert mixed.flags[0].code == "failed_records"
    assert "flat" in mixed.report()


def test_a_delay_that_grows_with_the_step_raises_the_alarm():
    slow = [
        named(step_record(noise=1e-3, seed=s, amplitude=a, delay=37 + 2 * a), f"{a:g}_{s}")
        for a in (4.0, 16.0)
        for s in range(4)
    ]
    flags = cr.identify_campaign(slow, method="scan", order=3, max_delay=120).flags
    assert [flag.code for flag in flags] == ["amplitude_trend"]
    assert "longer for larger steps" in str(flags[0])


def test_the_final_model_is_the_best_record_at_the_common_delay(campaign):
    system = campaign.system
    assert isinstance(system, ct.StateSpace)
    assert system.delay == round(campaign.statistics().mean)
    scan = campaign.best.system.fit
    again = cr.realize(scan.impulse, 3, delay=system.delay, samples=1000, feedthrough=True)
    assert_array_equal(system.A, again.A)


def test_the_final_model_is_not_that_of_a_record_without_a_response(records, campaign):
    """A little noise and nothing else has the smallest residual."""
    alive = records[-1]
    still = 1e-4 * np.random.default_rng(3).standard_normal(alive.n_samples)
    dead = cr.Record(alive.time, alive.input, still, name="cable off")
    mixed = cr.identify_campaign([*records, dead], method="paper")
    assert "cable off" in [row.name for row in mixed.good]
    # Gains of single records in 0.1 % of noise, realized at delays a few samples apart.
    assert_allclose(mixed.system.dcgain(), campaign.system.dcgain(), rtol=0.01)


def test_records_of_different_sample_times_have_a_report_but_no_mean_delay():
    """Table by amplitude averaged samples of 10 and 20 ms to 8.99, and the report raised."""
    rng = np.random.default_rng(0)
    records = []
    for k in range(4):
        dt = 0.01 * (1 + k % 2)
        t = dt * np.arange(400)
        y = 1 - np.exp(-np.clip(t - 100 * dt - 0.12, 0, None) / 0.3)
        noisy = y + 1e-3 * rng.standard_normal(t.size)
        records.append(cr.Record(t, np.where(np.arange(400) < 100, 0, 1), noisy, name=f"{k}"))
    campaign = cr.identify_campaign(records, method="scan", progress=False)
    assert len(campaign.good) == 4
    with pytest.raises(cr.errors.DataError, match=r"0\.01 s to 0\.02 s"):
        campaign.by_amplitude()
    assert "sample times from 0.01 s to 0.02 s" in campaign.report()


def test_a_campaign_of_failed_records_has_a_report():
    flat = cr.Record(0.01 * np.arange(100), np.zeros(100), np.zeros(100), name="flat")
    campaign = cr.identify_campaign([flat], progress=False)
    assert "Campaign of 1 record " in campaign.report()
    assert "0 of 1" in campaign.report()


def test_records_that_end_before_their_response_do_not_tell_that_the_plant_has_changed():
    records = []
    for amplitude in (16.0, 8.0):
        for seed in range(3):
            t = 0.01 * np.arange(600)
            y = 2 * amplitude * (1 - np.exp(-np.clip(t - 1.12, 0, None) / 30))
            noise = 0.05 * np.random.default_rng(seed).standard_normal(t.size)
            u = np.where(t < 1, 0, amplitude)
            records.append(cr.Record(t, u, y + noise, name=f"{amplitude:g}_{seed}"))
    campaign = cr.identify_campaign(records, method="scan", progress=False)
    ended = {"not_died_away", "unstable"}
    assert all(ended & {flag.code for flag in row.flags} for row in campaign.good)
    assert not {"gains_differ", "no_common_gain"} & {flag.code for flag in campaign.flags}


def test_a_store_that_is_a_path_and_a_trim_that_leaves_no_value_are_refused(records):
    with pytest.raises(cr.errors.OptionError, match="CampaignStore"):
        cr.identify_campaign(records[:1], store="x.sqlite", progress=False)
    for values, trim in (([0, 1], -1), ([0, 1], 1), ([], 0)):
        with pytest.raises(cr.errors.OptionError, match="trim"):
            cr.paper.trimmed_statistics(np.array(values), trim)
