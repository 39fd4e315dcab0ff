"""A campaign that is stopped goes on where it was."""

import dataclasses
import functools
import os
import signal
import sqlite3
import stat
import subprocess
import sys
from contextlib import closing
from importlib.metadata import version

import control as ct
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.cli.staging import appearing
from ctrl_realize.errors import FileFormatError, OptionError
from ctrl_realize.identification.campaign.rows import fingerprint, settings_of
from ctrl_realize.io.atomic import replaced_when_complete, write_text
from ctrl_realize.io.text.csv_files import write_csv
from tests.rigs import step_record


def record(seed: int) -> cr.Record:
    # Short: what is tested is the keeping, not the estimate.
    made = step_record(noise=1e-3, seed=seed, before=400, after=1300)
    return cr.Record(made.time, made.input, made.output, name=f"r{seed}")


@pytest.fixture(scope="module")
def records() -> list[cr.Record]:
    return [record(seed) for seed in range(4)]


def assert_same_results(one: cr.Campaign, other: cr.Campaign) -> None:
    assert one.table().equals(other.table())
    for a, b in zip(one.good, other.good, strict=True):
        for letter in "ABCD":
            assert_array_equal(getattr(a.system, letter), getattr(b.system, letter))


def written(store: cr.io.CampaignStore) -> dict[str, int]:
    """Key of each row -> its number in the file, which changes when it is written again."""
    with closing(sqlite3.connect(store.path)) as database:
        return dict(database.execute("SELECT key, rowid FROM rows"))


def test_a_second_run_reads_what_the_first_has_done(records, tmp_path):
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    first = cr.identify_campaign(records[:2], method="paper", store=store)
    rows = written(store)
    assert len(rows) == len(store) == 2
    whole = cr.identify_campaign(iter(records), method="paper", store=store, n_jobs=2)
    assert written(store).items() > rows.items()
    assert len(store) == 4
    assert list(whole.delays[:2]) == list(first.delays)
    again = cr.identify_campaign(records[::-1], method="paper", store=store)
    assert_same_results(dataclasses.replace(whole, rows=whole.rows[::-1]), again)
    assert len(written(store)) == 4
    alone = cr.identify_campaign(records, method="paper")
    assert_same_results(alone, whole)  # what is stored is what was found
    assert list(tmp_path.iterdir()) == [store.path]


def test_other_settings_records_and_versions_are_other_rows(records, tmp_path):
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    cr.identify_campaign(records[:1], method="paper", store=store)
    cr.identify_campaign(records[:1], method="paper", order=2, store=store)
    cr.identify_campaign(records[:1], method="scan", order=2, store=store)
    assert len(store) == 3
    settings = settings_of("paper", {"order": 2})
    for package in ("ctrl-realize", "numpy", "scipy"):
        stated = f"{package!r}: {version(package)!r}"
        other = settings.replace(stated, f"{package!r}: '0.0'")
        assert other != settings
        assert fingerprint(records[0], other) != fingerprint(records[0], settings)


def write_record(path, made: cr.Record) -> None:
    columns = np.column_stack([made.time, made.input, made.output])
    np.savetxt(path, columns, delimiter=",", fmt="%.17e", header="t,u,y", comments="")


def test_a_file_is_read_again_if_and_only_if_it_has_changed(records, tmp_path):
    file, store = tmp_path / "a.csv", cr.io.CampaignStore(tmp_path / "rows.sqlite")
    sources = [functools.partial(cr.read_record, file), functools.partial(record, 3)]
    write_record(file, records[0])
    first = cr.identify_campaign(sources, method="paper", store=store)
    known = file.stat()
    file.write_bytes(b"x" * known.st_size)  # nobody could read this
    os.utime(file, ns=(known.st_atime_ns, known.st_mtime_ns))
    assert_same_results(first, cr.identify_campaign(sources, method="paper", store=store))
    write_record(file, records[1])
    os.utime(file, ns=(known.st_atime_ns, known.st_mtime_ns + 1_000_000_000))
    other = cr.identify_campaign(sources, method="paper", store=store)
    alone = cr.identify_campaign(records[1:2], method="paper")
    assert list(other.delays) == [alone.delays[0], first.delays[1]]
    assert len(store) == 3
    partial = functools.partial(cr.read_record, file, name="other")
    cr.identify_campaign([partial], method="paper", store=store)  # read in another way
    assert len(store) == 4


