"""One row of a campaign, with models that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification.campaign_row import (
    fingerprint,
    identify_row,
    read_source,
)

DT = 0.1
TIME = DT * np.arange(200)


def record(name="", step=-4.0, offset=0.0, **labels):
    moved = step * (np.arange(200) >= 60)
    return cr.Record(TIME, moved, offset + 2 * moved, name=name, **labels)


def of(source, position=0, method="scan", options=None, store=None):
    return identify_row(source, position, method, {} if options is None else options, store)


def test_a_function_that_gives_no_record_is_named_by_what_it_gives():
    assert of(dict).error.startswith("DataError: the function gave a dict")
    one = record()
    assert read_source(one) is one
    assert read_source(lambda: one) is one
    with pytest.raises(DataError, match="gave a str"):
        read_source(str)


def test_the_key_of_a_row_depends_on_samples_labels_method_and_options_alone():
    one = record("a", offset=0.5)
    assert fingerprint(record("b", offset=0.5), "scan", {}) == fingerprint(one, "scan", {})
    later = cr.Record(TIME + 1, one.input, one.output)
    other = cr.Record(TIME, one.input, one.output, output_labels=["level"])
    keys = [
        fingerprint(one, "scan", {}),
        fingerprint(one, "paper", {}),
        fingerprint(one, "scan", {"order": 2}),
        fingerprint(one, "scan", {"order": 3}),
        fingerprint(record(), "scan", {}),
        fingerprint(record(step=-4 - 1e-15, offset=0.5), "scan", {}),
        fingerprint(later, "scan", {}),
        fingerprint(other, "scan", {}),
        fingerprint(record(offset=0.5, input_labels=["valve"]), "scan", {}),
    ]
    assert len(set(keys)) == len(keys)
    ways = [{"order": 2, "samples": 9}, {"samples": 9, "order": 2}]
    assert len({fingerprint(one, "scan", way) for way in ways}) == 1


def test_the_key_tells_inputs_from_outputs():
    u, y, x = np.random.default_rng(0).standard_normal((3, 200))
    two_inputs = cr.Record(
        TIME, np.stack([u, y]), x[None], output_labels=["c"], input_labels=["a", "b"]
    )
    two_outputs = cr.Record(
        TIME, u[None], np.stack([y, x]), input_labels=["a"], output_labels=["b", "c"]
    )
    assert len({fingerprint(r, "scan", {}) for r in (two_inputs, two_outputs)}) == 2


@pytest.mark.parametrize(
    "known",
    [
        lambda pole=2.0, gain=1.0, dt=0: ct.tf([gain], [1.0, pole], dt),
        lambda pole=2.0, gain=1.0, dt=0: ct.ss([[-pole]], [[1.0]], [[gain]], [[0.0]], dt),
        lambda pole=2.0, gain=1.0, dt=0: ct.ss([[-2.0]], [[pole]], [[1.0]], [[gain]], dt),
    ],
)
def test_the_key_knows_a_system_by_all_its_digits(known):
    one = record()

    def key(system):
        return fingerprint(one, "output_error", {"known": system})

    same = known()
    same.name = "sensor"
    assert key(same) == key(known())
    # python-control prints eight digits
    others = [known(pole=2 + 1e-12), known(gain=1 + 1e-12), known(dt=DT)]
    assert len({key(system) for system in [same, *others]}) == 4
