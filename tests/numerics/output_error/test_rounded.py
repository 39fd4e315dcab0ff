"""Likelihood of rounded samples."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.stats import norm

import ctrl_realize as cr
from ctrl_realize.numerics.engine.problem import KnownFactor, Structure
from ctrl_realize.numerics.engine.structures import Candidate
from ctrl_realize.numerics.engine.window_fit import fit_window
from ctrl_realize.numerics.output_error.rounded import fit_rounded, log_probability, scores
from ctrl_realize.numerics.output_error.step_data import step_data, step_scales, window

STEP = 0.02
EDGE, COUNT = 150, 600


def response(dead_time, slow, fast):
    late = np.clip(np.arange(COUNT) - EDGE - dead_time, 0, None)
    return 1 - (slow * np.exp(-late / slow) - fast * np.exp(-late / fast)) / (slow - fast)


def rounded(seed, dead_time, noise):
    rng = np.random.default_rng(seed)
    y = response(dead_time, 20.0, 8.0) + rng.uniform(-0.5, 0.5) * STEP
    return np.round((y + noise * rng.standard_normal(COUNT)) / STEP) * STEP


@pytest.mark.parametrize("noise", [0.05, 0.3, 2.0])
def test_probabilities_of_all_levels_are_one_and_scores_are_their_slopes(noise):
    levels = np.arange(-20, 21) + 0.13
    assert_allclose(np.exp(log_probability(levels, 1.0, noise)).sum(), 1.0, rtol=1e-12)
    error = np.array([-1.4, -0.52, 0.0, 0.3, 0.49, 2.0]) * max(noise, 0.5)
    width = norm.cdf((error + 0.5) / noise) - norm.cdf((error - 0.5) / noise)
    seen = width > 1e-9  # beyond, the difference of the two has no digits
    probability = np.exp(log_probability(error, 1.0, noise))
    assert_allclose(probability[seen], width[seen], rtol=1e-6)
    h = 1e-6
    apart = log_probability(error - h, 1.0, noise) - log_probability(error + h, 1.0, noise)
    score, _ = scores(error, 1.0, noise)
    assert_allclose(score, apart / (2 * h), rtol=1e-5, atol=1e-6)


def test_information_of_fine_rounding_is_that_of_the_noise_with_the_rounding():
    # Sheppard's correction: variance plus a twelfth of the squared step, up to fourth order.
    _, information = scores(np.array([0.2, -0.4]), 1.0, 3.0)
    assert_allclose(information, 1 / (9.0 + 1 / 12), rtol=1e-3)


def test_the_maximum_is_that_of_a_search_over_all_parameters():
    y = rounded(1, 5.4, 0.1 * STEP)
    data = step_data(y, (np.arange(COUNT) >= EDGE).astype(float), 1.0, [(EDGE, EDGE)])
    scales = step_scales(data, COUNT, None)
    structure = Structure(2, 2)
    whole = fit_window(
        window(data, COUNT, KnownFactor()), [structure], scales, (data.sigma, data.quantum), True
    )
    found = fit_rounded(whole, whole.candidates[structure], STEP)

    def cost(x):
        model = x[3] * response(x[0], *np.exp(x[1:3])) + x[4]
        return -np.sum(log_probability(y - model, STEP, np.exp(x[5])))

    start = [5.0, 3.0, 2.0, 1.0, float(y[0]), np.log(0.1 * STEP)]
    options = {"maxiter": 6000, "maxfev": 6000, "xatol": 1e-6, "fatol": 1e-8, "adaptive": True}
    best = minimize(cost, start, method="Nelder-Mead", options=options)
    own = -np.sum(log_probability(y - found.model, STEP, found.noise))
    # within the gain at which scoring ends
    assert own - best.fun < 2e-3
    assert found.candidate.dead_time == pytest.approx(best.x[0], abs=0.02)
    assert found.noise == pytest.approx(np.exp(best.x[5]), rel=0.02)
    assert isinstance(found.candidate, Candidate)


def test_the_dead_time_of_a_coarse_converter_is_known_to_a_third_of_a_sample():
    # For least squares, to which rounding is noise, it is 0.5 samples off, root mean square.
    errors = []
    for seed in range(4):
        truth = 5.1 + 0.2 * seed
        u = (np.arange(COUNT) >= EDGE).astype(float)
        record = cr.Record(np.arange(COUNT, dtype=float), u, rounded(seed, truth, 0.1 * STEP))
        fit = cr.fit_output_error(record, structures=[(2, 2)]).fit
        assert any("rounded samples" in choice for choice in fit.choices)
        assert fit.interval[0] <= truth <= fit.interval[1]
        assert fit.estimate.residual.rounded == pytest.approx(0.1 * STEP, rel=0.3)
        errors.append(fit.dead_time - truth)
    assert np.sqrt(np.mean(np.square(errors))) < 0.3


@pytest.mark.parametrize(
    ("noise", "form", "seeds"), [(0.0, "FOPDT", [8]), (0.1, "SOPDT", [1, 2, 4, 8])]
)
def test_the_interval_of_a_gain_has_the_rounding_of_both_levels(noise, form, seeds):
    """Ten steps of the converter (0.2) in the response; without that none of these held."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        gain, dead_time = 2.0 + 0.3 * rng.random(), 10 + 5 * rng.random()
        lags = [30.0] if form == "FOPDT" else [30.0, 10.0]
        plant = ct.tf([gain], np.poly(-1 / np.array(lags)) * np.prod(lags))
        time = np.arange(400.0)
        u = 1.0 * (time >= 60)
        y = np.ravel(cr.delayed_ss(plant, dead_time=dead_time, dt=1.0).simulate(u))
        y = 0.2 * np.round(y / 0.2 + rng.random() + noise * rng.standard_normal(400))
        low, high = cr.identify(cr.Record(time, u, y), structures=form).fit.gain_interval
        assert low <= gain <= high
        assert high - low < 2.2 * 0.2  # that of two levels alone has 2 x 1.96 / sqrt(6) steps
