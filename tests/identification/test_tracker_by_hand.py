"""What a tracker does between its samples, with solutions that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr

DT = 0.01
POLE = 0.9
CORE = ct.ss([[POLE]], [[1.0]], [[0.1]], [[0.0]], DT)
U = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)


def tracker(**options):
    # 300 samples of memory: an estimate every six
    return cr.DelayTracker(CORE, **{"max_delay": 20, "memory": 3.0, **options})


@pytest.mark.parametrize(("dynamics", "needed"), [(True, 40), (False, 30)])
def test_ten_samples_for_each_parameter_behind_the_largest_delay_are_needed(dynamics, needed):
    one = tracker(dynamics=dynamics)
    for u in U[: needed - 1]:
        one.update(u, u)
    assert one.estimate().reason == f"only {needed - 1} samples yet"
    one.update(1.0, 1.0)
    assert "samples yet" not in one.estimate().reason


def test_the_first_sample_is_rest():
    plain, raised = tracker(), tracker()
    y = cr.DelayedStateSpace(CORE, 7).simulate(U - U[0])
    for u, v in zip(U[:200], y[:200], strict=True):
        plain.update(u - U[0], v)
        # whose squares would leave nothing of the response in double precision
        raised.update(u + 3.0, v + 1e8)
    assert plain.estimate().delay == 7
    # a response of about 1 in steps of 1.5e-8
    assert raised.estimate().dead_time == pytest.approx(plain.estimate().dead_time, abs=1e-6)
