"""How late a stem behind lags may have come loose."""

import numpy as np
import pytest
from scipy.optimize import minimize

from ctrl_realize.numerics.engine.problem import KnownFactor, Structure
from ctrl_realize.numerics.engine.window_fit import fit_window
from ctrl_realize.numerics.output_error.interval import latest_slip
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window
from ctrl_realize.numerics.output_error.step_fit import fit_step_record

DEAD, FAST, SLOW = 20.3, 9.0, 45.0
ONE_LAG, TWO_LAGS = Structure(1, 1), Structure(2, 2)


def demand(since):
    return 1 - (SLOW * np.exp(-since / SLOW) - FAST * np.exp(-since / FAST)) / (SLOW - FAST)


def stepped(static, noise, seed):
    """A stem that two lags pull loose, slips by half the way, and follows at that distance."""
    k = np.arange(-200, 500, dtype=float)
    asked = demand(np.clip(k - DEAD, 0, None))
    y = np.where(asked > static, asked - static / 2, 0.0) / (1 - static / 2)
    y = y + noise * np.random.default_rng(seed).standard_normal(k.size)
    since = np.linspace(0, 100, 100001)
    loose = DEAD + float(since[np.argmax(demand(since) > static)])
    return step_data(y, (k >= 0).astype(float), 1.0, [(200, 1)]), loose


def fitted(data, lags=TWO_LAGS):
    scales = step_scales(data, data.output.size, None)
    view = window(data, data.output.size, KnownFactor())
    return fit_window(view, (lags,), scales, (data.sigma, data.quantum), huber=False)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_end_of_the_likelihood_of_two_modes_that_begin_late(seed):
    # second method: samples instead of means over bins, poles by a search without derivatives
    data, loose = stepped(0.06, 0.01, seed)
    whole = fitted(data)
    after, y = np.arange(500.0), data.output[200:] - data.output[:200].mean()

    def cost(rates, begin):
        late = after[after >= begin] - begin
        columns = np.stack([np.ones(late.size), *np.exp(-np.outer(np.exp(rates), late))], axis=1)
        rest = y[after >= begin]
        left = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
        return float(left @ left + y[after < begin] @ y[after < begin])

    rates = np.log([1 / FAST, 1 / SLOW])
    grid = np.arange(20.0, 40.0)
    costs = np.array(
        [minimize(cost, rates, (begin,), method="Nelder-Mead", tol=1e-4).fun for begin in grid]
    )
    inside = grid[costs < costs.min() + 3.84 * 0.01**2]
    end = latest_slip(whole, whole.candidates[TWO_LAGS])
    # between samples nothing but the phase of the modes is told
    assert inside[-1] - 1 <= end <= inside[-1] + 2
    assert end > loose - 1


def test_the_interval_of_a_record_holds_the_moment_at_which_a_stem_comes_loose():
    data, loose = stepped(0.06, 0.008, 3)
    _, fit = fit_step_record(data)
    structures = [one.interval for one in fit.structures if one.interval is not None]
    assert max(high for _, high in structures) < loose < fit.high
    assert fit.low < loose
