"""The scripts in examples/."""

import json
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ctrl_realize as cr

FOLDER = Path(__file__).resolve().parents[1] / "examples"


@pytest.fixture(scope="module")
def demo():
    return runpy.run_path(str(FOLDER / "demo.py"))["main"]


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")  # of the reports; those of the paper are drawn
def test_the_demo_does_the_paper_from_end_to_end(demo, tmp_path, capsys):
    out = tmp_path / "demo"
    demo(["-o", str(out), "--seed", "3"])
    names = {path.relative_to(out).as_posix() for path in out.rglob("*")}
    assert {"report.html", "model.json", "model_paper.json", "table_1.csv"} <= names
    figures = {name.split("/")[1][:4] for name in names if name.startswith("figures/fig")}
    assert figures == {f"fig{k}" for k in range(2, 9)}
    table = pd.read_csv(out / "table_1.csv", index_col="number")
    np.testing.assert_array_equal(table.filter(like="printed"), cr.paper.TABLE_1)
    ours = table.filter(like="simulated").to_numpy()
    assert ours.shape == (10, 4)
    # Table 1: mean 37 and variance 2 without the three values at each end, at 4 mA as at 16 mA.
    statistics = cr.paper.trimmed_statistics(ours, cr.paper.SETTINGS.trim)
    assert statistics.mean == pytest.approx(37, abs=1)
    assert statistics.variance == pytest.approx(2, abs=1.2)
    # The method as printed is late by its filter's 13 samples and more (paper map, E11).
    late = ours.mean() - cr.bench.paper_valve().truth.delay
    assert 13 < late < 25
    content = json.loads((out / "model.json").read_text(encoding="utf-8"))
    assert content["provenance"]["settings"]["simulated"] is True
    said = capsys.readouterr().out
    assert "simulated; none are measured" in said
    assert "simulated data" in (out / "report.html").read_text(encoding="utf-8")
    assert cr.read_record(out / "record_simulated.csv").n_samples == 6400
    frf = cr.read_frf(out / "frf_simulated.csv")
    assert frf.frequency_hz.size == 500
    # The fit has the dead time of its record, the sweep the mean, with backlash: apart from a delay
    # of a few samples, the truth of order 4 with 30 Hz LVDT is known to much better than this.
    model = cr.load_model(out / "model.json")
    hz = frf.frequency_hz[frf.frequency_hz < 13]
    ratio = model(np.exp(2j * np.pi * hz * model.dt))
    ratio = ratio / cr.bench.paper_valve().truth.response(2 * np.pi * hz)
    late = -np.polyfit(2 * np.pi * hz, np.unwrap(np.angle(ratio)), 1)[0]
    assert abs(late) / model.dt < 6
    assert np.abs(ratio * np.exp(2j * np.pi * hz * late) - 1).max() < 0.01


def test_the_demo_refuses_a_seed_below_zero(demo, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        demo(["-o", str(tmp_path / "out"), "--seed", "-1"])
    assert ended.value.code == 2
    assert "--seed" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
