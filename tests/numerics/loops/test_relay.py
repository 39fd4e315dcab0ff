"""Records of relays told by their thresholds; all simulated."""

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrl_realize.numerics.loops.relay import switched_by_relay

N = 600


def relay_record(rng, turn=1.0, late=0):
    """First-order plant behind five samples of dead time; the relay acts `late` samples later."""
    u, y, state = np.zeros(N), np.zeros(N), 0.0
    noise = 0.02 * lfilter([1.0], [1, -0.9], rng.standard_normal(N))
    for k in range(N):
        y[k] = turn * state + noise[k]
        u[k] = u[k - 1]
        if k == 30:
            u[k] = 1.0
        elif k > 30 and abs(seen := turn * y[k - late]) > 0.2:
            u[k] = -np.sign(seen)
        state = 0.95 * state + 0.05 * (u[k - 5] if k >= 5 else 0.0)
    return y, u


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("seed", range(3))
def test_a_relay_is_told_by_its_thresholds(seed, late, turn):
    assert switched_by_relay(*relay_record(np.random.default_rng(seed), turn, late))


@pytest.mark.parametrize("seed", range(3))
def test_the_same_switches_without_the_relay_are_not_told(seed):
    rng = np.random.default_rng(seed)
    _, u = relay_record(rng)
    y = lfilter(np.r_[np.zeros(6), 0.05], [1, -0.95], u) + 0.05 * rng.standard_normal(N)
    assert not switched_by_relay(y, u)


@pytest.mark.parametrize("held", [1, 10, 50])
def test_random_and_periodic_inputs_are_not_told(held):
    rng = np.random.default_rng(held)
    for levels in (rng.choice([-1.0, 1.0], N // held), np.resize([-1.0, 1.0], N // held)):
        u = np.repeat(levels, held)
        y = lfilter([0.0, 0.05], [1, -0.95], u) + 0.01 * rng.standard_normal(N)
        assert not switched_by_relay(y, u)


def test_a_few_switches_tell_nothing():
    y, u = relay_record(np.random.default_rng(0))
    fifth = np.flatnonzero(np.diff(u))[5]
    assert not switched_by_relay(y[: fifth + 1], u[: fifth + 1])
    assert switched_by_relay(y[: fifth + 2], u[: fifth + 2])
