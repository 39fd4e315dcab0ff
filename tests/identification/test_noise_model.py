"""Model of the noise that a fit leaves. Simulated."""

import numpy as np
import pytest
from scipy.signal import lfilter

import ctrl_realize as cr


@pytest.fixture(scope="module")
def fit():
    """One lag and dead time in AR(2) noise, driven by a step."""
    k = np.arange(3000)
    noise = lfilter([0.02], [1, -1.2, 0.5], np.random.default_rng(4).standard_normal(k.size))
    step = -2 * np.expm1(-np.clip(k - 1007.3, 0, None) / 30)
    return cr.fit_output_error(cr.Record(0.5 * k, 1.0 * (k >= 1000), step + noise)).fit


def test_the_autoregression_of_the_noise_is_found(fit):
    noise = fit.noise_model
    # one coefficient of 3000 samples has a standard error of 0.016
    assert noise.coefficients == pytest.approx([1.2, -0.5], abs=0.06)
    assert noise.std == pytest.approx(0.02, rel=0.05)
    assert noise.dt == 0.5
    # (1 - 1.2 + 0.5)^-2 over the variance (1 + 0.5) / (0.5 (2.25 - 1.44)), Box and Jenkins (3.2.28)
    exact = 1 / 0.3**2 / (1.5 / (0.5 * (1.5**2 - 1.2**2)))
    assert noise.correlation_time == pytest.approx(exact, rel=0.3)


def test_the_prediction_leaves_the_innovations(fit):
    left = fit.measured - fit.fitted
    innovations = left - fit.noise_model.predict(left)
    assert np.std(innovations) == pytest.approx(0.02, rel=0.05)
    e = innovations - innovations.mean()
    assert abs(e[1:] @ e[:-1]) / (e @ e) < 3 / np.sqrt(e.size)
    whole = fit.noise_model.system
    assert whole.zeros() == pytest.approx([0, 0])
    assert np.sort_complex(whole.poles()) == pytest.approx(
        np.sort_complex(np.roots([1, *-fit.noise_model.coefficients]))
    )


def test_drawn_noise_is_like_what_was_left(fit):
    drawn = fit.noise_model.draw(20_000, rng=1)
    expected = 0.02 * np.sqrt(1.5 / (0.5 * (1.5**2 - 1.2**2)))
    assert np.std(drawn) == pytest.approx(expected, rel=0.1)
    assert np.array_equal(drawn, fit.noise_model.draw(20_000, rng=1))
    with pytest.raises(cr.errors.OptionError, match="n"):
        fit.noise_model.draw(0)


def test_white_noise_has_no_coefficients():
    k = np.arange(400)
    y = 1.0 * (k >= 105) + 0.01 * np.random.default_rng(0).standard_normal(k.size)
    noise = cr.fit_output_error(cr.Record(1.0 * k, 1.0 * (k >= 100), y)).fit.noise_model
    assert noise.coefficients.size == 0
    assert noise.correlation_time == 1
    assert noise.system.dcgain() == 1
    assert "white" in noise.report()


def test_what_a_fit_followed_of_slow_noise_is_made_up_for():
    # The pole of what is left of 240 samples is 0.845, that of the noise itself 0.89.
    poles = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 40), 6)
        held = np.concatenate([np.zeros(6), u[:-6]])
        y = lfilter([2 * -np.expm1(-0.05)], [1, -np.exp(-0.05)], held)
        noise = lfilter([0.02], [1, -0.9], rng.standard_normal(u.size + 200))[200:]
        record = cr.Record(0.5 * np.arange(u.size), u, y + noise)
        fit = cr.identify(record, structures="P1D").fit
        poles.append(fit.noise_model.coefficients.sum())
    # bias of an autoregression about a mean: (1 + 3 0.9) / 240 = 0.016 (Kendall 1954); standard
    # error of the mean of ten: sqrt((1 - 0.81) / 240 / 10) = 0.009
    assert np.mean(poles) == pytest.approx(0.9, abs=0.016 + 2.6 * 0.009)


def test_a_plant_is_disturbed_by_the_noise_of_a_fit(fit):
    plant = cr.bench.tank(dt=0.5, resolution=None)
    noisy = plant.disturbed_by(fit.noise_model)
    held = np.full(20_000, plant.steady_state[0])
    drawn = noisy.record(held, rng=1).output.ravel()
    assert np.std(drawn) == pytest.approx(fit.noise_model.sigma, rel=0.1)
    innovations = lfilter([1.0, *-fit.noise_model.coefficients], [1.0], drawn - drawn.mean())
    assert np.std(innovations) == pytest.approx(fit.noise_model.std, rel=0.02)
    assert cr.bench.relay_test(noisy, rng=1).n_samples > 100
    with pytest.raises(cr.errors.OptionError, match=r"sample time of 0.5 s, the plant 1 s"):
        cr.bench.tank().disturbed_by(fit.noise_model)


def test_the_correlation_time_of_very_slow_noise_takes_no_memory():
    noise = cr.identification.NoiseModel(np.array([0.9999]), 0.1, 1.0)
    assert noise.correlation_time == pytest.approx((1 + 0.9999) / (1 - 0.9999), rel=1e-6)  # AR(1)
