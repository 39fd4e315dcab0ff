"""The fit of records of any input, step by step, with fits that are by hand."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.sampled_data import cut
from ctrl_realize.numerics.sampled_fit import (
    fit_sampled,
)
from ctrl_realize.numerics.separable_fit import KnownFactor, Structure, respond

ONE, TWO, THREE = Structure(1, 1), Structure(2, 2), Structure(3, 3)
DT = 0.5
NOTHING = KnownFactor()


def records(*lengths, seed=0):
    rng = np.random.default_rng(seed)
    outputs = [rng.standard_normal(n) for n in lengths]
    return outputs, [rng.standard_normal(n) for n in lengths]


def exact(delay=2.3, gain=0.4, lengths=(90, 70), seed=1, lag=5.0):
    """Records of one lag behind a delay, on a level of 3, from their first samples on."""
    _, inputs = records(*lengths, seed=seed)
    parameters = np.array([delay, np.log(1 / lag)])
    rest = cut([np.zeros(n) for n in lengths], inputs, DT)
    model = respond(rest.problem(NOTHING).drive, NOTHING, np.array([gain]), parameters)
    parts = np.split(model, rest.edges[1:-1])
    return [3.0 + part for part in parts], inputs, parameters


def test_records_of_different_lengths_with_a_slow_disturbance_are_fitted_together():
    outputs, inputs, _ = exact(lengths=(500, 333), lag=2.0, gain=1.0)
    for i, y in enumerate(outputs):
        y += np.sin(2 * np.pi * np.arange(y.size) / 300 + i)
        y += 0.02 * np.random.default_rng(i).standard_normal(y.size)
    found = fit_sampled(outputs, inputs, DT, structures=[ONE])
    # cosines in one record and the other, as many as half periods of 43 s go into them
    assert np.isfinite(found.data.period)
    assert found.fit.low < 2.3 < found.fit.high
    assert found.fit.delay == pytest.approx(2.3, abs=0.1)
