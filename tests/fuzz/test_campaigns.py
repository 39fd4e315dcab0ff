"""Campaigns of good, corrupt and odd records, stopped anywhere, with a store that was damaged."""

import contextlib
import pickle
import shutil
import sqlite3
import warnings
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, FileFormatError
from ctrl_realize.identification.campaign import rows
from tests.fuzz.draws import any_bytes, any_text, sometimes
from tests.fuzz.lane import fuzz, good_end
from tests.fuzz.test_binary_files import damaged

NAMES = [
    "r", "r", "", "../../etc/passwd", "a\0b", "<script>alert(1)</script>", "\ud800", "x" * 5000,
    "{{ 7*7 }}", "=1+1", "a.b", "NaN", "record 0", "\n\n", "CON", "%s%n",
]  # fmt: skip
LENGTHS = [45, 60, 80]


class Stopped(BaseException):
    """The run is stopped, as by Ctrl-C."""


def step(number: int, dt: float = 0.1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Small clean record of a step; the number sets delay, length, height."""
    n, k = LENGTHS[number % 3], np.arange(LENGTHS[number % 3])
    height = [1.0, -4.0, 1e-12, 16.0][number % 4]
    moved = np.clip(k - 15 - number % 5, 0, None)
    noise = 1e-4 * np.random.default_rng(number).standard_normal(n)
    return dt * k, height * (k >= 15), height * (1 - 0.7**moved + noise)


@dataclass
class Source:
    """One entry of a campaign: makes its record where it is read, or fails in some way."""

    kind: str
    number: int
    name: str

    def __call__(self):
        if self.kind == "error of ours":
            raise DataError("damaged")
        if self.kind == "error of a reader":
            raise [ValueError, KeyError, UnicodeError, EOFError, MemoryError][self.number % 5]("x")
        if self.kind == "no record":
            return [None, 3, "record.csv", (1, 2)][self.number % 4]
        t, u, y = step(self.number, 0.2 if self.kind == "other dt" else 0.1)
        if self.kind == "no step":
            u = np.ones_like(u)
        if self.kind == "constant":
            y = np.full_like(y, 5.0)
        if self.kind == "holes":
            y[self.number % y.size] = np.nan
        if self.kind == "tiny":
            t, u, y = (values[13:19] for values in (t, u, y))
        if self.kind == "two outputs":
            y = np.stack([y, -y])
        return cr.Record(t, u, y, name=self.name, missing="keep")


def remembering(identify):
    """Give the same result, warnings and error for records that came before.

    What is tested here is what a campaign makes of them; to identify them is most of a case's
    time, and there are few different ones.
    """
    known = {}

    def again(record, **choice):
        arrays = (record.time, record.input, record.output)
        key = (record.name, repr(choice), *(values.tobytes() for values in arrays))
        if len(known) > 2000:
            known.clear()
        if key not in known:
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                try:
                    known[key] = identify(record, **choice), told
                except Exception as error:
                    known[key] = error, told
        result, told = known[key]
        for entry in told:
            warnings.warn(entry.message, stacklevel=2)
        if isinstance(result, Exception):
            raise result.with_traceback(None)
        return result

    return again


REMEMBERED = patch.object(rows, "identify", remembering(rows.identify))


def identified(rng):
    """Identify records that came before once more in one of twenty cases."""
    return REMEMBERED if rng.randrange(20) else contextlib.nullcontext()


KINDS = ["good"] * 6 + ["error of ours", "error of a reader", "no record", "other dt", "no step",
         "constant", "holes", "tiny", "two outputs"]  # fmt: skip


def any_source(rng):
    name = any_text(rng, 8) if sometimes(rng, 8) else rng.choice(NAMES)
    source = Source(rng.choice(KINDS), rng.randrange(12), name)
    if source.kind == "good" and rng.randrange(2):
        return source()
    return source


class StopsAt:
    """A source that stops the run the first time that it is read."""

    def __init__(self, source):
        self.source, self.left = source, 1

    def __call__(self):
        if self.left:
            self.left = 0
            raise Stopped
        return self.source if isinstance(self.source, cr.Record) else self.source()


class CutStore(cr.io.CampaignStore):
    """A store whose process ends before, or just after, a row is written."""

    def __init__(self, path, rng):
        super().__init__(path)
        self.left, self.after = rng.randint(0, 4), rng.randrange(2)

    def save(self, rows, settings):
        self.left -= 1
        if self.left == 0 and not self.after:
            raise Stopped
        kept = super().save(rows, settings)
        if self.left == 0:
            raise Stopped
        return kept


def opened(path, kind=cr.io.CampaignStore, *more):
    """A store; a file so damaged that it is refused, before anything is identified, is removed."""
    try:
        return kind(path, *more)
    except (FileFormatError, OSError):
        path.unlink()
        return kind(path, *more)


def spoil(rng, path) -> None:
    """Damage, empty, exchange and remove rows of a store, or the file."""
    with (
        contextlib.suppress(sqlite3.Error),  # it is damaged already
        contextlib.closing(sqlite3.connect(path)) as database,
        database,
    ):
        keys = [key for (key,) in database.execute("SELECT key FROM rows ORDER BY rowid")]
        for key in keys:
            change = rng.choice([
                "model = ?1", "flags = ?1", "delay = delay + 1", "name = NULL", "crc32 = NULL",
                "(delay, model, crc32) = (SELECT delay, model, crc32 FROM rows WHERE key = ?1)",
                *["key = key"] * 3,
            ])  # fmt: skip
            value = rng.choice(keys) if "SELECT" in change else any_bytes(rng, 40)
            known = (value, key) if "?1" in change else (None, key)
            database.execute(f"UPDATE rows SET {change} WHERE key = ?2", known)
            if sometimes(rng, 8):
                database.execute("DELETE FROM rows WHERE key = ?", (key,))
    if sometimes(rng, 3):
        path.write_bytes(damaged(rng, path.read_bytes()))
    if sometimes(rng, 3):
        path.with_name(f"{path.name}-running").write_bytes(rng.choice([b"", b"\xff\0", b"99 12"]))


def same(one: cr.Campaign, other: cr.Campaign) -> None:
    assert one.table().equals(other.table())
    for a, b in zip(one.rows, other.rows, strict=True):
        assert (a.system is None) == (b.system is None)
        assert [str(flag) for flag in a.flags] == [str(flag) for flag in b.flags]
        if a.system is not None:
            for name in "ABCD":
                assert_array_equal(getattr(a.system, name), getattr(b.system, name))


def look_at(campaign: cr.Campaign) -> None:
    """Everything that a campaign says, or an error of ours."""
    assert repr(campaign)
    assert len(campaign.good) + len(campaign.failed) == len(campaign.rows)
    for row in campaign.rows:
        assert repr(row)
        assert (row.error is None) == (row.system is not None)
        for text in row.warnings:
            assert "overflow" not in text
            assert "divide" not in text
            assert "invalid value" not in text
    assert len(campaign.table()) == len(campaign.rows)
    for say in (
        campaign.by_amplitude,
        lambda: campaign.flags,
        campaign.report,
        campaign._repr_html_,
        lambda: pickle.loads(pickle.dumps(campaign)).table(),
    ):
        with good_end():
            say()


SETTINGS = [{"method": "scan", "order": 1, "max_delay": 12}, {"method": "paper", "order": 2}]


@fuzz(15)
def test_a_stopped_campaign_ends_as_one_that_was_not(rng, tmp_path_factory):
    with identified(rng):
        stopped_campaign(rng, tmp_path_factory)


def stopped_campaign(rng, tmp_path_factory):
    sources = [any_source(rng) for _ in range(rng.randint(1, rng.choice([2, 3, 6])))]
    if sometimes(rng, 3):
        sources.append(rng.choice(sources))
    settings = rng.choice(SETTINGS)
    folder = tmp_path_factory.mktemp("store")
    path = folder / "rows.sqlite"
    with good_end() as campaigns:
        campaigns.append(cr.identify_campaign(sources, **settings))
    (whole,) = campaigns
    look_at(whole)
    for _ in range(rng.choice([1, 1, 2, 3])):
        stopping = list(sources)
        if rng.randrange(2):
            place = rng.randrange(len(stopping))
            stopping[place] = StopsAt(stopping[place])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                cr.identify_campaign(stopping, store=opened(path, CutStore, rng), **settings)
        except Stopped:
            pass
        if rng.randrange(2):
            spoil(rng, path)
    for _ in range(2):  # the second time all rows come from the store
        with good_end() as campaigns:
            campaigns.append(cr.identify_campaign(sources, store=opened(path), **settings))
        same(campaigns[0], whole)
    shutil.rmtree(folder)


@pytest.mark.parametrize("method", ["scan", "output_error"])
@fuzz(4)
def test_what_a_campaign_says_follows_from_its_rows(rng, method):
    kinds = ["good"] * 4 + ["error of ours", "other dt", "no step"]
    sources = [
        Source(rng.choice(kinds), rng.randrange(12), rng.choice(NAMES))
        for _ in range(rng.randint(1, rng.choice([2, 3, 4 if method == "output_error" else 8])))
    ]
    options = {"order": 1} if method == "output_error" else SETTINGS[0]
    with identified(rng), good_end(seconds=60) as campaigns:
        campaigns.append(cr.identify_campaign(sources, **{"method": method, **options}))
    (campaign,) = campaigns
    good = [source.kind in ("good", "other dt") for source in sources]
    assert [row.system is not None for row in campaign.rows] == good
    with good_end() as statistics:
        statistics.append(campaign.statistics())
    assert bool(statistics) == (
        any(good)
        and len({source.kind for source in sources if source.kind in ("good", "other dt")}) == 1
    )
    for summary in statistics:
        assert campaign.delays.min() <= summary.mean <= campaign.delays.max()
        assert campaign.best.residual == min(row.residual for row in campaign.good)
    if method == "output_error" and rng.randrange(6):
        # the model of all records is one more fit, ten times as long as the rest
        return
    with good_end(seconds=60) as systems:
        systems.append(campaign.system)
    for system in systems:
        assert np.isfinite(system.delay_free.A).all()
