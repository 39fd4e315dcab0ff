"""One row of a campaign, with models that are written by hand."""

from __future__ import annotations

import functools
import warnings
from dataclasses import replace
from importlib import metadata
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, FileFormatError
from ctrl_realize.identification import campaign_row
from ctrl_realize.identification.campaign_row import (
    fingerprint,
    identify_row,
    read_source,
)
from ctrl_realize.results import Flag

DT = 0.1
TIME = DT * np.arange(200)
CORE = ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], DT)  # gain 1 / (1 - 0.5) = 2
FIT = SimpleNamespace(
    delay=3.25,
    dead_time=0.325,
    dead_time_interval=(0.3, 0.35),
    residual=0.5,
    flags=(Flag("hum", "there is hum"),),
)


def record(name="", step=-4.0, offset=0.0, **labels):
    moved = step * (np.arange(200) >= 60)
    return cr.Record(TIME, moved, offset + 2 * moved, name=name, **labels)


def model(fit=FIT, core=CORE):
    return cr.DelayedStateSpace(core, 3, fit=fit)


class Store:
    """Keeps rows in memory, and says of each that it was kept."""

    def __init__(self, error=None):
        self.kept = {}
        self.error = error

    def load(self, key):
        return self.kept.get(key)

    def save(self, key, row):
        if self.error:
            raise self.error
        self.kept[key] = row
        return replace(row, flags=(Flag("kept", "it was"),))


@pytest.fixture
def identified(monkeypatch):
    """Every record gives the model above; what was asked for is listed."""
    asked = []

    def identify(record, **kwargs):
        asked.append((record, kwargs))
        return model()

    monkeypatch.setattr(campaign_row, "identify", identify)
    return asked


def of(source, position=0, method="scan", options=None, store=None):
    return identify_row(source, position, method, {} if options is None else options, store)


def test_a_row_holds_the_numbers_of_its_model(identified):
    one = record("day 1")
    row = of(one, options={"order": 2})
    assert identified == [(one, {"method": "scan", "order": 2})]
    assert (row.name, row.amplitude, row.delay, row.dead_time) == ("day 1", -4.0, 3.25, 0.325)
    assert (row.interval, row.flags) == ((0.3, 0.35), FIT.flags)
    assert row.misfit == 0.125  # 0.5 for a step of 4, whatever its sign
    assert row.gain == pytest.approx(2.0, rel=1e-12)
    assert (row.error, row.warnings, row.order, row.dt) == (None, (), 1, DT)
    assert row.system.fit is FIT
    np.testing.assert_array_equal(row.system.A, model().A)
    assert repr(row) == "<CampaignRow 'day 1': delay 3.25 samples>"


def test_without_a_step_there_is_no_amplitude_and_the_misfit_is_the_residual(identified):
    row = of(record(step=0.0))
    assert np.isnan(row.amplitude)
    assert row.misfit == 0.5


def test_a_scan_works_on_a_unit_step_already(monkeypatch):
    noise = 1e-3 * np.random.default_rng(0).standard_normal(103)
    pulse = np.r_[np.zeros(3), 0.1 * 0.9 ** np.arange(100)] + noise
    scan = cr.estimate_delay(pulse, 1, max_delay=5, dt=DT)
    monkeypatch.setattr(campaign_row, "identify", lambda *_, **__: scan)
    row = of(record())
    assert row.misfit == scan.fit.misfit > 0
    assert row.delay == scan.fit.delay


def test_an_integrating_plant_has_an_infinite_gain_and_no_warning_of_it(monkeypatch):
    slope = model(core=ct.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]], DT))
    monkeypatch.setattr(campaign_row, "identify", lambda *_, **__: slope)
    row = of(record())
    assert row.gain == np.inf
    assert row.warnings == ()


def test_a_row_is_called_by_its_record_by_what_its_function_reads_or_by_its_place(identified):
    assert of(record("day 1")).name == "day 1"
    assert of(record(), 7).name == "record 7"
    assert of(record, 8).name == "record 8"
    assert of(functools.partial(record), 9).name == "record 9"
    assert of(functools.partial(record, "the record's own", 1.0)).name == "the record's own"
    reads = functools.partial(lambda path: record("what it holds"), "file.csv")
    assert of(reads).name == "what it holds"
    nameless = functools.partial(lambda path, place: record(), "a\udcff.csv", 3)
    assert of(nameless).name == "a\\udcff.csv"


def test_what_stops_a_record_is_told_in_one_line_of_its_row(identified):
    def broken():
        raise KeyError("first\n   line " + 1200 * "x")

    row = of(broken, 3)
    assert row.error.startswith("KeyError: 'first\\n line xxx")
    assert len(row.error) == len("KeyError: ") + 1000
    assert (row.model, row.system, row.order, row.name) == (None, None, None, "record 3")
    assert np.isnan([row.dt, row.delay, row.dead_time, *row.interval, row.misfit, row.gain]).all()
    assert repr(row) == f"<CampaignRow 'record 3': {row.error}>"
    assert identified == []


def test_a_name_that_no_file_takes_is_spelled_out_in_the_error(identified):
    def broken():
        raise OSError("no a\udcff.csv")

    assert of(broken).error == "OSError: no a\\udcff.csv"


