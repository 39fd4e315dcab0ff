"""The command line: what it writes, what it says, and how it ends."""

import hashlib
import html
import json
import re
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import control as ct
import numpy as np
import pandas as pd
import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from tests.app_records import step_record
from tests.traps import csv, signals

FAST = ["--method", "scan", "--order", "3", "--max-delay", "80"]


def save(record, path):
    columns = {"time_s": record.time, "input": record.input, "output": record.output}
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def folder(valve, tmp_path_factory):
    folder = tmp_path_factory.mktemp("records")
    for k in range(3):
        save(valve.step_record(16.0, rng=k), folder / f"step_{k}.csv")
    save(valve.record(np.full(900, 8.0), rng=1), folder / "flat.csv")
    (folder / "text.csv").write_text("nothing,to\nsee,here\n", encoding="utf-8")
    grid = np.geomspace(0.1, 20, 40)
    frf = valve.truth.frf(grid).frdata[0, 0]
    pd.DataFrame({"frequency_hz": grid, "real": frf.real, "imag": frf.imag}).to_csv(
        folder / "frf.csv", index=False
    )
    return folder


@pytest.fixture(scope="module")
def first(folder, tmp_path_factory):
    """One run, whole: its folder and what it said."""
    out = tmp_path_factory.mktemp("first") / "deep" / "out"
    said, complained = StringIO(), StringIO()
    words = [str(folder / "step_0.csv"), "-o", str(out), "--frf", str(folder / "frf.csv"), *FAST]
    with redirect_stdout(said), redirect_stderr(complained):
        assert main(["identify", *words]) == 0
    assert complained.getvalue() == ""
    return out, said.getvalue()


def files_in(path):
    return {str(one.relative_to(path)) for one in path.rglob("*") if one.is_file()}


def test_one_record_gives_model_report_and_figures(folder, first):
    out, said = first
    assert files_in(out) >= {
        "model.json", "report.html", "frf_comparison.csv", "figures/onset.png",
        "figures/delay.png", "figures/frf_error.png",
    }  # fmt: skip
    direct = cr.identify(
        cr.read_record(folder / "step_0.csv"), method="scan", order=3, max_delay=80
    )
    loaded = cr.load_model(out / "model.json")
    assert loaded.delay == direct.delay
    np.testing.assert_array_equal(loaded.delay_free.A, direct.delay_free.A)
    report = (out / "report.html").read_text(encoding="utf-8")
    for name in ("step_0.csv", "frf.csv"):
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() in report
    assert direct.fit.report() in said
    assert cr.compare_frf(direct, cr.read_frf(folder / "frf.csv")).report() in said
    assert str(out) in said


