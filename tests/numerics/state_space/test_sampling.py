"""Dead times in samples, delays of channels, half rule, step responses in closed form."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import companion

import ctrl_realize as cr
from ctrl_realize.numerics.state_space.delay_split import split_delays
from ctrl_realize.numerics.state_space.process_models import half_rule
from ctrl_realize.numerics.state_space.sampling import split_dead_time


@pytest.mark.parametrize(
    ("samples", "whole", "rest"),
    [
        (0.0, 0, 0.0),
        (3.0, 3, 0.0),
        (3.25, 3, 0.25),
        (1 + 0.5e-9, 1, 0.0),  # nearer than a thousand millionth: rounding
        (1 + 1.5e-9, 1, 1.5e-9),
        (1 - 0.5e-9, 1, 0.0),
        (1 - 1.5e-9, 0, 1 - 1.5e-9),
        (1000 + 0.5e-6, 1000, 0.0),  # rounding grows with the number
        (1000 + 1.5e-6, 1000, 1.5e-6),
    ],
)
def test_a_dead_time_is_whole_samples_and_a_rest(samples, whole, rest):
    found = split_dead_time(samples, 1.0)
    assert found[0] == whole
    assert_allclose(found[1], rest, rtol=0, atol=1e-12)


delays_of = st.lists(st.integers(0, 30), min_size=1, max_size=4)


@given(delays_of, delays_of)
def test_delays_of_outputs_and_inputs_are_found_from_their_sums(outputs, inputs):
    total = np.add.outer(outputs, inputs)
    ways = split_delays(total, np.ones(total.shape, dtype=bool))
    assert len(ways) == 1
    behind, before = ways[0]
    assert np.array_equal(np.add.outer(behind, before), total)
    # What all share may move between the sides; it lies where it takes fewer samples.
    common = min(outputs) + min(inputs)
    least = sum(outputs) - len(outputs) * min(outputs) + sum(inputs) - len(inputs) * min(inputs)
    assert behind.sum() + before.sum() == least + common * min(len(outputs), len(inputs))


def test_what_no_split_explains_is_shared_out_inputs_first_and_outputs_first():
    # the third input has no response
    delays = np.array([[3, 20, -1], [5, 20, -1]])
    _, first, second = split_delays(delays, delays >= 0)
    assert [share.tolist() for share in first] == [[0, 0], [3, 20, 0]]
    # outputs of 3 and 5 samples leave 0 and 15 to the inputs; two outputs, three inputs: what
    # is common lies at the outputs
    assert [share.tolist() for share in second] == [[3, 5], [0, 15, 0]]


def reduced(lags, leads, dead_time, order=1):
    factor, kept, theta = half_rule(np.array(lags), np.array(leads), np.zeros(0), dead_time, order)
    return factor, kept.tolist(), theta


@pytest.mark.parametrize(
    ("lags", "leads", "dead_time", "factor", "kept"),
    [
        ([6.0, 2.0], [8.0], 1.0, 8 / 6, [2.0]),  # T1: T over tau over theta
        ([2.0, 1.0], [8.0], 2.0, 8 / 2, [1.0]),  # tau just theta
        ([2.0, 1.0], [8.0], 4.0, 8 / 4, [1.0]),  # T1a: T over theta over tau
        ([2.0, 1.0], [3.0], 4.0, 1.0, [1.0]),  # T1b: theta over T over tau
        ([9.0, 1.0], [5.0], 1.0, 5 / 9, [1.0]),  # T2: tau over T over five theta
        ([3.0], [2.0], 1.0, 1.0, [1.0]),  # T3: a smaller lag is left
        ([9.0], [2.0], 1.0, 5 / 9, [3.0]),  # T3: tau counts up to five theta
    ],
)
def test_a_lead_is_cancelled_by_its_rule(lags, leads, dead_time, factor, kept):
    found, left, theta = reduced(lags, leads, dead_time)
    assert found == pytest.approx(factor)
    assert left == pytest.approx(kept)
    assert theta == dead_time


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e6])
@pytest.mark.parametrize("dt", [0.1, 2e-4])
@pytest.mark.parametrize("kind", ["transfer function", "companion form"])
def test_lags_are_sampled_alike_in_any_unit_of_time(unit, dt, kind):
    """Six lags against their partial fractions; expm of the matrix as it is has no digits."""
    speeds = np.linspace(0.3, 3, 6)
    den = np.poly(-speeds / unit)
    core = ct.tf([den[-1]], den)
    if kind == "companion form":
        first = np.r_[1.0, np.zeros(5)][:, None]
        core = ct.ss(companion(den), first, den[-1] * first[::-1].T, 0)
    plant = cr.delayed_ss(core, 5, dt=dt * unit)
    shares = [np.prod(np.delete(speeds, i) / (np.delete(speeds, i) - speeds[i])) for i in range(6)]
    z = np.exp(dt * (1e-2 + 1j * np.array([0, 0.1, 1.0])))
    fall = np.expm1(-speeds * dt)[:, None]
    expected = z**-5 * (np.array(shares)[:, None] * fall / (1 - z + fall)).sum(axis=0)
    # the shares are up to 300 of the sum; poles of six lags have lost some digits more
    assert_allclose(plant(z), expected, rtol=0, atol=1e-9)
    if kind == "transfer function":
        found = np.sort(-np.log(plant.delay_free.poles().real)) / dt
        assert_allclose(found, speeds, rtol=1e-5)
