"""Dead times in samples, delays of channels, half rule, step responses in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.delay_split import joined_rows, split_delays
from ctrl_realize.numerics.state_space.process_models import half_rule, process_step
from ctrl_realize.numerics.state_space.responses import markov
from ctrl_realize.numerics.state_space.sampling import (
    sample_with_dead_time,
    split_dead_time,
    zero_order_hold,
)

LAG = (np.array([[-2.0]]), np.array([[2.0]]), np.array([[1.0]]))


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


@pytest.mark.parametrize("fraction", [1e-6, 0.2, 0.5, 0.999])
def test_a_fractional_dead_time_samples_the_delayed_exponential(fraction):
    dt, count = 0.1, 40
    A, B, C, D, delay = sample_with_dead_time(*LAG, np.zeros((1, 1)), dt, (2 + fraction) * dt)
    assert delay == 3
    markov = [D[0, 0]] + [(C @ np.linalg.matrix_power(A, k) @ B)[0, 0] for k in range(count - 1)]
    step = np.concatenate([np.zeros(delay), np.cumsum(markov)])
    time = dt * np.arange(step.size) - (2 + fraction) * dt
    assert_allclose(step, np.where(time > 0, 1 - np.exp(-2 * time), 0), rtol=0, atol=1e-13)


def test_the_hold_integrates_several_inputs_apart():
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [2.0, 0.0]])
    Phi, Gamma = zero_order_hold(A, B, 0.5)
    # a double integrator: polynomials in the sample time
    assert_allclose(Phi, [[1, 0.5], [0, 1]])
    assert_allclose(Gamma, [[2 * 0.125, 0.5], [1.0, 0.0]])


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


@pytest.fixture
def parts():
    rng = np.random.default_rng(0)
    return [
        (0.5 * np.diag(rng.random(n)), rng.normal(size=(n, 2)), rng.normal(size=(1, n)),
         rng.normal(size=(1, 2)))
        for n in (2, 1, 3)
    ]  # fmt: skip


def test_rows_behind_tapped_lines_have_the_delay_of_each_entry(parts):
    taps = np.array([[0, 3], [2, 0], [5, 1]])
    A, B, C, D = joined_rows(parts, taps)
    assert A.shape[0] == 6 + 5 + 3
    whole = markov(A, B, C, D, 30)
    for i, part in enumerate(parts):
        single = markov(*part, 30)[0]
        for j in range(2):
            late = np.concatenate([np.zeros(taps[i, j]), single[j]])[:30]
            assert_allclose(whole[i, j], late, rtol=0, atol=1e-14)


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


@pytest.mark.parametrize(("lag", "second"), [(3.0, 0.0), (3.0, 0.5), (0.5, 3.0), (3.0, 3.0)])
@pytest.mark.parametrize("integrating", [False, True])
def test_the_response_obeys_its_differential_equation(lag, second, integrating):
    # T1 T2 y'' + (T1 + T2) y' + y = u, or its integral, by differences of a fine grid
    h = 1e-3
    t = 1.5 + h * np.arange(3, 9000)
    y = [process_step(t + s, lag, second, 1.5, integrating=integrating) for s in (-h, 0, h)]
    slope, bend = (y[2] - y[0]) / (2 * h), (y[2] - 2 * y[1] + y[0]) / h**2
    forced = lag * second * bend + (lag + second) * slope + y[1]
    # second differences: h^2 / 12 of the fourth derivative, below 1 / 0.5^4
    assert_allclose(forced, t - 1.5 if integrating else 1.0, atol=1e-5)
