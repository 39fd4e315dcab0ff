"""Names, means and starts in the table of fits, with simulations that are written by hand."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from tests.rigs import DT, TWO_STATES


def test_a_start_in_motion_is_found_or_taken_as_rest():
    u = np.random.default_rng(0).standard_normal(300)
    y = TWO_STATES.simulate(u)
    cut = cr.Record(DT * np.arange(200), u[100:], y[100:], name="cut")
    found = cr.cross_validate(TWO_STATES, cut)
    assert found.iloc[0, 0] == pytest.approx(100.0, abs=1e-7)  # exact data
    assert cr.cross_validate(TWO_STATES, cut, start="rest").iloc[0, 0] < 99
