"""A campaign that is stopped goes on where it was."""

import functools
import hashlib
import json
import os
import stat

import control as ct
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.cli.staging import appearing
from ctrl_realize.errors import OptionError
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


def test_a_second_run_reads_what_the_first_has_done(records, tmp_path, monkeypatch):
    store = cr.io.CampaignStore(tmp_path)
    first = cr.identify_campaign(records[:2], method="paper", store=store)
    assert len(store) == 2
    stamps = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    whole = cr.identify_campaign(records, method="paper", store=store)
    assert len(store) == 4
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())
    assert list(whole.delays[:2]) == list(first.delays)


def test_other_settings_are_other_rows(records, tmp_path):
    store = cr.io.CampaignStore(tmp_path)
    cr.identify_campaign(records[:1], method="paper", store=store)
    cr.identify_campaign(records[:1], method="paper", order=2, store=store)
    cr.identify_campaign(records[:1], method="scan", order=2, store=store)
    assert len(store) == 3


@pytest.mark.parametrize("package", ["ctrl-realize", "numpy", "scipy"])
def test_rows_of_another_version_are_made_anew(records, tmp_path, package):
    store = cr.io.CampaignStore(tmp_path)
    first = cr.identify_campaign(records[:1], method="paper", store=store)
    (path,) = tmp_path.glob("row-*.json")
    content = json.loads(path.read_text())
    assert content["versions"]["numpy"] == np.__version__
    # the same file as another version would have written it, whole and with its checksum
    content["versions"][package] = "0.0"
    content["numbers"]["delay"] = "99.0"
    del content["sha256"]
    canonical = json.dumps(content, sort_keys=True).encode("ascii")
    content["sha256"] = hashlib.sha256(canonical).hexdigest()
    path.write_text(json.dumps(content))
    again = cr.identify_campaign(records[:1], method="paper", store=store)
    assert_same_results(first, again)
    assert json.loads(path.read_text())["versions"] != content["versions"]


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


def test_failures_are_not_kept_and_a_file_is_no_store(records, tmp_path):
    store, later = cr.io.CampaignStore(tmp_path / "store"), tmp_path / "later.csv"
    missing = functools.partial(cr.read_record, later)
    broken = cr.identify_campaign([missing, records[0]], method="paper", store=store)
    assert (len(broken.failed), len(store)) == (1, 1)
    rows = np.column_stack([records[1].time, records[1].input, records[1].output])
    np.savetxt(later, rows, delimiter=",", fmt="%.17g", header="t,u,y", comments="")
    assert cr.identify_campaign([missing, records[0]], method="paper", store=store).failed == ()
    with pytest.raises(OptionError, match="needs a folder"):
        cr.io.CampaignStore(later)
