"""One row of a campaign, with models that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.identification.campaign.rows import fingerprint

DT = 0.1
TIME = DT * np.arange(200)


def record(name="", step=-4.0, offset=0.0, **labels):
    moved = step * (np.arange(200) >= 60)
    return cr.Record(TIME, moved, offset + 2 * moved, name=name, **labels)


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
