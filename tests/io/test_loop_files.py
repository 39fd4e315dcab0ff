"""Model files of systems with internal delays."""

import json

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import FileFormatError
from tests.io.test_model_files import signed

PLANT = cr.delayed_ss(ct.tf([1.0], [0.5, 1]), 37, dt=0.01, name="plant")
CONTROLLER = ct.ss([[1.0]], [[1.0]], [[0.01]], [[0.3]], 0.01)
DRYER = ct.tf([2.0], [1.0, 1.0]) * cr.delay(0.3)
SYSTEMS = {
    "discrete loop": ct.feedback(PLANT * CONTROLLER),
    "two delays": ct.feedback(PLANT * CONTROLLER, cr.delayed_ss(ct.ss(0.5, 1, 0.5, 0, 0.01), 400)),
    "continuous loop": ct.feedback(DRYER, ct.tf([1.0], [0.2, 1.0])),
    "transfer function": DRYER,
    "dead time alone": cr.delay(0.125),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_loop_comes_back_with_its_delays(tmp_path, name):
    system = SYSTEMS[name]
    path = tmp_path / "loop.json"
    cr.save_model(path, system)
    loaded = cr.load_model(path)
    assert type(loaded) is type(system)
    assert loaded.internal_delays == system.internal_delays
    for letter in "ABCD":
        assert_array_equal(getattr(loaded.core, letter), getattr(system.core, letter), strict=True)
    for attribute in ("dt", "name", "input_labels", "output_labels"):
        assert getattr(loaded, attribute) == getattr(system, attribute)
    omega = np.array([0.0, 0.3, 2.0, 40.0])
    points = np.exp(1j * omega * system.dt) if system.dt else 1j * omega
    assert_array_equal(loaded(points), system(points))
    again = tmp_path / "again.json"
    cr.save_model(again, loaded)
    assert again.read_bytes() == path.read_bytes()


def test_a_long_delay_in_a_loop_takes_no_room(tmp_path):
    plant = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 1.0), 15_000)
    path = tmp_path / "loop.json"
    cr.save_model(path, ct.feedback(plant))
    assert path.stat().st_size < 3000
    assert cr.load_model(path).internal_delays == (15_000,)


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("internal_delays", [-1], "non-negative"),
        ("internal_delays", ["37"], "finite numbers"),
        ("internal_delays", [True], "finite numbers"),
        ("internal_delays", [37.5], "whole"),
        ("internal_delays", [37, 37, 37, 37], "rows of"),
        ("dt", -1.0, "neither a sample time"),
        ("A", [[1.0]], "rows of"),
    ],
)
def test_a_file_that_is_no_loop_is_refused(tmp_path, key, value, told):
    path = tmp_path / "loop.json"
    cr.save_model(path, SYSTEMS["discrete loop"])
    content = json.loads(path.read_text())
    content["model"][key] = value
    path.write_text(signed(content))
    with pytest.raises(FileFormatError, match=told):
        cr.load_model(path)