def test_a_function_that_gives_no_record_is_named_by_what_it_gives():
    assert of(dict).error.startswith("DataError: the function gave a dict")
    one = record()
    assert read_source(one) is one
    assert read_source(lambda: one) is one
    with pytest.raises(DataError, match="gave a str"):
        read_source(str)


def test_a_record_of_several_channels_is_not_identified(identified):
    two = cr.Record(TIME, np.ones((2, 200)), np.ones(200), name="two")
    assert of(two).error.startswith("DataError: ")
    assert identified == []


def test_what_was_warned_of_is_told_once_in_its_order(monkeypatch):
    def identify(*_, **__):
        for text in ("b", "a", "b"):
            warnings.warn(text, cr.errors.DataWarning, stacklevel=1)
        return model()

    monkeypatch.setattr(campaign_row, "identify", identify)
    assert of(record()).warnings == ("b", "a")


def test_a_finished_row_is_kept_and_read_again_under_the_name_it_has_now(identified):
    store = Store()
    first = of(record("day 1"), store=store)
    assert [flag.code for flag in first.flags] == ["kept"]  # what the store returned
    assert list(store.kept) == [fingerprint(record(), "scan", {})]
    assert len(identified) == 1
    again = of(record("monday"), store=store)
    assert len(identified) == 1
    (kept,) = store.kept.values()
    assert (again.name, again.delay, again.flags) == ("monday", 3.25, kept.flags)
    of(record("day 1"), method="paper", store=store)
    of(record("day 1"), options={"order": 2}, store=store)
    assert len(identified) == 3


def test_a_failed_row_is_not_kept(monkeypatch):
    def identify(*_, **__):
        raise DataError("no")

    monkeypatch.setattr(campaign_row, "identify", identify)
    store = Store()
    assert of(record(), store=store).error == "DataError: no"
    assert store.kept == {}


@pytest.mark.parametrize("error", [OSError("disk full"), FileFormatError("a\udcff " + 2000 * "y")])
def test_a_row_that_cannot_be_kept_is_there_all_the_same(identified, error):
    row = of(record(), store=Store(error))
    assert row.delay == 3.25
    (told,) = row.warnings
    assert told.startswith("not kept in the store: " + str(error)[:1].strip("\udcff"))
    assert "\udcff" not in told
    assert len(told) <= 1000 + len("\\udcff")


def test_the_key_of_a_row_depends_on_samples_labels_method_and_options_alone():
    one = record("a", offset=0.5)
    assert fingerprint(record("b", offset=0.5), "scan", {}) == fingerprint(one, "scan", {})
    later = cr.Record(TIME + 1, one.input, one.output)
    other = cr.Record(TIME, one.input, one.output, output_labels=["level"])
    keys = [
        fingerprint(one, "scan", {}),
        fingerprint(one, "paper", {}),
        fingerprint(one, "scan", {"order": 2}),
        fingerprint(one, "scan", {"order": 3}),
        fingerprint(record(), "scan", {}),
        fingerprint(record(step=-4 - 1e-15, offset=0.5), "scan", {}),
        fingerprint(later, "scan", {}),
        fingerprint(other, "scan", {}),
        fingerprint(record(offset=0.5, input_labels=["valve"]), "scan", {}),
    ]
    assert len(set(keys)) == len(keys)
    ways = [{"order": 2, "samples": 9}, {"samples": 9, "order": 2}]
    assert len({fingerprint(one, "scan", way) for way in ways}) == 1


def test_the_key_tells_inputs_from_outputs():
    u, y, x = np.random.default_rng(0).standard_normal((3, 200))
    two_inputs = cr.Record(
        TIME, np.stack([u, y]), x[None], output_labels=["c"], input_labels=["a", "b"]
    )
    two_outputs = cr.Record(
        TIME, u[None], np.stack([y, x]), input_labels=["a"], output_labels=["b", "c"]
    )
    assert len({fingerprint(r, "scan", {}) for r in (two_inputs, two_outputs)}) == 2


def test_the_key_depends_on_the_version_of_the_package(monkeypatch):
    before = fingerprint(record(), "scan", {})
    monkeypatch.setattr(campaign_row, "_version", lambda: "another")
    assert fingerprint(record(), "scan", {}) != before


def test_a_package_that_is_not_installed_has_an_unknown_version(monkeypatch):
    known = {"ctrl-realize": "1.2.3"}

    def version(name):
        if name in known:
            return known[name]
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", version)
    assert campaign_row._version.__wrapped__() == "1.2.3"
    known.clear()
    assert campaign_row._version.__wrapped__() == "unknown"


@pytest.mark.parametrize(
    "known",
    [
        lambda pole=2.0, gain=1.0, dt=0: ct.tf([gain], [1.0, pole], dt),
        lambda pole=2.0, gain=1.0, dt=0: ct.ss([[-pole]], [[1.0]], [[gain]], [[0.0]], dt),
        lambda pole=2.0, gain=1.0, dt=0: ct.ss([[-2.0]], [[pole]], [[1.0]], [[gain]], dt),
    ],
)
def test_the_key_knows_a_system_by_all_its_digits(known):
    one = record()

    def key(system):
        return fingerprint(one, "output_error", {"known": system})

    same = known()
    same.name = "sensor"
    assert key(same) == key(known())
    # python-control prints eight digits
    others = [known(pole=2 + 1e-12), known(gain=1 + 1e-12), known(dt=DT)]
    assert len({key(system) for system in [same, *others]}) == 4
