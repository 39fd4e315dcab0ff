"""How one record or several are fitted, with fits that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests import rigs

DT = 0.1


def record(name="", n=120, amplitude=2.0, delay=7.3, seed=0, **labels):
    """A step at 4 s into a lag of 1 s with a gain of 3, in noise."""
    time = DT * np.arange(n)
    u = amplitude * (np.arange(n) >= 40)
    y = amplitude * rigs.exact_step(ct.tf([3.0], [1.0, 1.0]), time - 4.0 - delay * DT)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(n)
    return cr.Record(time, u, y + noise, name=name, **labels)


def test_one_lag_is_found_in_one_record_and_in_four():
    lag = {"structures": [(1, 1)]}
    one = cr.fit_delay(record(), **lag).fit
    assert one.delay == pytest.approx(7.3, abs=4 * one.std_given_structure / DT)
    several = [record(str(seed), seed=seed) for seed in range(4)]
    four = cr.fit_delay(several, **lag).fit
    # half the standard error, but that noise is estimated
    assert four.std_given_structure == pytest.approx(one.std_given_structure / 2, rel=0.3)
    assert four.delay == pytest.approx(7.3, abs=4 * four.std_given_structure / DT)
    assert four.time[40] == 0.0
    apart = cr.fit_delay([*several, record("late", delay=7.9, seed=9)], **lag).fit
    assert apart.repeatability.outlying == ("late",)
    assert apart.dead_time == pytest.approx(four.dead_time, abs=2 * four.std_given_structure)
