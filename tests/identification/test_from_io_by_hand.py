"""How `impulse_from_io` chooses length and method, with regressions that are written by hand."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification.from_io import (
    as_group,
)

DT = 0.1


def record(n=900, m=1, p=1, name="", dt=DT):
    def rows(k):
        signals = np.random.default_rng(k).standard_normal((k, n))
        return signals if k > 1 else signals[0]

    return cr.Record(dt * np.arange(n), rows(m), rows(p), name=name)


def test_records_of_one_plant_have_one_sample_time_and_the_same_channels():
    one = record()
    near, far = record(dt=DT * (1 + 0.9e-3)), record(dt=DT * (1 + 1.1e-3))
    assert as_group([one, near]) == (one, near)
    assert as_group(one) == (one,)
    with pytest.raises(DataError, match=r"record 2 has the sample time 0\.10011 s, the first"):
        as_group([one, near, far])
    # of nanoseconds as well
    with pytest.raises(DataError, match="sample time 2e-09 s, the first one 1e-09 s"):
        as_group([record(dt=1e-9), record(dt=2e-9)])
    with pytest.raises(DataError, match="record 1 has 2 inputs and 1 outputs, the first one 1 and"):
        as_group([one, record(m=2)])
    with pytest.raises(DataError, match="record 1 has 1 inputs and 2 outputs"):
        as_group([one, record(p=2)])
