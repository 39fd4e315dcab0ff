"""Names, means and starts in the table of fits, with simulations that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.identification import cross_validation
from tests.rigs import DT, TWO_STATES

TIME = np.arange(4.0)
LEVELS = np.array([1.0, -1.0, 1.0, -1.0])  # of mean 0 and size 2


def record(name="", output=LEVELS):
    return cr.Record(TIME, np.arange(4.0), output, name=name)


@pytest.fixture
def simulations(monkeypatch):
    """A model by hand leaves a share of every output; asked are all pairs, in their order."""
    asked = []

    def simulate_record(system, given, start):
        asked.append((system, given, start))
        share = getattr(system, "share", system)
        return np.atleast_2d(given.output) * (1 - np.reshape(share, (-1, 1)))

    monkeypatch.setattr(cross_validation, "simulate_record", simulate_record)
    return asked


def test_every_model_is_tried_on_every_record(simulations):
    first, second = record("day 1"), record("day 2", 3 * LEVELS)
    table = cr.cross_validate({"good": 0.25, "bad": 1.5}, [first, second])
    assert list(table.columns) == ["day 1", "day 2"]
    assert list(table.index) == ["good", "bad"]
    # what is left over what there is: 1 - 0.25, and more than there was
    np.testing.assert_allclose(table, [[75.0, 75.0], [-50.0, -50.0]], rtol=1e-12)
    assert [(model, given) for model, given, _ in simulations] == [
        (0.25, first),
        (1.5, first),
        (0.25, second),
        (1.5, second),
    ]
    assert {start for _, _, start in simulations} == {"estimate"}


def test_the_fit_is_the_mean_over_the_outputs(simulations):
    two = record("two", np.stack([LEVELS, 5 * LEVELS]))
    assert cr.cross_validate({"a": [0.25, 0.75]}, two).loc["a", "two"] == pytest.approx(50.0)


def test_nameless_records_and_those_of_one_name_are_numbered(simulations):
    records = [record(), record("day"), record("day"), record()]
    table = cr.cross_validate({"a": 0.5}, records)
    assert list(table.columns) == ["record 0", "day", "day (2)", "record 3"]


def test_one_model_is_called_by_its_name_if_it_has_one(simulations):
    for model, name in (
        (SimpleNamespace(share=0.5, name="valve"), "valve"),
        (SimpleNamespace(share=0.5, name=""), "model"),
        (SimpleNamespace(share=0.5), "model"),
        (SimpleNamespace(share=0.5, name=7), "7"),
    ):
        assert list(cr.cross_validate(model, record()).index) == [name]


def test_a_start_in_motion_is_found_or_taken_as_rest():
    u = np.random.default_rng(0).standard_normal(300)
    y = TWO_STATES.simulate(u)
    cut = cr.Record(DT * np.arange(200), u[100:], y[100:], name="cut")
    found = cr.cross_validate(TWO_STATES, cut)
    assert found.iloc[0, 0] == pytest.approx(100.0, abs=1e-7)  # exact data
    assert cr.cross_validate(TWO_STATES, cut, start="rest").iloc[0, 0] < 99
