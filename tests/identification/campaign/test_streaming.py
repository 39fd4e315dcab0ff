"""Records of a generator: taken as rows are taken, and kept by nobody."""

import functools
import gc
import itertools
import weakref

import numpy as np
import pytest

import ctrl_realize as cr

QUICK = {"method": "scan", "order": 1, "max_delay": 40}


def record(seed: int) -> cr.Record:
    t = 0.1 * np.arange(150)
    y = np.where(t > 5.0, 1.5 * (1 - np.exp(-(t - 5.0) / 1.5)), 0.0)
    noise = 0.004 * np.random.default_rng(seed).normal(size=t.size)
    return cr.Record(t, (t >= 3.0).astype(float), y + noise, name=f"r{seed}")


def failing() -> cr.Record:
    raise ValueError("no such file")


class Counted:
    """An endless source of records that counts those taken, and knows those that are alive."""

    def __init__(self):
        self.taken = self.dropped = 0

    def __iter__(self):
        for number in itertools.count():
            self.taken = number + 1
            made = record(number)
            weakref.finalize(made.output, self.drop)
            yield made
            del made

    def drop(self):
        self.dropped += 1


@pytest.mark.parametrize("stored", [False, True])
def test_in_this_process_one_record_is_taken_for_each_row(tmp_path, stored):
    source = Counted()
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite") if stored else None
    rows = cr.identification.identify_each(source, store=store, **QUICK)
    assert source.taken == 0
    for number, row in enumerate(itertools.islice(rows, 4)):
        assert (row.position, row.name, source.taken) == (number, f"r{number}", number + 1)
        del row
        gc.collect()
        assert source.dropped >= number - 1
        assert store is None or len(store) == number + 1  # what was yielded is stored
    rows.close()


@pytest.mark.slow
def test_in_processes_at_most_two_records_each_are_ahead_of_the_rows():
    source = Counted()
    rows = cr.identification.identify_each(source, n_jobs=2, **QUICK)
    seen = []
    for row in itertools.islice(rows, 60):
        seen.append(row.position)
        assert row.name == f"r{row.position}"
        assert source.taken - len(seen) <= 4
    del row
    gc.collect()
    assert source.taken - source.dropped <= 4 + 2
    rows.close()
    assert len(set(seen)) == 60
    assert max(seen) < source.taken <= 64


def test_a_campaign_has_the_rows_in_the_order_given_with_complete_fits_up_to_a_thousand():
    makers = [functools.partial(record, 0), *[failing] * 999, functools.partial(record, 1)]
    campaign = cr.identify_campaign((one for one in makers), **QUICK)
    assert [row.position for row in campaign.rows] == list(range(1001))
    assert len(campaign.failed) == 999
    first, last = campaign.good
    assert isinstance(first.system.fit, cr.identification.DelayScan)
    assert last.system.fit is None
    alone = cr.identify(record(1), **QUICK)
    np.testing.assert_array_equal(last.system.A, alone.A)
    assert (last.order, last.dt, last.delay) == (1, alone.dt, alone.fit.delay)


def test_what_is_no_record_ends_the_run_when_its_turn_comes_and_no_records_are_no_rows(tmp_path):
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    with pytest.raises(cr.errors.DataError, match=r"records\[2\] is a str; expected a Record, or"):
        cr.identify_campaign(iter([record(0), record(1), "a.csv"]), store=store, **QUICK)
    assert len(store) == 2
    assert list(cr.identification.identify_each(iter([]))) == []
    with pytest.raises(cr.errors.OptionError, match="identify takes"):  # at once, not at a row
        cr.identification.identify_each([record(0)], ordr=2)
