"""Set points and modes of controllers: in records, tables and files."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.errors import DataError, OptionError

TIME = np.arange(6.0)
WANTED = np.array([np.nan, np.nan, 50, 55, 55, 55])
RECORD = cr.Record(TIME, TIME, 2 * TIME, reference=WANTED)
LOOP = """time_s,TIC1.SP,TIC1.PV,TIC1.OP,TIC1.MODE
0,50,50.1,30,MAN
1,50,50.1,30,
2,50,50.1,40,Man
3,55,50.4,41,AUTO
4,,50.9,42,cas
5,55,51,43,AUTO
"""
HISTORIAN = """tag,time,value
TIC1.SP,0,50
TIC1.MODE,0,MAN
TIC1.PV,0,50.1
TIC1.OP,0,30
TIC1.PV,1,50.1
TIC1.PV,2,50.2
TIC1.MODE,2.5,AUTO
TIC1.SP,2.5,55
TIC1.OP,2.5,36
TIC1.PV,3,50.2
TIC1.PV,4,51.2
"""


def read(tmp_path, text, **options):
    file = tmp_path / "loop.csv"
    file.write_text(text)
    return cr.read_record(file, **options)


def test_a_set_point_goes_wherever_a_record_goes():
    assert_array_equal(RECORD[1:3].reference, WANTED[1:4])
    assert_array_equal(RECORD.with_baseline(0, 0).reference, [np.nan, *WANTED])
    assert_array_equal(RECORD.__replace__(output=TIME, missing="keep").reference, WANTED)
    assert_array_equal(pickle.loads(pickle.dumps(RECORD)).reference, WANTED)
    frame = RECORD.to_frame()
    again = cr.Record.from_frame(frame, input="u", output="y", reference="reference")
    assert_array_equal(again.reference, WANTED)
    jitter = TIME + 0.1 * np.sin(3 * TIME)
    uniform = cr.Record.resampled(jitter, TIME, TIME, dt=0.5, reference=WANTED)
    assert np.unique(uniform.reference[~np.isnan(uniform.reference)]).tolist() == [50, 55]
    kept = [0, 1, 2, 4, 5]
    gaps = cr.Record.from_samples(TIME[kept], TIME[kept], TIME[kept], reference=WANTED[kept])
    assert_array_equal(gaps.reference, [np.nan, np.nan, 50, 50, 55, 55])
    assert "set point" in repr(RECORD)
    assert cr.Record(TIME, TIME, TIME).reference is None


@pytest.mark.parametrize("wanted", [WANTED[1:], np.array([WANTED, WANTED]), np.full(6, np.inf)])
def test_a_set_point_has_a_value_for_every_sample_of_the_output(wanted):
    with pytest.raises(DataError, match="reference"):
        cr.Record(TIME, TIME, TIME, reference=wanted)


def test_a_file_of_a_loop_is_read_with_its_set_point_and_mode(tmp_path):
    record = read(tmp_path, LOOP)
    assert record.input_labels == ("TIC1.OP",)
    assert_array_equal(record.reference, [np.nan, np.nan, np.nan, 55, 55, 55])


def test_a_historian_stores_set_point_and_mode_when_they_change(tmp_path):
    record = read(tmp_path, HISTORIAN, missing="hold")
    assert_array_equal(record.reference[record.time < 2.5], np.nan)
    assert_array_equal(record.reference[record.time >= 3], 55)  # the next sample of the output


def test_a_switch_tells_manual_and_automatic(tmp_path):
    record = read(tmp_path, LOOP.replace("MODE", "A/M").replace("MAN", "0").replace("AUTO", "1"))
    assert np.isnan(record.reference).tolist() == [True] * 3 + [False] * 3


def test_columns_of_other_names_are_asked_for(tmp_path):
    text = LOOP.replace("TIC1.SP", "wish").replace("TIC1.MODE", "who")
    signals = {"input": "TIC1.OP", "output": "TIC1.PV"}
    assert read(tmp_path, text, **signals).reference is None
    record = read(tmp_path, text, reference="wish", mode="who", **signals)
    assert_array_equal(record.reference, [np.nan, np.nan, np.nan, 55, 55, 55])


def test_codes_of_modes_that_are_not_known_are_not_guessed(tmp_path):
    text = LOOP.replace("MAN", "16").replace("Man", "16").replace("AUTO", "8").replace("cas", "4")
    assert not np.isnan(read(tmp_path, text).reference).any()
    with pytest.raises(OptionError, match="modes 16, 4, 8; expected man"):
        read(tmp_path, text, mode="TIC1.MODE")


def test_one_set_point_for_each_output(tmp_path):
    with pytest.raises(OptionError, match="one for each of 1 outputs"):
        read(tmp_path, LOOP, output="TIC1.PV", reference=["TIC1.SP", "TIC1.MODE"])


@pytest.mark.parametrize("text", [LOOP, HISTORIAN])
def test_the_preview_of_a_file_names_set_point_and_mode(tmp_path, capsys, text):
    file = tmp_path / "loop.csv"
    file.write_text(text)
    assert main(["look", str(file)]) == 0
    uses = {"SP": "set point", "PV": "output", "OP": "input", "MODE": "mode"}
    lines = capsys.readouterr().out.splitlines()
    for tag, use in uses.items():
        assert next(line for line in lines if f"TIC1.{tag} " in line).endswith(use)


@pytest.mark.parametrize("inner", ["SP2,PV2,OP2", "SP2,PV2"], ids=["complete", "no inner output"])
def test_the_loops_of_a_cascade_are_read_one_at_a_time(tmp_path, inner):
    """What the outer controller asks for is the set point of the inner one."""
    k = np.arange(40)
    asked = 30 + np.round(5 * np.sin(k / 7), 2)
    columns = {"t": k, "SP1": 50 + (k > 9), "PV1": 50 + np.cos(k), "OP1": asked}
    columns |= {"SP2": asked + 0.001 * (k % 2), "PV2": asked + np.cos(k / 3), "OP2": 40 + np.sin(k)}
    names = ["t", "SP1", "PV1", "OP1", *inner.split(",")]
    rows = np.stack([columns[name] for name in names], axis=1)
    text = "\n".join([",".join(names), *(",".join(map(str, row)) for row in rows)])
    with pytest.raises(OptionError, match="'SP2' follows column 'OP1'"):
        read(tmp_path, text)
    outer = read(tmp_path, text, input="OP1", output="PV1", reference="SP1")
    assert_array_equal(outer.input, asked)
    # independent loops are one plant with two inputs
    columns["SP2"] = 30 + (k > 20)
    rows = np.stack([columns[name] for name in ("t", "SP1", "PV1", "OP1", "SP2", "PV2", "OP2")])
    text = "\n".join(["t,SP1,PV1,OP1,SP2,PV2,OP2", *(",".join(map(str, row)) for row in rows.T)])
    assert read(tmp_path, text).reference.shape == (2, 40)
