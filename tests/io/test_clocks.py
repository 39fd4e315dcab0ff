"""What the numbers of a time column mean: their unit, where it stands, and how times are said."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize.errors import OptionError
from tests.io.plant_files import response, steps

GAIN, DEAD_TIME, LAG = 12.0, 0.0225, 0.06
T = 1e-3 * np.arange(600)
U = steps(T, [(0.1, 5.0)])
Y = response(T, U, GAIN, DEAD_TIME, (LAG,)) + 0.02 * np.random.default_rng(5).standard_normal(600)


def scope(path, last="Unit Offset", mark="\t", decimal="."):
    """A file of TwinCAT Scope: a block of keys above columns of time in ms and of signals."""
    block = [("Name", "Drive.Torque", "Axis.Velocity"), ("SymbolComment", "", ""),
             ("Data-Type", "REAL64", "REAL64"), ("SampleTime[ms]", "1", "1"),
             ("SymbolName", "MAIN.a", "MAIN.b"), ("Port", "851", "851"),
             ("BitMask", "0xffffffffffffffff", "0xffffffffffffffff"), ("Unit", "(None)", "(None)"),
             ("Unit Offset", "0", "0")]  # fmt: skip
    block = block[: [line[0] for line in block].index(last) + 1]
    lines = ["Name\tProject", "Starttime of export\t132959733843760000\t2. Mai 2022", "", ""]
    lines += [f"{key}\t{one}\t{key}\t{other}" for key, one, other in block] + [""]
    rows = zip(1e3 * T, U, Y, strict=True)
    lines += [f"{t:g}\t{u:g}\t{t:g}\t{y:.4f}".replace(".", decimal) for t, u, y in rows]
    path.write_text("\n".join(lines).replace("\t", mark) + "\n")
    return path


def columns(path, header, factor=1.0):
    rows = [f"{factor * t:.10g},{u},{y:.4f}" for t, u, y in zip(T, U, Y, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("last", "mark", "decimal"),
    [("Unit Offset", "\t", "."), ("BitMask", ";", ","), ("SampleTime[ms]", ",", ".")],
)
def test_a_sample_time_above_the_columns_tells_their_unit(tmp_path, last, mark, decimal):
    path = scope(tmp_path / "scope.csv", last, mark, decimal)
    record = cr.read_record(path, time=0, input="Drive.Torque", output="Axis.Velocity")
    assert_allclose(record.time, T, rtol=1e-12)
    assert record.units["time"] == "ms"
    assert_allclose(record.output, Y, atol=5.1e-5)


def test_a_stated_sample_time_is_compared_with_the_column(tmp_path):
    for factor, unit in ((1e3, "ms"), (1.0, "s")):
        path = columns(tmp_path / "a.csv", "scope,x\nSampleTime[ms],1\n\ntime,u,y", factor)
        record = cr.read_record(path)
        assert_allclose(record.time, T, rtol=1e-12)
        assert record.units["time"] == unit
    path = columns(tmp_path / "a.csv", "scope,x\nSampleTime[ms],1\n\ntime,u,y", 50.0)
    with pytest.raises(OptionError, match=r"steps of 0\.05, .*SampleTime\[ms\] 1; give time_unit="):
        cr.read_record(path)
    assert cr.read_record(path, time_unit="min").dt == pytest.approx(3.0)
    np.savez(tmp_path / "a.npz", u=U, y=Y, **{"dt [ms]": 1.0})
    assert cr.read_record(tmp_path / "a.npz").dt == 1e-3


@pytest.mark.parametrize("name", ["T [°C]", "T (K)", "t [%]", "T [bar]"])
def test_a_column_with_the_unit_of_another_quantity_is_no_time(tmp_path, name):
    record = cr.read_record(columns(tmp_path / "a.csv", f"time [s],u [%],{name}"))
    assert record.output_labels == (name,)
    assert record.dt == 1e-3
    above = f"time,u,T\ns,%,{name[3:-1]}"
    assert cr.read_record(columns(tmp_path / "b.csv", above)).output_labels == ("T",)


def test_seconds_that_were_assumed_are_said(tmp_path):
    path = columns(tmp_path / "a.csv", "t_stamp,u,y")
    record = cr.read_record(path)
    assert repr(record) == "<Record 'a': 600 samples of 0.001 s (assumed), 1 input, 1 output>"
    model = cr.fit_output_error(record, structures="FOPDT")
    said = "time in s (assumed): the file names no unit"
    assert said in model.fit.report()
    cr.save_model(tmp_path / "model.json", model)
    again = cr.load_model(tmp_path / "model.json")
    assert again.fit.report() == model.fit.report()
    page = report.write_identification(tmp_path / "r.html", model, record)
    assert said in page.read_text(encoding="utf-8")
    for header, asked in (("t [s],u,y", {}), ("t,u,y", {"time_unit": "s"}), ("t_s,u,y", {})):
        told = cr.read_record(columns(tmp_path / "a.csv", header), **asked)
        assert "assumed" not in repr(told)
        assert told.units["time"] == "s"
    from_rows = cr.Record(T, U, Y)
    assert "assumed" not in repr(from_rows)
    assert "assumed" not in cr.fit_output_error(from_rows, structures="FOPDT").fit.report()


def test_the_s_of_laplace_stands_beside_seconds_alone(tmp_path):
    """The times of the truth are read off the formula, whatever unit the file has."""
    for header, factor, beside in (
        ("t [ms],u [V],y [mm/s]", 1e3, ""),
        ("t [min],u [V],y [mm/s]", 1 / 60, "L = "),
    ):
        record = cr.read_record(columns(tmp_path / "a.csv", header, factor))
        model = cr.fit_output_error(record, structures="FOPDT")
        first, _, rest = model.fit.formula.partition(", ")
        found = re.fullmatch(r"(\S+) .* e\^\(-(\S+) s\) / \((\S+) s \+ 1\)", first)
        assert_allclose(
            [float(found[k]) for k in (1, 2, 3)], [GAIN, DEAD_TIME, LAG], rtol=0.02, err_msg=first
        )
        assert rest.startswith(beside)
        assert bool(rest) == bool(beside)
        if beside:
            times = re.fullmatch(r"L = (\S+) min, T1 = (\S+) min", rest)
            assert_allclose([60 * float(times[k]) for k in (1, 2)], [DEAD_TIME, LAG], rtol=0.02)
        integrating = cr.fit_output_error(record, structures="IPDT").fit.formula
        assert "(mm/s)/(V s)" in integrating


def test_cards_and_controllers_of_a_file_in_ms_have_a_unit_that_reads(tmp_path):
    slow = columns(tmp_path / "a.csv", "t [ms],u [%],y [°C]", 1e5)
    model = cr.fit_output_error(cr.read_record(slow), structures="FOPDT")
    card, pid = model.fit.report(), cr.design.pid(model, "simc", "PI")
    assert re.search(r"dead time +2\.2\d* s = ", card)
    assert re.search(r"integral ti +(5\.9\d*|6(\.0\d*)?) s\n", pid.report())
    assert "ki = kp / ti = " in pid.report()
    assert "%/(°C s)" in pid.report()
    assert " ms" not in pid.as_form("series").report()
    table = model.fit.parameter_table()
    assert table.loc["lag_1", "unit"] == "s"
    assert table.loc["lag_1", "value"] == pytest.approx(6.0, rel=0.02)
    asked = model.fit.parameter_table(time_unit="ms").loc["lag_1"]
    assert asked["value"] == pytest.approx(6000.0, rel=0.02)
