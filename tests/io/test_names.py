"""Names and units of every printable character, on their way from a file to a report."""

import csv
import dataclasses
import html
import sys

import control as ct
import numpy as np
import pandas as pd
import pytest

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.cli.results import file_name
from ctrl_realize.io.text.csv_files import write_csv
from ctrl_realize.plots.names import wrapped

UNITS = [
    "Temp [°C]", "flow [µl/s]", "R [Ω]", "V [m³]", r"back\slash [\1]", r"\g<0> [\u00b0]",
    "50 % of {span} [%]", "$cost$ [$]", r"a\$b$ [\$]", "x_{1}^2 [m^2]", "#0072b2", 'id="a" url(#b)',
    "<b> & 'c'",
]  # fmt: skip
PRINTABLE = "".join(filter(str.isprintable, map(chr, range(sys.maxunicode + 1))))
PIECE = 150
PIECES = [PRINTABLE[start : start + PIECE] for start in range(0, len(PRINTABLE), PIECE)]


def step_samples():
    t = 0.1 * np.arange(150)
    u = (t >= 3.0).astype(float)
    y = np.where(t > 5.0, 1.5 * (1 - np.exp(-(t - 5.0) / 1.5)), 0.0)
    return t, u, y + 0.004 * np.random.default_rng(1).normal(size=t.size)


@pytest.fixture(scope="module")
def fitted():
    record = cr.Record(*step_samples())
    return cr.identify(record, method="scan", order=1, max_delay=40)


def test_a_file_gives_every_printable_character_of_its_header_back(tmp_path):
    for start in range(0, len(PIECES), 300):
        names = [f"{k} {piece} |" for k, piece in enumerate(PIECES[start : start + 300])]
        path = tmp_path / f"{start}.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time_s", "u", *names])
            writer.writerows([[k, k % 2, *[k] * len(names)] for k in range(4)])
        record = cr.read_record(path, output=list(range(2, 2 + len(names))))
        assert list(record.output_labels) == names
        assert record.n_samples == 4


def test_model_file_and_table_give_every_printable_character_back(tmp_path):
    count = len(PIECES)
    model = cr.delayed_ss(
        ct.ss(0.5, 1, np.ones((count, 1)), np.zeros((count, 1)), 0.1), 3, name=UNITS[0] + PIECES[0],
        outputs=PIECES,
    )  # fmt: skip
    cr.save_model(tmp_path / "model.json", model, note=PRINTABLE)
    loaded = cr.load_model(tmp_path / "model.json")
    assert loaded.name == (UNITS[0] + PIECES[0]).replace(".", "_")  # python-control takes no dot
    assert loaded.output_labels == [piece.replace(".", "_") for piece in PIECES]
    write_csv(
        tmp_path / "table.csv", pd.DataFrame({"name": ["x" + p for p in PIECES]}), index=False
    )
    read = pd.read_csv(tmp_path / "table.csv", keep_default_na=False)
    assert list(read["name"]) == ["x" + piece for piece in PIECES]


def test_a_store_gives_a_name_of_every_printable_character_back(tmp_path):
    record = cr.Record(*step_samples(), name=r"a\1 {b} $c$", input_labels=["FIC101.OP"])
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    campaign = cr.identify_campaign([record], store=store, method="scan", order=1, max_delay=40)
    (row,) = campaign.rows
    assert (row.name, row.error, row.warnings) == (r"a\1 {b} $c$", None, ())
    assert row.system.input_labels == ["FIC101_OP"]
    with store.opened():
        for start in range(0, len(PRINTABLE), 1000):
            name = PRINTABLE[start : start + 1000]
            store.save([("key", dataclasses.replace(row, name=name))], "settings")
            kept = store.load("key")
            assert kept is not None
            assert kept.name == name


def test_a_report_shows_names_and_units_as_they_are_written(tmp_path, fitted):
    name, unit = r"\1 {a} % $b$ x_{1}", r"$\g<0>$ [°CµΩ³]"
    record = cr.Record(*step_samples(), name=name, input_labels=[unit], output_labels=["." + unit])
    path = report.write_identification(
        tmp_path / "r.html", fitted, record, settings={name: unit}, calls=[(name, unit)]
    )
    text = html.unescape(path.read_text(encoding="utf-8"))
    assert text.count(name) >= 3  # heading, setting, call
    assert text.count(unit) >= 4  # setting, call, both axes of the record
    assert '"\\u00b0C\\u00b5\\u03a9\\u00b3"' in text  # for reading off values: JSON


@pytest.mark.parametrize("method", ["output_error", "scan"])
def test_tags_with_dots_stay_with_the_record_and_are_allowed_in_the_model(method):
    record = cr.Record(
        *step_samples(), name="loop.7", input_labels=["FIC101.OP"], output_labels=["TIC101.PV"]
    )
    system = cr.identify(record, method=method, order=1)
    assert (system.name, system.input_labels, system.output_labels) == (
        "loop_7", ["FIC101_OP"], ["TIC101_PV"],
    )  # fmt: skip
    assert record.input_labels == ("FIC101.OP",)
    assert record.to_response().input_labels == ["FIC101.OP"]
    assert np.isfinite(ct.dcgain(system))


def test_a_dollar_sign_at_the_end_of_a_line_is_no_formula():
    assert wrapped("a" * 17 + "$ and $b", 18).split("\n")[0] == "a" * 17 + r"\$"


def test_tags_that_differ_in_a_dot_alone_stay_apart_in_the_model():
    core = ct.ss(0.5 * np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)), 0.1)
    system = cr.delayed_ss(core, 1, inputs=["a.b", "a_b"], outputs=["y.1", "y.2"])
    assert system.input_labels == ["a_b_2", "a_b"]
    assert system["y_2", "a_b"].issiso()
    frf = cr.MeasuredFRF(np.ones((2, 2, 3)), [1, 2, 3], name="run.1", inputs=["a.b", "a_b"])
    assert (frf.name, frf.input_labels) == ("run_1", ["a_b_2", "a_b"])


def test_a_dot_in_a_name_is_an_underscore_of_every_system_with_a_delay_line():
    plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01, name="FIC101.PV")
    pi = ct.tf([2.0, -1.8], [1, -1], 0.01)
    predictor = cr.design.smith_predictor(plant, pi, name="FIC101.OP")
    regulator = cr.design.lqg(plant, 1, 1, 1, 1, name="FIC101.OP")
    names = [one.name for one in (plant, predictor, regulator)]
    assert names == ["FIC101_PV", "FIC101_OP", "FIC101_OP"]


def test_any_name_makes_a_name_of_a_file(tmp_path):
    for piece in PIECES[:300]:
        (tmp_path / f"001_{file_name(piece)}.json").write_text("", encoding="utf-8")
