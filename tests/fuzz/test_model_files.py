"""Model files with bytes changed, and with values changed by somebody who can sign them."""

import copy
import json

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.io import load_model, save_model
from tests.fuzz.draws import any_float, any_text, some
from tests.fuzz.lane import fuzz, good_end
from tests.fuzz.test_binary_files import damaged
from tests.io.test_model_files import Fit, signed


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    core = ct.ss([[0.9, 0.1], [0, 0.5]], [[0], [1]], [[1, 0]], 0, 0.1)
    path = tmp_path_factory.mktemp("models") / "model.json"
    save_model(path, cr.delayed_ss(core, 3, name="m", fit=Fit()))
    return path


ODD_VALUES = (
    None, True, False, 10**9, -(10**400), 10**400, 5e-324, 1.7e308, -0.0, "", "a.b", "\ud800",
)  # fmt: skip


def any_value(rng, depth=2):
    """Anything that JSON can hold."""
    kind = rng.randrange(7 if depth else 5)
    if kind < 2:
        return rng.choice(ODD_VALUES)
    if kind == 2:
        return rng.randint(-3, 50)
    if kind == 3:
        return any_float(rng, finite=True)
    if kind == 4:
        return any_text(rng, 5)
    values = some(rng, lambda r: any_value(r, depth - 1), 3)
    return values if kind == 5 else {any_text(rng, 4): value for value in values}


def places(content, path=()):
    """All positions in a tree of JSON."""
    yield path
    if isinstance(content, dict | list):
        for key in content if isinstance(content, dict) else range(len(content)):
            yield from places(content[key], (*path, key))


@fuzz(150)
def test_signed_nonsense_is_refused_or_makes_a_model_that_saves_to_itself(rng, file):
    content = json.loads(file.read_text())
    del content["sha256"]
    for _ in range(rng.randint(1, 3)):
        path = rng.choice([p for p in places(content) if p])
        part = content
        for key in path[:-1]:
            part = part[key]
        if rng.randrange(2):
            part[path[-1]] = any_value(rng)
        elif isinstance(part, list):
            part.insert(path[-1], copy.deepcopy(part[path[-1]]))
        else:
            del part[path[-1]]
    other = file.with_name("signed.json")
    try:
        other.write_text(signed(content))
    except ValueError:
        # too many digits for Python to write
        return
    with good_end() as models:
        models.append(load_model(other))
    for model in models:
        again = file.with_name("again.json")
        save_model(again, model)
        second = load_model(again)
        np.testing.assert_array_equal(second.A, model.A)
        assert (second.name, second.dt) == (model.name, model.dt)
        assert np.isfinite(model.A).all()


@fuzz(150)
def test_damaged_model_files_are_refused_or_the_same_model(rng, file):
    other = file.with_name("damaged.json")
    other.write_bytes(damaged(rng, file.read_bytes()))
    with good_end() as models:
        models.append(load_model(other))
    for model in models:
        np.testing.assert_array_equal(model.A, load_model(file).A)
