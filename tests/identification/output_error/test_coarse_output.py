"""Records of any input whose output is rounded more coarsely than its noise."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

import ctrl_realize as cr
from tests.rigs import codes

NOISE = 0.1  # quantisation steps


def simulated(seed, step, n, moves):
    """Two lags and a dead time, and a converter that begins anywhere; the input or a set point."""
    rng = np.random.default_rng(seed)
    gain = rng.choice([-1, 1]) * rng.uniform(0.5, 2)
    slow, fast, delay = rng.uniform(5, 15), rng.uniform(1, 5), int(rng.integers(3, 14))
    a, b = np.array([[-1 / slow, 0], [1 / fast, -1 / fast]]), np.array([[1 / slow], [0]])
    a, b, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), 1.0)
    offset = rng.uniform(0, step)
    noise = NOISE * step * rng.standard_normal(n)
    reference, u = moves(rng, n, gain)
    kp, ti = slow / (gain * 2 * (delay + fast / 2 + 1)), slow + fast / 2
    state, integral, y = np.zeros(2), 0.0, np.zeros(n)
    for k in range(n):
        y[k] = step * np.round((gain * state[1] + noise[k] + offset) / step) - offset
        if reference is not None:
            integral += kp * (reference[k] - y[k]) / ti
            u[k] = kp * (reference[k] - y[k]) + integral
        state = a @ state + b[:, 0] * (u[k - delay] if k >= delay else 0.0)
    record = cr.Record(np.arange(float(n)), u, y, reference=reference)
    return record, gain, delay + slow + fast


def set_points(rng, n, gain):
    levels = np.repeat(rng.uniform(-2, 2, 6), 150)
    levels[:150] = 0
    return levels, np.zeros(n)


def signs(rng, n, gain):
    return None, np.repeat(rng.choice([-1.5, 1.5], n // 15), 15) / abs(gain)


@pytest.mark.parametrize(
    ("seed", "step", "n", "moves"),
    [
        (6, 0.1, 900, set_points),  # 1.3 % off, and thought known to 0.5 %
        (8, 0.1, 900, set_points),  # 2.3 % for 0.9 %
        (15, 0.3, 900, signs),  # 2.2 % for 1.4 %, and the total delay
    ],
    ids=["loop", "another loop", "open loop"],
)
def test_rounding_that_does_not_average_out_is_in_the_intervals(seed, step, n, moves):
    record, gain, total = simulated(seed, step, n, moves)
    fit = cr.identify(record).fit
    assert fit.gain_interval[0] <= gain <= fit.gain_interval[1]
    assert fit.total_delay_interval[0] <= total <= fit.total_delay_interval[1]
    # Rounding moves each of two levels by half a step at most.
    assert np.ptp(fit.gain_interval) / abs(gain) < 2 * step / np.ptp(record.output)
    assert "coarse_quantisation" in codes(fit)


def test_more_samples_at_few_levels_do_not_take_the_rounding_away():
    """Each level of the output has its own error, however long it is held."""

    def levels(rng, n, gain):
        return None, np.repeat(rng.choice([-1.0, 1.0], n // 80), 80)

    record, gain, total = simulated(1, 0.2, 6000, levels)
    fit = cr.fit_output_error(record).fit
    assert fit.gain_interval[0] <= gain <= fit.gain_interval[1]
    assert fit.total_delay_interval[0] <= total <= fit.total_delay_interval[1]
    assert {"coarse_quantisation", "cut"} <= codes(fit)