def test_without_a_folder_the_model_is_told_and_nothing_is_written(
    folder, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    step = str(folder / "step_0.csv")
    assert main(["identify", step, *FAST]) == 0
    direct = cr.identify(cr.read_record(step), method="scan", order=3, max_delay=80)
    said = capsys.readouterr().out
    assert direct.fit.report() in said
    assert "--output FOLDER" in said
    assert files_in(tmp_path) == set()


def test_the_exit_code_tells_whether_a_required_verdict_is_good(folder, tmp_path, capsys):
    good = ["identify", str(folder / "step_0.csv"), "-o", str(tmp_path / "out"), "--no-report"]
    good += ["--order", "3"]
    assert main([*good, "--require", "gain"]) == 0
    assert main([*good, "--overwrite", "--method", "scan", "--require", "gain"]) == 4
    assert "--require gain: the verdict is 'not judged by this method'" in capsys.readouterr().err
    capsys.readouterr()
    assert main([*good, "--overwrite", "--require", "gain,tuning"]) == 2
    assert "each with --require before it" in capsys.readouterr().err


def test_tune_tells_the_numbers_of_the_same_calls_in_python(tmp_path, capsys):
    file = save(step_record(), tmp_path / "heater.csv")
    words = [str(file), "--structures", "FOPDT", "--form", "siemens_pid_compact", "--kind", "PI"]
    assert main(["tune", *words, "--rule", "amigo"]) == 0
    said = capsys.readouterr().out
    system = cr.identify(cr.read_record(file), structures=["FOPDT"])
    pid = cr.design.pid(system, "amigo", "PI")
    assert pid.report() in said
    assert pid.as_form("siemens_pid_compact").report() in said
    margin = f"{pid.check.margins.gain_margin:.2g} times as large"
    assert margin in said
    assert files_in(tmp_path) == {"heater.csv"}
    # what no model can change is told before one is identified, or a record is read
    (empty := tmp_path / "empty.csv").touch()
    for wrong in (["--closed-loop-time", "1"], ["--max-sensitivity", "1.6"]):
        assert main(["tune", str(empty), *wrong, "--rule", "amigo"]) == 2
        assert f"{wrong[0]} is an argument of" in capsys.readouterr().err


def test_tune_tells_the_same_numbers_for_a_saved_model(tmp_path, capsys):
    file = save(step_record(), tmp_path / "heater.csv")
    fit = [str(file), "--structures", "FOPDT"]
    assert main(["tune", *fit, "--form", "siemens_pid_compact", "--require", "tuning"]) == 0
    of_the_record = capsys.readouterr().out
    assert main(["identify", *fit, "-o", str(tmp_path / "out"), "--no-report"]) == 0
    capsys.readouterr()
    model = str(tmp_path / "out" / "model.json")
    assert main(["tune", model, "--form", "siemens_pid_compact", "--require", "tuning"]) == 0
    first, rest = capsys.readouterr().out.split("\n", 1)
    assert first.startswith(f"{model}: <DelayedStateSpace")
    assert of_the_record.endswith(rest)
    assert main(["tune", model, "--structures", "FOPDT"]) == 2
    assert "is a saved model" in capsys.readouterr().err
    for files in ([model, str(file)], [str(file), model]):
        assert main(["tune", *files, "--by", "run"]) == 2
        told = capsys.readouterr().err
        assert f"{model} is a saved model: expected options" in told
        assert f"got {file}, --by; give the records alone" in told


def test_a_record_is_told_from_a_saved_model_by_what_it_holds(tmp_path, capsys):
    words = ["--structures", "FOPDT", "--rule", "amigo"]
    said = []
    for name in ("heater.csv", "heater.json"):
        file = save(step_record(), tmp_path / name)
        assert main(["tune", str(file), *words]) == 0
        said.append(capsys.readouterr().out.replace(str(file), ""))
    assert said[0] == said[1]


def test_tune_says_that_a_rule_has_no_derivative_for_a_plant_with_one_lag(tmp_path, capsys):
    """`--kind PID` printed the numbers of a PI, without a word."""
    cr.save_model(tmp_path / "plant.json", cr.delayed_ss(ct.tf([2], [3, 1]), dead_time=1, dt=0.1))
    for more, kind in ([], "PI"), (["--rule", "amigo"], "PID"):
        assert main(["tune", str(tmp_path / "plant.json"), "--kind", "PID", *more]) == 0
        said = capsys.readouterr()
        assert f"PID controller {kind}_" in said.out
        assert ("--kind PID gave a PI: " in said.err) == (kind == "PI")


def test_tune_takes_any_saved_plant_and_no_loop(tmp_path, capsys):
    plant = cr.delayed_ss(ct.tf([2], [3, 1]), dead_time=1.25, dt=0.1)
    cr.save_model(tmp_path / "plant.json", plant)
    cr.save_model(tmp_path / "loop.json", ct.feedback(0.3 * plant))
    assert main(["tune", str(tmp_path / "plant.json")]) == 0
    expected = cr.design.pid(plant, closed_loop_time="robust").report()
    assert expected in capsys.readouterr().out
    for words in (["loop.json"], ["plant.json", "--require", "gain"]):
        assert main(["tune", str(tmp_path / words[0]), *words[1:]]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert "no model of a plant that was identified" in said.err
    assert main(["tune", str(tmp_path / "plant.json"), "--order", "3"]) == 2
    assert "got --order; give the records" in capsys.readouterr().err


def test_tune_tells_a_doubtful_verdict_beside_the_numbers(tmp_path, capsys):
    file = tmp_path / "loud.csv"
    csv(*signals(noise=6.0))(file)
    words = ["--structures", "FOPDT", "--structures", "SOPDT"]
    assert main(["tune", str(file), *words, "--require", "tuning"]) == 4
    said = capsys.readouterr()
    assert "integral ti" in said.out
    assert "warning: verdict on tuning: no" in said.err


def test_a_model_is_kept_where_no_controller_can_be_tuned(tmp_path, capsys):
    # (1 - 30 s) / ((20 s + 1)(8 s + 1)) behind 5 s, recorded until it is about to turn.
    file, t = tmp_path / "short.csv", np.arange(65.0)
    since = np.clip(t - 45, 0, None)
    y = 1 + (38 * np.exp(-since / 8) - 50 * np.exp(-since / 20)) / 12
    y += 0.02 * np.random.default_rng(1).standard_normal(t.size)
    csv(t, np.where(t < 40, 0.0, 1.0), y)(file)
    words = [str(file), "--structures", "P2DZ"]
    assert main(["identify", *words, "--json", "-", "--tune", "ideal"]) == 0
    said = capsys.readouterr()
    assert '"controller": null' in said.out
    assert "no controller: a PID controller needs the sign of the gain" in said.err
    assert main(["tune", *words]) == 2
    assert "needs the sign of the gain" in capsys.readouterr().err


@pytest.mark.parametrize(("sign", "action"), [(1, "reverse"), (-1, "direct")])
def test_json_has_the_direction_of_action_beside_what_is_entered(sign, action, tmp_path, capsys):
    # a block that takes no negative gain would have positive feedback without
    t, u, y = signals()
    csv(t, u, sign * y)(tmp_path / "plant.csv")
    words = [str(tmp_path / "plant.csv"), *FAST, "--tune", "siemens_pid_compact"]
    assert main(["identify", *words, "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)["controller"]
    assert told["action"] == action
    assert told["gain"]["value"] * sign > 0
    assert next(one["value"] for one in told["enter"] if one["name"] == "Gain") > 0


def test_json_is_written_into_a_new_folder_and_not_in_place_of_one(folder, tmp_path, capsys):
    words = ["identify", str(folder / "step_0.csv"), *FAST, "--json"]
    assert main([*words, str(tmp_path / "new" / "model.json")]) == 0
    told = json.loads((tmp_path / "new" / "model.json").read_text(encoding="utf-8"))
    assert told["status"] == "identified"
    capsys.readouterr()
    assert main([*words, str(tmp_path / "new")]) == 2
    said = capsys.readouterr()
    assert said.out == ""  # refused before any work
    assert "is a folder; expected a file to write" in said.err


@pytest.mark.parametrize("words", [("nix.csv",), ("step_0.csv", "--frf", "{folder}/nix.csv")])
def test_a_missing_file_is_a_refusal_for_a_program_as_well(folder, capsys, words):
    file, *more = (word.format(folder=folder) for word in words)
    assert main(["identify", str(folder / file), *more, "--json", "-"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert (told["status"], told["error"]["kind"]) == ("refused", "MissingFileError")
    assert "nix.csv" in told["error"]["text"]


@pytest.mark.usefixtures("without_figures")
def test_the_report_of_identify_has_the_controller_if_it_is_wanted(folder, tmp_path, capsys):
    out = tmp_path / "out"
    words = ["identify", str(folder / "step_0.csv"), "-o", str(out), *FAST]
    assert main([*words, "--tune", "series"]) == 0
    said, page = capsys.readouterr().out, (out / "report.html").read_text(encoding="utf-8")
    system = cr.load_model(out / "model.json")
    form = cr.design.pid(system, closed_loop_time="robust").as_form("series")
    assert form.report() in said
    for name, value in form._rows():
        assert f'<td class="text">{name}</td><td class="number">{value}</td>' in page
    assert "It would be unstable if" in page
    assert "pid = cr.design.pid(sys, closed_loop_time='robust')" in html.unescape(page)
    assert main([*words, "--tune", "--overwrite"]) == 2
    assert "expected a form, such as ideal" in capsys.readouterr().err
    assert main([*words, "--overwrite", "--tune", "abacus"]) == 2
    assert "--tune abacus; choose one of 'ideal'" in capsys.readouterr().err


def test_several_records_make_a_campaign_and_a_bad_one_is_a_row(folder, tmp_path, capsys):
    files = [str(folder / name) for name in ("step_0.csv", "flat.csv", "step_1.csv", "text.csv")]
    out = tmp_path / "out"
    assert main(["identify", *files, "-o", str(out), *FAST]) == 1
    table = pd.read_csv(out / "records.csv")
    assert list(table["error"].isna()) == [True, False, True, False]
    assert "no step" in table["error"][1]
    assert {"model.json", "report.html", "figures/delays.png"} <= files_in(out)
    assert len(list((out / "models").iterdir())) == 2
    said = capsys.readouterr().out
    assert "step_1" in said
    assert "2 of 4 records failed" in said


def test_nothing_is_written_where_no_record_is_usable(folder, tmp_path, capsys):
    out = tmp_path / "new" / "out"
    files = [str(folder / "flat.csv"), str(folder / "text.csv")]
    assert main(["identify", *files, "-o", str(out), *FAST]) == 2
    said = capsys.readouterr()
    assert "none of the 2 records could be identified" in said.err
    assert "Traceback" not in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["identify", "{folder}/nix.csv", "-o", "{out}"], "there is no such file"),
        (["identify", "{folder}", "-o", "{out}"], "is a folder"),
        (["identify", "{folder}/text.csv", "-o", "{out}"], "numeric columns"),
        (["identify", "{folder}/flat.csv", "-o", "{out}", "--method", "scan"], "no step"),
        (["identify", "{folder}/step_0.csv", "-o", "{folder}/frf.csv"], "is a file"),
        (["identify", "{folder}/step_0.csv", "{folder}/step_1.csv"], "or --joint, got 2"),
        (["identify", "{folder}/step_0.csv", "-o", ""], "empty name"),
        (["compare", "{folder}/frf.csv", "{folder}/frf.csv", "--output="], "empty name"),
        (["identify", "{folder}/step_0.csv", "-o", "{out}", "--order", "0"], "--order"),
        (["identify", "{folder}/step_0.csv", "-o", "{out}", "--order", "x"], "--order"),
        (["identify", "{folder}/step_0.csv", "-o", "{out}", "--structures", "P9D"], "'P9D'"),
        (["identify", "{folder}/step_0.csv", "-o", "{out}", "--method", "magic"], "magic"),
        (["identify", "{folder}/step_0.csv", "-o", "{out}", "--input", "9"], "9"),
        (["compare", "{folder}/frf.csv", "{folder}/frf.csv"], "model"),
        (["compare", "{folder}/nix.json", "{folder}/frf.csv"], "there is no such file"),
        (["invent"], "invent"),
        (["identify"], "files"),
    ],
)
def test_errors_are_one_line_and_leave_nothing(folder, tmp_path, capsys, arguments, says):
    out = tmp_path / "out"
    before = files_in(folder)
    assert main([word.format(folder=folder, out=out) for word in arguments]) == 2
    said = capsys.readouterr()
    assert says.lower() in said.err.lower()
    assert said.err.startswith("ctrl-realize: ")
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert list(tmp_path.iterdir()) == []
    assert files_in(folder) == before


@pytest.mark.usefixtures("without_figures")
def test_other_files_of_an_existing_folder_stay_and_old_results_are_replaced(folder, tmp_path):
    (tmp_path / "mine.txt").write_text("keep", encoding="utf-8")
    (tmp_path / "report.html").write_text("old", encoding="utf-8")
    words = ["identify", str(folder / "step_0.csv"), "-o", str(tmp_path), *FAST]
    assert main(words) == 2  # whose report that is, nobody knows
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "old"
    assert main([*words, "--overwrite"]) == 0
    assert main(words) == 0  # its own results
    assert (tmp_path / "mine.txt").read_text(encoding="utf-8") == "keep"
    assert (tmp_path / "report.html").read_text(encoding="utf-8") != "old"
    assert not [one for one in tmp_path.parent.iterdir() if one.name.endswith(".tmp")]


def test_a_model_is_compared_with_a_measured_frf(folder, first, tmp_path, capsys):
    model, frf = str(first[0] / "model.json"), str(folder / "frf.csv")
    assert main(["compare", model, frf, "--band", "0.1", "5", "-o", str(tmp_path / "frf")]) == 0
    said = capsys.readouterr().out
    comparison = cr.compare_frf(cr.load_model(model), cr.read_frf(frf), band_hz=(0.1, 5))
    assert comparison.report() in said
    assert files_in(tmp_path / "frf") == {
        "frf_comparison.csv", "report.html", "figures/frf.png", "figures/frf_error.png",
        "manifest.json",
    }  # fmt: skip
    assert main(["compare", model, frf]) == 0
    assert "nothing was written" in capsys.readouterr().out


def test_a_valve_test_gives_tables_and_a_report_and_limits_are_judged(tmp_path, capsys):
    levels = [50, 52, 50, 60, 50, 0, 100, 0]
    command = np.concatenate([np.full(100, float(level)) for level in levels])
    time = 0.05 * np.arange(command.size)
    stem = np.convolve(np.diff(command, prepend=50), 1 - np.exp(-time / 0.4))[: time.size] + 50
    stem += 0.01 * np.random.default_rng(0).standard_normal(time.size)
    file, out = tmp_path / "test.csv", tmp_path / "out"
    pd.DataFrame({"time_s": time, "command": command, "stem": stem}).to_csv(file, index=False)
    words = ["valve", str(file), "--command-range", "0", "100", "--travel-range", "0", "100",
             "--no-fit", "--limit", "t86@2=0.5", "--limit", "stroke_time_opening=1:3"]  # fmt: skip
    assert main([*words, "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Limits not met: T86 (2 % opening), T86 (2 % closing)." in said
    assert main(words) == 0
    assert (
        said.split("\nwritten to")[0] == capsys.readouterr().out.split("\nnothing was written")[0]
    )
    metrics = pd.read_csv(out / "metrics.csv", index_col=0)
    assert metrics.loc["stroke_time_opening", "judgement"] == "met"
    # 2 lags and half a sample, from the sum in place of the integral
    assert metrics.loc["t86"].iloc[0]["value"] == pytest.approx(0.8, abs=0.03)
    assert pd.read_csv(out / "sizes.csv")["count"].sum() == 7
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg ") == 6
    assert "not verified against the document" in page
    assert "t86@2=0.5" in page
    assert main([*words, "--limit", "t86=3", "-o", str(tmp_path / "no")]) == 2
    assert "either for all sizes or by size" in capsys.readouterr().err
    assert main([*words, "--limit", "t86", "-o", str(tmp_path / "no")]) == 2
    assert "expected metric=largest" in capsys.readouterr().err


def test_a_loop_is_diagnosed_from_a_file_with_a_set_point(tmp_path, capsys):
    loop = cr.bench.valve_loop(cr.actuators.KanoStiction(5, 2), process="flow", noise=0.1)
    record = loop.simulate(600.0, rng=2).record
    value = np.where(np.isin(record.time, (30, 31, 500)), np.nan, record.output)
    columns = {"time_s": record.time, "op": record.input, "pv": value, "sp": 50.0}
    file, out = tmp_path / "trend.csv", tmp_path / "out"
    pd.DataFrame(columns).to_csv(file, index=False)
    words = ["loop", str(file), "--input", "op", "--output-column", "pv",
             "--reference", "sp", "--process", "flow", "-o"]  # fmt: skip
    assert main([*words, str(out)]) == 0
    said = capsys.readouterr().out
    assert "3 of 600 samples were missing" in said
    assert pd.read_csv(out / "methods.csv", index_col=0).loc["curve_fit", "verdict"] == "stiction"
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg ") == 4
    assert "the valve sticks" in page
    assert main(words[:-1]) == 0
    assert said.split("\nwritten to")[0] in capsys.readouterr().out
    assert files_in(tmp_path) == {file.name, *(f"out/{name}" for name in files_in(out))}
    assert main(["loop", str(file), str(file), "-o", str(tmp_path / "no")]) == 2


class Terminal(StringIO):
    def isatty(self):
        return True


def test_the_result_is_on_the_terminal_before_figures_are_drawn_and_they_can_be_left_out(
    folder, first, tmp_path
):
    model, frf, terminal = str(first[0] / "model.json"), str(folder / "frf.csv"), Terminal()
    files = [str(folder / f"step_{k}.csv") for k in range(2)]
    with redirect_stdout(terminal), redirect_stderr(terminal):
        assert main(["compare", model, frf, "-o", str(tmp_path / "frf")]) == 0
        said = terminal.getvalue()
        assert 0 < said.index("relative error") < said.index("drawing the figures")
        assert said.index("drawing the figures") < said.index("written to")
        alone = ["--no-report", "-o"]
        assert main(["compare", model, frf, *alone, str(tmp_path / "table")]) == 0
        assert main(["identify", *files, *FAST, *alone, str(tmp_path / "many")]) == 0
    assert "drawing" not in terminal.getvalue().removeprefix(said)
    assert files_in(tmp_path / "table") == {"frf_comparison.csv", "manifest.json"}
    names = files_in(tmp_path / "many")
    assert "records.csv" in names
    assert not any("report" in name or "figures" in name for name in names)


PROBE = """
import sys
from ctrl_realize.cli import main
for words in ["--help"], ["--version"], ["invent"], ["identify", "--help"], ["identify", "nix.csv"]:
    main(words)
heavy = {"numpy", "scipy", "control", "matplotlib", "pandas", "jinja2", "joblib", "tqdm", "rich"}
sys.exit(" ".join(heavy & set(sys.modules)) or 0)
"""


def test_help_version_and_wrong_commands_wait_for_no_heavy_import(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", PROBE], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (done.returncode, "Usage: ctrl-realize identify" in done.stdout) == (0, True)


def test_the_version_is_told(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr() == (f"ctrl-realize {cr.__version__}\n", "")


def test_units_of_a_frequency_response_can_be_told(folder, first, tmp_path, capsys):
    frf = cr.read_frf(folder / "frf.csv")
    columns = {
        "f": 2 * np.pi * frf.frequency_hz,
        "magnitude": 20 * np.log10(np.abs(frf.complex)),
        "phase": np.unwrap(np.angle(frf.complex)),
    }
    pd.DataFrame(columns).to_csv(tmp_path / "frf.csv", index=False)
    model = str(first[0] / "model.json")
    units = ["--frequency-unit", "rad/s", "--magnitude-unit", "dB", "--phase-unit", "rad"]
    assert main(["compare", model, str(tmp_path / "frf.csv"), *units]) == 0
    assert main(["compare", model, str(folder / "frf.csv")]) == 0
    one, two = capsys.readouterr().out.split("relative error")[1:]
    assert one.split("\n")[0] == two.split("\n")[0]


@pytest.mark.usefixtures("without_figures")
def test_records_of_different_plants_are_kept_apart_on_request(folder, tmp_path, capsys):
    slow = cr.bench.valve(dt=2e-3, pre_step_time=0.5, hold=1.0).step_record(16.0, rng=0)
    files = [str(folder / "step_0.csv"), str(save(slow, tmp_path / "slow.csv"))]
    assert main(["identify", *files, "-o", str(tmp_path / "one"), *FAST]) == 2
    assert "--separate" in capsys.readouterr().err
    assert main(["identify", *files, "-o", str(tmp_path / "out"), "--separate", *FAST]) == 0
    assert {"step_0/model.json", "slow/model.json"} <= files_in(tmp_path / "out")


@pytest.mark.filterwarnings("default::ctrl_realize.errors.DataWarning")
def test_a_valve_test_with_missing_samples_is_refused_with_options_that_there_are(tmp_path, capsys):
    time = 0.1 * np.arange(300)
    command = np.where(time < 10, 50.0, 60.0)
    columns = {"time_s": time, "command": command, "stem": np.roll(command, 5)}
    assert main(["valve", "--help"]) == 0
    options = capsys.readouterr().out
    for name, code in (("stem", 2), ("command", 0)):  # a command holds its value meanwhile
        columns[name] = np.where(np.arange(300) == 200, np.nan, columns[name])
        file = tmp_path / f"{name}.csv"
        pd.DataFrame(columns).to_csv(file, index=False)
        columns["stem"] = np.roll(command, 5)
        words = [str(file), "-o", str(tmp_path / name), "--no-report", "--no-fit"]
        assert main(["valve", *words]) == code
        said = capsys.readouterr().err
        assert all(option in options for option in re.findall(r"--[a-z-]+", said)), said
        assert ("--from and --to" in said) == (code == 2)


def test_jittering_samples_of_a_loop_are_resampled_on_request(tmp_path):
    rng = np.random.default_rng(0)
    time = np.arange(600) + 0.05 * rng.standard_normal(600)
    swing = np.sin(2 * np.pi * time / 40)
    columns = {"time_s": time, "op": 50 + 5 * swing, "pv": 20 - 3 * np.roll(swing, 10)}
    pd.DataFrame(columns).to_csv(tmp_path / "loop.csv", index=False)
    words = ["loop", str(tmp_path / "loop.csv"), "-o", str(tmp_path / "out"), "--no-report"]
    assert main([*words, "--input", "op", "--output-column", "pv", "--resample"]) == 0


def test_no_process_at_all_is_refused_by_the_name_of_the_option(folder, tmp_path, capsys):
    files = [str(folder / f"step_{k}.csv") for k in range(2)]
    assert main(["identify", *files, "-o", str(tmp_path / "out"), "--jobs", "0"]) == 2
    said = capsys.readouterr().err
    assert "--jobs 0; expected a number of processes, or -1 for all" in said


@pytest.mark.parametrize("command", [[], ["identify"], ["compare"], ["valve"], ["loop"]])
def test_help_has_examples_and_exit_codes(command, capsys):
    assert main([*command, "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "130 interrupted; 143 terminated" in said
    if command:
        assert f"ctrl-realize {command[0]} " in said.split("Examples:")[1]


def test_the_page_on_the_command_line_has_the_exit_codes_of_the_help(capsys):
    assert main(["--help"]) == 0
    codes = re.findall(r"\d+", capsys.readouterr().out.split("Exit codes:")[1])
    page = Path(__file__).parents[1] / "docs" / "api" / "command_line.md"
    said = page.read_text(encoding="utf-8").split("exit code")[1].split("manifest.json")[0]
    assert sorted(set(re.findall(r"\d+", said)), key=int) == codes


@pytest.mark.usefixtures("without_figures")
def test_names_of_files_reach_terminal_page_table_and_folder_as_names_alone(
    folder, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    # a bell and a tag, formulas, dots that lead out, and too many bytes for the name of a file
    hostile = ["\x07<b>$x^{.csv", "=cmd|' calc'!A1.csv", "+1;=2.csv", "...csv"]
    names = [*hostile, f"{chr(0x20000) * 62}.csv"]
    for name in names:
        Path(name).write_bytes((folder / "step_0.csv").read_bytes())
    assert main(["identify", "--output", "a/out", *FAST, *names]) == 0
    assert "\x07" not in capsys.readouterr().out
    page = Path("a/out/report.html").read_text(encoding="utf-8")
    assert "<b>$x" not in page
    assert "\x07" not in page
    rows = pd.read_csv("a/out/records.csv", index_col="record")
    assert list(rows.index[1:3]) == ["'=cmd|' calc'!A1", "'+1;'=2"]
    assert rows["delay"].notna().all()
    assert len(list(Path("a/out/models").iterdir())) == len(names)
    assert main(["identify", names[0], names[3], "-o", "a/apart", "--separate", *FAST]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {*names, "a"}
    assert {path.name for path in Path("a").iterdir()} == {"out", "apart"}
