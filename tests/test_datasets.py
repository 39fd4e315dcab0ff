"""Data that come with the package: complete, readable, licensed, and as described."""

import io
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.datasets.__main__ import main

SETS = {name: cr.datasets.load(name) for name in cr.datasets.names()}


@pytest.mark.parametrize("data", SETS.values(), ids=SETS)
def test_every_set_is_as_described_and_states_its_licence(data):
    info = data.info
    files = {each.name: cr.datasets.path(info.name, each.name) for each in info.files}
    assert cr.datasets.path(info.name) == files[info.files[0].name]
    licence = (cr.datasets.path(info.name).parent / "LICENSE").read_text(encoding="utf-8")
    words = {"facts": "facts", "Apache-2.0": "Apache License", "BSD-3-Clause": "BSD 3-Clause"}
    assert words.get(info.licence, info.licence) in licence
    records, frfs = iter(data.records), iter(data.frfs)
    for each in info.files:
        if each.kind == "frf":
            frf, again = next(frfs), cr.read_frf(files[each.name])
            assert frf.frequency_hz.size == each.n_samples
            assert_array_equal(frf.complex, again.complex)
            continue
        record, again = next(records), cr.read_record(files[each.name], **each.reading)
        assert record.n_samples == each.n_samples
        assert record.dt == pytest.approx(each.dt, rel=1e-5)  # stated with six digits
        assert (record.input_labels, record.output_labels) == (each.inputs, each.outputs)
        assert_array_equal(record.output, again.output)
        assert all("[" in label for label in (*each.inputs, *each.outputs))
    assert next(records, None) is next(frfs, None) is None
    assert cr.datasets.table().loc[info.name, "licence"] == info.licence
    shown = data.report()
    assert all(text in shown for text in (info.origin, info.licence, info.citation, *info.facts))


def test_all_sets_together_are_small_and_in_utf_8():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in SETS:
            for file in cr.datasets.path(name).parent.iterdir():
                archive.writestr(f"{name}/{file.name}", file.read_text(encoding="utf-8"))
    assert len(packed.getvalue()) < 1e6


def test_a_name_that_is_unknown_is_answered_with_the_nearest():
    with pytest.raises(cr.errors.OptionError, match=r"'tclabs'; did you mean 'tclab'\? \(expect"):
        cr.datasets.load("tclabs")
    with pytest.raises(cr.errors.OptionError, match="stage has no file 'output'; did you mean 'ou"):
        cr.datasets.path("stage", "output")
    with pytest.raises(cr.errors.OptionError, match="no data set 3 "):
        cr.datasets.path(3)
    with pytest.raises(cr.errors.OptionError, match=r"no record, only .*\.frf"):
        _ = SETS["stage"].record
    with pytest.raises(cr.errors.OptionError, match="spectral_frf"):
        _ = SETS["tclab"].frf


def test_the_path_of_a_file_is_printed_for_the_command_line(capsys):
    assert main(["stage", "output_2"]) == 0
    assert capsys.readouterr().out == f"{cr.datasets.path('stage', 'output_2')}\n"
    assert str(main(["stages"])).startswith("there is no data set 'stages'; did you mean 'stage'?")
    assert main([]) == 0
    assert capsys.readouterr().out.split() == list(SETS)


def test_the_heater_has_the_three_steps_that_are_stated():
    edges = cr.detect_step(SETS["tclab"].record).edges
    sizes = [edge.amplitude for edge in edges]
    assert sizes == pytest.approx([150, -140, 140])
    moved = np.abs(np.diff(SETS["tclab"].records[1].input, axis=1)) > 1
    assert moved.sum() == 6


def test_the_three_lines_find_the_truth_of_the_simulated_valve():
    data = SETS["simulated_valve"]
    sys = cr.identify(cr.read_record(cr.datasets.path("simulated_valve")))
    low, high = sys.fit.interval
    assert low <= data.info.dead_time_band[0] <= high
    # three repeats of each frequency with 0.1 % of noise, and the fit's own error
    assert cr.compare_frf(sys, data.frf).rms_relative_error < 0.01
