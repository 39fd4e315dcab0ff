"""A campaign at the command line that is stopped, and what is in the way of its results."""

import errno
import hashlib
import json
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
from ctrl_realize.cli import identify_command, main
from ctrl_realize.cli.manifest import Run
from ctrl_realize.cli.results import Provenance, write_record_files
from ctrl_realize.cli.staging import appearing
from ctrl_realize.errors import OptionError
from ctrl_realize.identification.campaign import rows
from tests.killing_records import COUNT, OPTIONS, killed, killed_here, record
from tests.rigs import interruptible

QUICK = ["--method", "scan", "--order", "1", "--max-delay", "40"]

pytestmark = [
    pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are stopped otherwise"),
    pytest.mark.usefixtures("without_figures"),
]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("records")
    for seed in range(COUNT):
        made = record(seed)
        columns = {"time_s": made.time, "input": made.input, "output": made.output}
        pd.DataFrame(columns).to_csv(folder / f"step_{seed}.csv", index=False)
    return [str(path) for path in sorted(folder.iterdir())]


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
    command = ["identify", *files, "-o", str(out), *QUICK]
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
    assert len(cr.io.CampaignStore(out / "rows.sqlite")) == 2
    assert {path.name for path in out.iterdir()} == {"rows.sqlite"}
    assert {path.name for path in tmp_path.iterdir()} == {"out"}
    with monkeypatch.context() as patched:
        calls = stop_after(patched, (rows, "identify"), COUNT)
        assert main(command) == 0
        assert len(calls) == COUNT - 2
    assert contents(out) == straight


