"""Results of two runs in one folder: never mixed, replaced on request, and named by a manifest."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pandas as pd
import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.cli.manifest import Run
from ctrl_realize.cli.staging import appearing
from ctrl_realize.errors import OptionError


def files_in(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def write(folder, names, run):
    with appearing(folder, run) as staged:
        for name in names:
            (staged / name).parent.mkdir(exist_ok=True)
            (staged / name).write_text(run.command, encoding="utf-8")


def test_a_folder_with_results_of_another_run_is_refused_or_cleared_on_request(tmp_path):
    out = tmp_path / "out"
    write(out, ["model.json", "records.csv", "models/1.json", "models/2.json"], Run("three files"))
    (out / "models" / "mine.json").write_text("keep")
    before = {name: (out / name).read_bytes() for name in files_in(out)}
    with pytest.raises(OptionError, match=r"made by: three files; .* or --overwrite"):
        write(out, ["model.json"], Run("one file"))
    assert {name: (out / name).read_bytes() for name in files_in(out)} == before
    write(out, ["model.json", "figures/fit.png"], Run("one file", overwrite=True))
    assert files_in(out) == {"manifest.json", "model.json", "figures/fit.png", "models/mine.json"}
    assert (out / "model.json").read_text() == "one file"


def test_the_same_command_replaces_all_of_its_own_results_and_nothing_else(tmp_path):
    run = Run("command")
    write(tmp_path, ["model.json", "models/1.json", "models/2.json"], run)
    (tmp_path / "notes.txt").write_text("keep")
    write(tmp_path, ["model.json", "models/1.json"], run)  # one record fewer
    assert files_in(tmp_path) == {"manifest.json", "model.json", "models/1.json", "notes.txt"}


def test_a_run_that_fails_leaves_the_results_of_the_last_one(tmp_path):
    run = Run("command")
    write(tmp_path, ["model.json"], run)
    before = {name: (tmp_path / name).read_bytes() for name in files_in(tmp_path)}
    with pytest.raises(ZeroDivisionError), appearing(tmp_path, run):
        raise ZeroDivisionError
    assert {name: (tmp_path / name).read_bytes() for name in files_in(tmp_path)} == before


@pytest.mark.parametrize("name", ["../mine.txt", "{}/mine.txt", "a/../../mine.txt", "..\\mine.txt"])
def test_a_manifest_of_others_removes_nothing_outside_its_folder(tmp_path, name):
    out = tmp_path / "out"
    write(out, ["model.json"], Run("command"))
    (tmp_path / "mine.txt").write_text("keep")
    content = json.loads((out / "manifest.json").read_text())
    (out / "manifest.json").write_text(json.dumps({**content, "files": [name.format(tmp_path)]}))
    write(out, ["model.json"], Run("command"))
    assert (tmp_path / "mine.txt").read_text() == "keep"


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": "ctrl_realize results"}', "null"])
def test_results_without_a_readable_manifest_are_those_of_another_run(tmp_path, text):
    write(tmp_path, ["model.json"], Run("command"))
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(OptionError, match=r"holds other results, such as model\.json"):
        write(tmp_path, ["model.json"], Run("command"))


def test_the_manifest_names_command_versions_inputs_and_files(tmp_path, capsys):
    t = 0.1 * np.arange(150)
    y = np.where(t > 5.0, 1.5 * (1 - np.exp(-(t - 5.0) / 1.5)), 0.0)
    files = []
    for seed in range(2):
        noise = 0.004 * np.random.default_rng(seed).normal(size=t.size)
        files.append(str(tmp_path / f"step_{seed}.csv"))
        columns = {"time_s": t, "input": t >= 3.0, "output": y + noise}
        pd.DataFrame(columns).astype(float).to_csv(files[-1], index=False)
    out = tmp_path / "out"
    options = ["--method", "scan", "--order", "1", "--max-delay", "40", "-o", str(out)]
    assert main(["identify", *files, *options]) == 0
    content = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert content["command"] == (
        f"ctrl-realize identify {' '.join(files)} --method scan --order 1 --max-delay 40"
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
