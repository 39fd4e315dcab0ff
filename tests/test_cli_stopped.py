"""A campaign at the command line that is stopped, and what is in the way of its results."""

from __future__ import annotations

import errno
from pathlib import Path

import pandas as pd
import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.cli.staging import appearing
from ctrl_realize.identification.campaign.campaign import rows

FAST = ["--method", "scan", "--order", "3", "--max-delay", "80"]
COUNT = 4


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder, valve = tmp_path_factory.mktemp("records"), cr.bench.valve(rest=0.5, hold=1.0)
    for k in range(COUNT):
        made = valve.step_record(16.0, rng=k)
        columns = {"time_s": made.time, "input": made.input, "output": made.output}
        pd.DataFrame(columns).to_csv(folder / f"step_{k}.csv", index=False)
    return [str(path) for path in sorted(folder.iterdir())]


@pytest.fixture(autouse=True)
def without_figures(monkeypatch):
    """Drawing takes most of the time; how figures are written is tested elsewhere."""
    for sketches in ("identification_sketches", "campaign_sketches"):
        monkeypatch.setattr(f"ctrl_realize.report.build.{sketches}", lambda *_, **__: [])


def stop_after(monkeypatch, where, count):
    """Let the function named run `count` times, then be interrupted."""
    owner, name = where
    real, calls = getattr(owner, name), []

    def counted(*arguments, **keywords):
        calls.append(arguments)
        if len(calls) > count:
            raise KeyboardInterrupt
        return real(*arguments, **keywords)

    monkeypatch.setattr(owner, name, counted)
    return calls


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "manifest.json"  # which has the time
    }


def test_a_stopped_campaign_goes_on_where_it_was_with_the_same_files(
    files, tmp_path, capsys, monkeypatch
):
    out = tmp_path / "out"
    command = ["identify", *files, "-o", str(out), *FAST]
    assert main(command) == 0
    straight = contents(out)
    assert not any(name.startswith("rows") for name in straight)
    for path in sorted(out.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    out.rmdir()
    with monkeypatch.context() as patched:
        stop_after(patched, (rows, "identify"), 2)
        assert main(command) == 130
    assert "2 finished records are kept" in capsys.readouterr().err
    assert len(list((out / "rows").iterdir())) == 2
    assert {path.name for path in tmp_path.iterdir()} == {"out"}
    with monkeypatch.context() as patched:
        calls = stop_after(patched, (rows, "identify"), COUNT)
        assert main(command) == 0
        assert len(calls) == COUNT - 2
    assert contents(out) == straight


def test_an_interruption_before_the_first_record_leaves_nothing(files, tmp_path, monkeypatch):
    stop_after(monkeypatch, (rows, "identify"), 0)
    assert main(["identify", *files, "-o", str(tmp_path / "a" / "out"), *FAST]) == 130
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_while_rows_are_kept_loses_no_result(files, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("ctrl_realize.io.store.write_text", full)
    records = [cr.read_record(file) for file in files]
    store = cr.io.CampaignStore(tmp_path)
    kept = cr.identify_campaign(records, method="scan", order=3, max_delay=80, store=store)
    assert len(kept.good) == COUNT
    assert all("No space left" in row.warnings[-1] for row in kept.rows)
    assert len(store) == 0


def test_records_kept_apart_stay_when_the_next_is_interrupted(files, tmp_path, monkeypatch):
    from ctrl_realize.cli import identify_command

    stop_after(monkeypatch, (identify_command, "identify_record"), 2)
    out = tmp_path / "out"
    assert main(["identify", *files, "-o", str(out), "--separate", *FAST]) == 130
    assert {path.name for path in out.iterdir()} == {"step_0", "step_1"}
    assert all((out / name / "report.html").exists() for name in ("step_0", "step_1"))


def test_a_file_of_dots_alone_does_not_lead_out_of_the_folder(files, tmp_path):
    dotted = tmp_path / "...csv"
    dotted.write_bytes(Path(files[0]).read_bytes())
    out = tmp_path / "a" / "out"
    command = ["identify", str(dotted), files[1], "-o", str(out), "--separate", *FAST]
    assert main(command) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"...csv", "a"}
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["out"]
    assert {path.name for path in out.iterdir()} == {"record", "step_1"}


def test_a_name_of_many_bytes_makes_no_file_name_that_is_too_long(files, tmp_path):
    # 62 letters of four bytes: with number and ending more than the 255 bytes of a file name
    long = tmp_path / f"{chr(0x20000) * 62}.csv"
    long.write_bytes(Path(files[0]).read_bytes())
    out = tmp_path / "out"
    assert main(["identify", str(long), files[1], "-o", str(out), *FAST]) == 0
    assert len(list((out / "models").iterdir())) == 2


def test_results_for_a_folder_that_is_there_are_made_inside_it(tmp_path):
    # it may be a disk of its own, onto which nothing can be moved in one step
    with appearing(tmp_path) as staged:
        assert staged.parent == tmp_path
        (staged / "a.txt").write_text("done")
    assert {path.name for path in tmp_path.iterdir()} == {"a.txt"}
