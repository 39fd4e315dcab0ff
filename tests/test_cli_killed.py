"""Processes that the system stops, and readers that go away: no result is lost, nothing is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.cli.results import write_record_files

FAST = ["--method", "scan", "--order", "1", "--max-delay", "40"]
OPTIONS = {"method": "scan", "order": 1, "max_delay": 40}

pytestmark = pytest.mark.skipif(
    not hasattr(signal, "SIGKILL"), reason="the system has other ways to stop a process"
)


def record(seed: int) -> cr.Record:
    t = 0.1 * np.arange(150)
    y = np.where(t > 5.0, 1.5 * (1 - np.exp(-(t - 5.0) / 1.5)), 0.0)
    noise = 0.004 * np.random.default_rng(seed).normal(size=t.size)
    return cr.Record(t, (t >= 3.0).astype(float), y + noise, name=f"r{seed}")


def killed(seed: int) -> cr.Record:
    os.kill(os.getpid(), signal.SIGKILL)
    return record(seed)


@pytest.fixture
def files(tmp_path):
    for seed in range(4):
        made = record(seed)
        columns = {"time_s": made.time, "input": made.input, "output": made.output}
        pd.DataFrame(columns).to_csv(tmp_path / f"step_{seed}.csv", index=False)
    return [str(path) for path in sorted(tmp_path.iterdir())]


def started(*words, **keywords):
    return subprocess.Popen(
        [sys.executable, "-m", "ctrl_realize", *words], text=True, stderr=subprocess.PIPE,
        stdout=subprocess.PIPE, start_new_session=True, **keywords,
    )  # fmt: skip


def left_in_session(process):
    """Processes, dead ones apart, of the session that a process began."""
    listed = subprocess.run(
        ["ps", "-eo", "sess=,stat="], text=True, capture_output=True, check=True
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [row for row in rows if row[0] == str(process.pid) and not row[1].startswith("Z")]


@pytest.mark.slow
# joblib leaves pipes to its dead workers open, and Python tells of it
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_record_whose_process_is_killed_is_a_row_with_the_reason_and_all_others_go_on():
    sources = [partial(record, 0), partial(killed, 1), *(partial(record, k) for k in (2, 3))]
    campaign = cr.identify_campaign(sources, n_jobs=2, **OPTIONS)
    assert [row.error is None for row in campaign.rows] == [True, False, True, True]
    assert "was killed by the system (SIGKILL(-9)" in campaign.rows[1].error
    alone = cr.identify_campaign([record(k) for k in (0, 2, 3)], **OPTIONS)
    np.testing.assert_array_equal(campaign.delays, alone.delays)
    assert "failed_records" in {flag.code for flag in campaign.flags}


def test_a_record_over_which_the_process_died_twice_is_not_tried_for_ever(tmp_path):
    store = cr.io.CampaignStore(tmp_path)
    dying = (
        "import os, signal, sys\n"
        "import ctrl_realize as cr\n"
        "with cr.io.CampaignStore(sys.argv[1]).attempt(sys.argv[2]):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    for _ in range(2):
        died = subprocess.run([sys.executable, "-c", dying, str(tmp_path), "key"], check=False)
        assert died.returncode == -signal.SIGKILL
    with pytest.raises(cr.errors.DataError, match="killed 2 times"), store.attempt("key"):
        pass
    with store.attempt("another"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["tried-key.txt"]
    store.forget_attempts()
    with store.attempt("key"):  # a new start
        assert len(store) == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_termination_leaves_finished_rows_and_neither_workers_nor_folders(files, tmp_path):
    out, temporary = tmp_path / "out", tmp_path / "tmp"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    words = ["identify", *files * 8, "-o", str(out), "--jobs", "2", *FAST]
    process = started(*words, env=environment)
    while not list(out.glob("rows/row-*.json")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.terminate()
    said, complained = process.communicate(timeout=60)
    assert (process.returncode, said) == (143, "")
    assert complained.splitlines()[-1] == (
        "ctrl-realize: terminated; unfinished results were not written"
    )
    assert {path.name for path in out.iterdir()} == {"rows"}
    assert all(path.name.startswith("row-") for path in (out / "rows").iterdir())
    assert not list(temporary.glob("ctrl_realize-*"))
    deadline = time.monotonic() + 20
    while left_in_session(process) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert left_in_session(process) == []


def test_a_reader_that_goes_away_costs_no_result(files, tmp_path):
    out = tmp_path / "out"
    with started("identify", files[0], "-o", str(out), *FAST) as process:
        process.stdout.close()  # "| head" has seen enough
        assert process.stderr.read() == ""
    assert process.returncode == 0
    assert {"model.json", "report.html", "figures"} <= {path.name for path in out.iterdir()}


def test_results_that_cannot_be_written_leave_the_rows(files, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    os.mkfifo(out / "model.json")  # is not replaced
    assert main(["identify", *files[:2], "-o", str(out), *FAST]) == 2
    assert "is not replaced" in capsys.readouterr().err
    assert {path.name for path in out.iterdir()} == {"rows", "model.json"}
    assert len(list((out / "rows").iterdir())) == 2


def test_a_report_that_cannot_be_written_is_told_and_costs_no_model(files, tmp_path, capsys):
    system = cr.identify(record(1), **OPTIONS)
    (tmp_path / "report.html").mkdir()  # in the way
    nothing = {"frf": None, "comparison": None, "settings": {}, "calls": []}
    assert not write_record_files(tmp_path, system, record(1), Path(files[0]), **nothing)
    assert "the report could not be written (IsADirectoryError" in capsys.readouterr().err
    assert cr.load_model(tmp_path / "model.json").delay == system.delay
    assert not (tmp_path / "figures").exists()  # nothing by halves


def test_an_interruption_while_the_program_is_loaded_is_one_line(tmp_path):
    # a module that every command loads, and that waits until it is interrupted
    (tmp_path / "typer.py").write_text(
        "import sys, time\nprint('loading', flush=True)\ntime.sleep(60)\n", encoding="utf-8"
    )
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    process = started("identify", "a.csv", env={**os.environ, "PYTHONPATH": paths})
    assert process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60) == ("", "ctrl-realize: interrupted\n")
    assert process.returncode == 130


def test_signals_are_handled_as_before_after_a_command():
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    assert main(["identify", str(Path("nowhere.csv")), "-o", "out"]) == 2
    assert [signal.getsignal(number) for number in numbers] == before
