"""Output-error fits of records whose input is no step."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import NoStepError
from tests.rigs import R1, R3

DT = 0.01
DELAY = 12.4


def cut_from_operation(kind, plant, seed, n=1200, skip=300):
    """A record that starts while the plant is moving; 5 % noise."""
    rng = np.random.default_rng(seed)
    k = np.arange(n + skip)
    if kind == "prbs":
        u = np.repeat(rng.choice([-1.0, 1.0], k.size // 10 + 1), 10)[: k.size]
    else:
        u = np.sin(2 * np.pi * np.cumsum(np.geomspace(0.1, 8, k.size)) * DT)
    y = cr.delayed_ss(plant, dead_time=DELAY * DT, dt=DT).simulate(u)
    y = y + 0.05 * y.std() * rng.standard_normal(k.size)
    return cr.Record(k[skip:] * DT, 4 + u[skip:], 3 + y[skip:], name=kind)


@pytest.mark.parametrize(("kind", "plant"), [("prbs", R1), ("prbs", R3), ("chirp", R3)])
def test_the_dead_time_is_found_from_operation_with_unknown_start(kind, plant):
    fit = cr.fit_delay(cut_from_operation(kind, plant, seed=1)).fit
    error = fit.dead_time / DT - DELAY
    assert abs(error) < 4 * fit.std / DT
    assert fit.std / DT < 0.2
    assert fit.interval[0] <= DELAY * DT <= fit.interval[1]
    assert fit.structure == ((1, 1) if plant is R1 else (3, 3))


def test_an_input_that_never_holds_is_no_step(shared_data):
    # the first half of this record has moves that pass for one edge
    table = np.loadtxt(shared_data / "exchanger" / "record.csv", delimiter=",", skiprows=1)
    whole = cr.Record(*table.T)
    first, second = whole.between(0, 2000), whole.between(2001, 4000)
    model = cr.fit_delay(first)
    assert np.isnan(model.fit.onset)
    assert model.fit.dead_time <= 1.0  # s, one sample: the delay is 0
    assert cr.check_residuals(model, second).fit_percent[0] > 35


def test_records_without_a_step_are_not_averaged_at_one():
    records = [cut_from_operation("prbs", R1, seed) for seed in (0, 1)]
    with pytest.raises(NoStepError, match="impulse_from_io"):
        cr.fit_delay(records)