KILLED_WHILE_WRITING = """
import os, signal, sqlite3, sys
database = sqlite3.connect(sys.argv[1])
database.execute("PRAGMA cache_size = 1")  # pages go into the file before the transaction ends
columns = len(database.execute("SELECT * FROM rows").fetchone())
for number in range(500):
    row = [f"key {number}", "x" * 3000, *[0.0] * (columns - 2)]
    database.execute(f"INSERT INTO rows VALUES ({','.join('?' * columns)})", row)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are stopped otherwise")
def test_a_process_that_is_killed_while_it_writes_leaves_whole_rows(records, tmp_path):
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    first = cr.identify_campaign(records[:1], method="paper", store=store)
    size, rows = store.path.stat().st_size, written(store)
    killed = subprocess.run(
        [sys.executable, "-c", KILLED_WHILE_WRITING, str(store.path)], check=False
    )
    assert killed.returncode == -signal.SIGKILL
    assert store.path.stat().st_size > size + 100_000  # half of what was written is there
    reopened = cr.io.CampaignStore(store.path)
    assert written(reopened) == rows
    again = cr.identify_campaign(records[:1], method="paper", store=reopened)
    assert_same_results(first, again)


def test_two_runs_at_the_same_time_share_one_store(records, tmp_path):
    path = tmp_path / "rows.sqlite"
    forth, back = (
        cr.identification.identify_each(some, method="paper", store=cr.io.CampaignStore(path))
        for some in (iter(records), reversed(records))
    )
    pairs = list(zip(forth, back, strict=True))  # each takes a row in turn
    assert [(a.name, b.name) for a, b in pairs] == [(f"r{k}", f"r{3 - k}") for k in range(4)]
    assert [a.delay for a, _ in pairs] == [b.delay for _, b in reversed(pairs)]
    assert len(cr.io.CampaignStore(path)) == 4


def test_a_damaged_row_is_identified_again(records, tmp_path):
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    first = cr.identify_campaign(records, method="paper", store=store)
    changes = ("delay = delay + 1", "model = zeroblob(9)", "'order' = 'x'", "flags = NULL")
    with closing(sqlite3.connect(store.path)) as database, database:
        for number, change in enumerate(changes, start=1):
            database.execute(f"UPDATE rows SET {change} WHERE rowid = {number}")
    assert_same_results(first, cr.identify_campaign(records, method="paper", store=store))
    assert len(store) == 4
    with closing(sqlite3.connect(store.path)) as database:
        assert database.execute("SELECT max(delay) FROM rows").fetchone()[0] == max(first.delays)


def test_pandas_reads_the_table(records, tmp_path):
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    table = cr.identify_campaign(records, method="paper", store=store).table()
    with closing(sqlite3.connect(store.path)) as database:
        read = pd.read_sql("SELECT * FROM rows", database, index_col="name").loc[table.index]
    for name in ("amplitude", "delay", "dead_time", "low", "high", "gain", "order", "residual"):
        assert_array_equal(read[name].to_numpy(float), table[name].to_numpy(float))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("reason", [RuntimeError, KeyboardInterrupt])
def test_after_a_failure_the_old_file_is_whole_and_the_folder_clean(tmp_path, reason):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(reason), replaced_when_complete(file) as temporary:  # noqa: PT012
        temporary.write_text("half of the n")
        raise reason
    assert file.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_an_error_names_the_file_that_was_asked_for(tmp_path):
    target = tmp_path / "nowhere" / "a.txt"
    with pytest.raises(FileNotFoundError) as refused:
        write_text(target, "text")
    assert refused.value.filename == str(target)
    with (  # noqa: PT012
        pytest.raises(OSError, match="no folder") as refused,
        appearing(tmp_path / "out") as staged,
    ):
        staged.rmdir()
        raise OSError(20, "no folder", staged)
    assert refused.value.filename == str(tmp_path / "out")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_what_is_no_regular_file_is_not_replaced(tmp_path):
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    (tmp_path / "a.txt").write_text("old")
    model, table = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.01), 37), pd.DataFrame({"a": [1]})
    for target in (pipe, link, "/dev/null"):
        for write in (
            lambda path: cr.save_model(path, model),
            lambda path: write_text(path, "text"),
            lambda path: write_csv(path, table, index=False),
        ):
            with pytest.raises(OSError, match="will not be replaced"):
                write(target)
    with pytest.raises(OSError, match="will not be replaced"), appearing(tmp_path) as staged:  # noqa: PT012
        for name in ("a.txt", "pipe"):
            (staged / name).write_text("new")
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert names(tmp_path) == ["a.txt", "link", "pipe"]
    assert (tmp_path / "a.txt").read_text() == "old"  # all or nothing


def test_a_link_stays_a_link_and_permissions_stay(tmp_path):
    plain, link = tmp_path / "plain.txt", tmp_path / "link.txt"
    plain.write_text("made by the system")
    write_text(tmp_path / "new.txt", "text")
    assert stat.S_IMODE((tmp_path / "new.txt").stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)
    plain.chmod(0o640)
    link.symlink_to("plain.txt")
    write_text(link, "new")
    assert link.is_symlink()
    assert plain.read_text() == "new"
    assert stat.S_IMODE(plain.stat().st_mode) == 0o640


def test_failures_are_not_kept_and_what_is_no_store_is_refused(records, tmp_path):
    store, later = cr.io.CampaignStore(tmp_path / "a" / "store.sqlite"), tmp_path / "later.csv"
    missing = functools.partial(cr.read_record, later)
    broken = cr.identify_campaign([missing, records[0]], method="paper", store=store)
    assert (len(broken.failed), len(store)) == (1, 1)
    write_record(later, records[1])
    assert cr.identify_campaign([missing, records[0]], method="paper", store=store).failed == ()
    with pytest.raises(
        OptionError, match=r"is a folder or a device; a campaign store is one file.*new file"
    ):
        cr.io.CampaignStore(tmp_path)
    content = later.read_bytes()
    with pytest.raises(FileFormatError, match="no campaign store, or damaged"):
        cr.io.CampaignStore(later)
    assert later.read_bytes() == content
    with closing(sqlite3.connect(tmp_path / "other.sqlite")) as database:
        database.execute("CREATE TABLE mine (x)")
    with pytest.raises(FileFormatError, match="got another SQLite database; give the name"):
        cr.io.CampaignStore(tmp_path / "other.sqlite")
    with closing(sqlite3.connect(store.path)) as database:
        database.execute("PRAGMA user_version = 99")
    with pytest.raises(FileFormatError, match="expected a campaign store of schema 5, got schema"):
        cr.io.CampaignStore(store.path)