def full(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_disk_that_is_full_loses_no_result(files, tmp_path, capsys, monkeypatch):
    resource = pytest.importorskip("resource", reason="the system limits no files")
    records = [cr.read_record(file) for file in files]
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:  # no file may grow: the system says "full" to whoever writes
        resource.setrlimit(resource.RLIMIT_FSIZE, (store.path.stat().st_size, limits[1]))
        kept = cr.identify_campaign(records, store=store, **OPTIONS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(kept.good) == COUNT
    assert all("not saved in the store: " in row.warnings[-1] for row in kept.rows)
    assert len(store) == 0
    cr.identify_campaign(records, store=store, **OPTIONS)
    assert len(store) == COUNT
    monkeypatch.setattr("ctrl_realize.cli.results.report.write_campaign", full)
    main(["identify", *files, "-o", str(tmp_path / "out"), *QUICK])
    assert "the report could not be written (OSError" in capsys.readouterr().err
    assert {"model.json", "records.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}


def test_a_disk_that_is_full_at_the_end_keeps_the_rows_and_says_how_to_go_on(
    files, tmp_path, capsys, monkeypatch
):
    out = tmp_path / "out"
    command = ["identify", *files, "-o", str(out), "--no-report", *QUICK]
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)  # what SQLite calls is another one
        assert main(command) == 2
    kept, why = capsys.readouterr().err.splitlines()[-2:]
    assert kept == (
        f"ctrl-realize: {COUNT} finished records are kept in {out / 'rows.sqlite'}; run the same "
        "command again to continue"
    )
    assert why.startswith(f"ctrl-realize: {out}")  # the system names no file
    assert why.endswith("model.json: No space left on device")
    with monkeypatch.context() as patched:
        assert stop_after(patched, (rows, "identify"), 0) == []
        assert main(command) == 0
    assert {"model.json", "records.csv"} <= {path.name for path in out.iterdir()}


@pytest.mark.parametrize(("count", "separate"), [(0, False), (0, True), (2, True)])
def test_an_interruption_leaves_finished_records_alone(
    files, tmp_path, capsys, monkeypatch, count, separate
):
    owner = (identify_command, "identify_record") if separate else (rows, "identify")
    stop_after(monkeypatch, owner, count)
    out, more = tmp_path / "a" / "out", ["--separate"] if separate else []
    assert main(["identify", *files, "-o", str(out), *more, *QUICK]) == 130
    assert capsys.readouterr().err.startswith("ctrl-realize: interrupted; ")
    if count:
        assert {path.name for path in out.iterdir()} == {"step_0", "step_1"}
        assert all((out / name / "report.html").exists() for name in ("step_0", "step_1"))
    else:
        assert list(tmp_path.iterdir()) == []


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
    # in other processes the bits are the same
    for one, other in zip(campaign.good, alone.good, strict=True):
        np.testing.assert_array_equal(one.system.A, other.system.A)
        np.testing.assert_array_equal(one.system.C, other.system.C)
        assert one.system.delay == other.system.delay
    assert "failed_records" in {flag.code for flag in campaign.flags}


@pytest.mark.slow
def test_a_termination_leaves_finished_rows_and_neither_workers_nor_folders(files, tmp_path):
    out, temporary = tmp_path / "out", tmp_path / "tmp"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    words = ["identify", *files * 8, "-o", str(out), "--jobs", "2", *QUICK]
    process = started(*words, env=environment)
    while not (out / "rows.sqlite").exists() or not len(cr.io.CampaignStore(out / "rows.sqlite")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.terminate()
    said, complained = process.communicate(timeout=60)
    assert (process.returncode, said) == (143, "")
    assert complained.splitlines()[-1] == (
        "ctrl-realize: terminated; unfinished results were not written"
    )
    assert {path.name for path in out.iterdir()} == {"rows.sqlite"}
    deadline = time.monotonic() + 20
    while left_in_session(process) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert left_in_session(process) == []


def test_a_report_that_cannot_be_written_is_told_and_costs_no_model(files, tmp_path, capsys):
    system = cr.identify(record(1), **OPTIONS)
    (tmp_path / "report.html").mkdir()  # in the way
    nothing = {"frf": None, "comparison": None, "settings": {}, "calls": []}
    provenance = Provenance([Path(files[0])], **nothing)
    assert not write_record_files(tmp_path, system, record(1), provenance)
    assert "the report could not be written (IsADirectoryError" in capsys.readouterr().err
    assert cr.load_model(tmp_path / "model.json").delay == system.delay
    assert not (tmp_path / "figures").exists()  # nothing by halves


def test_an_interruption_while_the_program_is_loaded_is_one_line(tmp_path):
    # a module that every command loads, and that waits until it is interrupted
    (tmp_path / "typer.py").write_text(
        "import sys, time\nprint('loading', flush=True)\ntime.sleep(60)\n", encoding="utf-8"
    )
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    with interruptible():
        process = started("identify", "a.csv", env={**os.environ, "PYTHONPATH": paths})
    assert process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60) == ("", "ctrl-realize: interrupted\n")
    assert process.returncode == 130


def files_in(folder):
    return set(contents(folder)) | {"manifest.json"}


def write(folder, names, run):
    with appearing(folder, run) as staged:
        for name in names:
            (staged / name).parent.mkdir(exist_ok=True)
            (staged / name).write_text(run.command, encoding="utf-8")


def test_results_are_replaced_by_their_own_command_whole_and_by_others_on_request(tmp_path):
    out, run = tmp_path / "out", Run("three files")
    write(out, ["model.json", "records.csv", "models/1.json", "models/2.json"], run)
    (out / "models" / "mine.json").write_text("keep")
    write(out, ["model.json", "records.csv", "models/1.json"], run)  # one record fewer
    names = {"manifest.json", "model.json", "records.csv", "models/1.json", "models/mine.json"}
    assert files_in(out) == names
    before = contents(out)
    with pytest.raises(OptionError, match=r"made by: three files; .* or use --overwrite"):
        write(out, ["model.json"], Run("one file"))
    with pytest.raises(ZeroDivisionError), appearing(out, run):
        raise ZeroDivisionError
    assert contents(out) == before
    write(out, ["model.json", "figures/fit.png"], Run("one file", overwrite=True))
    assert files_in(out) == {"manifest.json", "model.json", "figures/fit.png", "models/mine.json"}
    assert (out / "model.json").read_text() == "one file"


@pytest.mark.parametrize("name", ["../mine.txt", "{}/mine.txt", "a/../../mine.txt", "..\\mine.txt"])
def test_a_manifest_of_others_removes_nothing_outside_its_folder(tmp_path, name):
    out = tmp_path / "out"
    write(out, ["model.json"], Run("command"))
    (tmp_path / "mine.txt").write_text("keep")
    content = json.loads((out / "manifest.json").read_text())
    (out / "manifest.json").write_text(json.dumps({**content, "files": [name.format(tmp_path)]}))
    write(out, ["model.json"], Run("command"))
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_the_manifest_names_command_versions_inputs_and_files(files, tmp_path, capsys):
    out = tmp_path / "out"
    options = [*QUICK, "-o", str(out)]
    assert main(["identify", *files[:2], *options]) == 0
    content = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert content["command"] == (
        f"ctrl-realize identify {' '.join(files[:2])} --method scan --order 1 --max-delay 40"
    )
    assert content["versions"]["ctrl-realize"] == cr.__version__
    with open(files[1], "rb") as file:
        digest = hashlib.sha256(file.read()).hexdigest()
    assert content["inputs"][1] == {"file": files[1], "sha256": digest}
    assert set(content["files"]) == files_in(out) - {"manifest.json"}
    assert any(name.startswith("models/") for name in content["files"])
    capsys.readouterr()
    assert main(["identify", files[0], *options]) == 2  # a model of one, beside a table of two
    assert "holds other results" in capsys.readouterr().err
    assert main(["identify", files[0], *options, "--overwrite"]) == 0
    assert not {name for name in files_in(out) if name.startswith(("models/", "records"))}


@pytest.mark.slow
def test_records_over_which_the_process_itself_was_killed_are_rows_when_it_is_resumed(tmp_path):
    call = "import sys; from tests.killing_records import killed_here; killed_here(*sys.argv[1:])"
    died = [
        subprocess.run([sys.executable, "-c", call, "13", str(tmp_path)], check=False).returncode
        for _ in range(2)
    ]
    assert died == [-signal.SIGKILL] * 2  # over record 1, and over record 3
    errors = killed_here("13", str(tmp_path))
    assert [error is None for error in errors] == [True, False, True, False]
    assert "was killed by the system (SIGKILL(-9)" in errors[1]
    mark = tmp_path / "rows.sqlite-running"
    assert sorted(mark.read_text().split()) == ["1", "3"]  # also in the next run
    assert killed_here("", str(tmp_path)) == [None] * COUNT
    assert [path.name for path in tmp_path.iterdir()] == ["rows.sqlite"]


def test_a_reader_that_goes_away_costs_no_result(files, tmp_path):
    out = tmp_path / "out"
    words = ["identify", files[0], "-o", str(out), "--no-report", *QUICK]
    with started(*words) as process:
        process.stdout.close()  # "| head" has seen enough
        assert process.stderr.read() == ""
    assert process.returncode == 0
    assert {"model.json", "manifest.json"} <= {path.name for path in out.iterdir()}


def test_signals_are_handled_as_before_after_a_command():
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    assert main(["identify", str(Path("nowhere.csv")), "-o", "out"]) == 2
    assert [signal.getsignal(number) for number in numbers] == before


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": "ctrl_realize results"}', "null"])
def test_results_without_a_readable_manifest_are_those_of_another_run(tmp_path, text):
    write(tmp_path, ["model.json"], Run("command"))
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(OptionError, match=r"holds other results, such as model\.json"):
        write(tmp_path, ["model.json"], Run("command"))
