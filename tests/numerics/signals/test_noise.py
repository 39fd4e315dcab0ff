"""Noise at rest: its level, steps, colour and lines; coloured noise made white."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter
from scipy.special import ndtr

from ctrl_realize.numerics.signals.baseline import relaxation
from ctrl_realize.numerics.signals.bins import response_bins
from ctrl_realize.numerics.signals.noise import (
    correlation_of_noise,
    correlation_time,
    hum_frequencies,
    quantisation_step,
    rest_noise,
    rounding_of_level,
    rounding_of_sums,
    winsorised_sigma,
)
from ctrl_realize.numerics.signals.noise_model import (
    continues,
    noise_covariance,
    whitener,
    whitening_filter,
)
from ctrl_realize.numerics.validation.held_output import held_share, longest_hold
from ctrl_realize.numerics.validation.limits import at_limit


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.3])
def test_the_mean_of_rounded_samples_is_off_as_their_probabilities_say(noise):
    levels = (np.arange(400) + 0.5) / 400  # all equally likely, in steps of the converter
    codes = np.arange(-8, 10)
    ends = (codes[:, None] - 0.5 - levels) / noise, (codes[:, None] + 0.5 - levels) / noise
    mean = codes @ (ndtr(ends[1]) - ndtr(ends[0]))
    off = 2.5 * np.sqrt(np.mean((mean - levels) ** 2))
    assert_allclose(rounding_of_level(2.5 * noise, 2.5), off, rtol=2e-3)


def test_the_variance_of_sums_of_rounding_errors_is_that_over_all_positions_of_a_converter():
    rng, quantum = np.random.default_rng(0), 2.5
    apart = 4 + (3 - np.sqrt(3)) / 6  # steps: a zero of Bernoulli's polynomial, no correlation
    plateaus = quantum * np.repeat([0.3, 0.3 + apart], 40)
    ramp = np.linspace(0.01, 0.24, 50) * quantum  # within a step: the errors follow each other
    for values in (plateaus, ramp):
        weights = rng.standard_normal((2, values.size)) + 1
        positions = rng.uniform(0, quantum, (20000, 1))
        errors = quantum * np.round((values + positions) / quantum) - positions - values
        made = rounding_of_sums(values, weights, quantum)
        # 3 % of the variance is beyond the harmonics, 20000 draws scatter by 1 %
        assert_allclose(made, np.var(errors @ weights.T, axis=0), rtol=0.06)


def white(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("step", [1e-12, 1e-3, 1e9])
def test_the_step_is_found_however_small_the_unit(step):
    found = quantisation_step(step * np.round(5 * white(400)))
    # but for rounding; the default absolute tolerance would take 0 for 1e-12
    assert found == pytest.approx(step, rel=1e-9, abs=0)


def test_most_differences_have_to_be_multiples():
    levels = np.arange(40.0)
    assert quantisation_step(levels) == 1
    # eleven more levels off the grid: two gaps of 51 for each of them are no whole numbers
    spoiled = np.concatenate([levels, np.arange(11) + 0.37])
    assert quantisation_step(spoiled) == 0
    # a random signal has one smallest gap, and the others are no multiples of it
    assert quantisation_step(np.round(white(60), 9)) == 0


def test_seven_samples_before_a_step_ask_the_record_and_eight_tell():
    k = np.arange(600.0)
    record = 40 * (1 - np.exp(-np.maximum(k - 20, 0) / 80)) + 0.3 * white(600)
    assert rest_noise(record[:7], record, 0.0)[0] == pytest.approx(0.3, rel=0.15)
    assert rest_noise(record[:7], record, 0.0)[1] == 0
    # a coarse smooth record: the rounding is all
    smooth = 0.5 * np.round(2 * (k / 60))
    assert rest_noise(smooth[:5], smooth, 0.5)[0] < 0.5
    before = np.array([0.0, 9, 0, 9, 0, 9, 0, 9])
    flat = np.r_[before, np.zeros(100)]
    assert rest_noise(before, flat, 0.0)[0] > 4


@pytest.mark.parametrize("seed", range(4))
def test_a_dozen_samples_at_rest_are_helped_by_the_settled_half(seed):
    # hardly any noise before the step by chance, plenty in the record
    record = 5 * (np.arange(800) >= 20) + white(800, seed)
    record[:20] *= 0.1
    assert rest_noise(record[:20], record, 0.0)[0] == pytest.approx(1, rel=0.15)
    # with fifty samples they are believed
    record[:50] *= 0.1
    assert rest_noise(record[:50], record, 0.0)[0] < 0.3


def test_slow_noise_makes_no_drift():
    # 19 samples count as one: by the error in white noise a quarter of these would drift
    for seed in range(20):
        slow = lfilter([1.0], [1.0, -0.9], white(600, seed))[200:]
        assert rest_noise(slow, np.tile(slow, 3), 0.0)[1] == 0.0


def test_wild_samples_make_no_drift_and_hide_none():
    values = white(300)
    slope = 0.05
    for wild in ([0], [0, 5, 299]):
        spoilt = values.copy()
        spoilt[wild] += 80
        assert rest_noise(spoilt, np.tile(spoilt, 3), 0.0)[1] == 0
        drift = rest_noise(spoilt + slope * np.arange(300), np.tile(spoilt, 3), 0.0)[1]
        # one standard error of the slope is sqrt(12 / 300^3) = 7e-4
        assert drift == pytest.approx(slope, abs=3e-3)


def test_lines_are_found_strongest_first_and_not_more_than_asked_for():
    index = np.arange(4000)
    frequencies = [0.0513, 0.1207, 0.2004, 0.3101]
    signal = 0.1 * white(4000)
    for i, f in enumerate(frequencies):
        signal += 3.0 ** (4 - i) * np.cos(2 * np.pi * f * index + i)
    found = hum_frequencies(signal + 50)
    # resolution 1 / n, improved to a small part of it
    assert_allclose(found, frequencies[:3], atol=0.02 / 4000)
    assert_allclose(hum_frequencies(signal, most=1), frequencies[:1], atol=0.02 / 4000)
    assert not any(hum_frequencies(white(1000, seed)) for seed in range(20))


@pytest.mark.parametrize("pole", [0.8, 0.9, 0.97])
def test_swings_of_slow_noise_are_no_sinusoid(pole):
    for seed in range(20):
        slow = lfilter([1.0], [1.0, -pole], white(500, seed))[200:]
        assert not hum_frequencies(slow)
        # and one in the middle of its spectrum, as strong as the noise, is found
        line = np.sqrt(2) * np.std(slow) * np.sin(2 * np.pi * 0.11 * np.arange(slow.size))
        assert_allclose(hum_frequencies(slow + line), [0.11], atol=1e-3)


RADIUS, ANGLE = 0.95, 2 * np.pi / 20
RINGING = np.array([1.0, -2 * RADIUS * np.cos(ANGLE), RADIUS**2])


def ringing(size, seed=0):
    white = np.random.default_rng(seed).standard_normal(size + 500)
    return lfilter([1.0], RINGING, white)[500:]


def exact_covariance(lags):
    """Autocovariance of the ringing noise over its variance, by Yule and Walker."""
    rho = [1.0, -RINGING[1] / (1 + RINGING[2])]
    while len(rho) < lags:
        rho.append(-RINGING[1] * rho[-1] - RINGING[2] * rho[-2])
    return np.array(rho[:lags])


def test_the_covariance_of_ringing_noise_is_found():
    found = noise_covariance(ringing(40_000), 40_000, None)
    # 1/sqrt(40 000) times the square root of what a sample counts for, with room: 0.02
    assert found[:100] == pytest.approx(exact_covariance(100), abs=0.02)
    # it goes on until it has died away, and no longer
    assert abs(found[-1]) < 1e-4
    assert found.size < 1000


def test_means_over_bins_become_white_exactly():
    covariance = exact_covariance(500)
    bins = response_bins(1600, [600], 640)
    means = np.zeros((bins.first.size, 1600))
    for row, first, width in zip(means, bins.first, bins.width, strict=True):
        row[first : first + width] = 1 / width
    whole = np.zeros(1600)
    whole[:500] = covariance
    among = means @ toeplitz(whole) @ means.T
    white = whitener(bins, covariance)
    # the ridge is 1e-9 of the variance of a sample, the smallest eigenvalue of `among` 2e-4
    assert white @ among @ white.T == pytest.approx(np.eye(len(among)), abs=1e-4)
    assert np.all(np.triu(white, 1) == 0)


def test_clipped_noise_is_as_large_as_gaussian_noise_is():
    # 200 000 samples tell a standard deviation to 0.16 %
    values = 3.0 * np.random.default_rng(0).standard_normal(200_000)
    assert winsorised_sigma(values, 0.0) == pytest.approx(3.0, rel=0.01)
    spoilt = np.where(np.arange(values.size) % 100 == 0, 1e3, values)
    assert winsorised_sigma(spoilt, 0.0) == pytest.approx(3.0, rel=0.03)


@pytest.mark.parametrize("count", [0, 1, 7])
def test_too_few_samples_count_as_independent(count):
    assert correlation_time(np.arange(float(count))) == 1.0


@pytest.mark.parametrize("pole", [0.4, 0.7, 0.95])
def test_the_correlation_time_of_a_lag(pole):
    found = correlation_time(5 + lfilter([1], [1, -pole], white(60_000)))
    # summed over some ten times its length: known to sqrt(20 time / 60 000), 12 % for the slowest
    assert found == pytest.approx((1 + pole) / (1 - pole), rel=0.2)


def test_slow_noise_is_told_from_what_a_model_leaves_of_it():
    n, parameters, pole = 525, 6, 0.9
    slow = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(parameters)) / n)
    slow = np.linalg.qr(slow)[0]
    residuals, variances = [], []
    for seed in range(200):
        noise = lfilter(
            [np.sqrt(1 - pole**2)], [1, -pole], np.random.default_rng(seed).normal(size=n)
        )
        residual = noise - slow @ (slow.T @ noise)
        correlation, lost = correlation_of_noise(correlation_time(residual), parameters / n)
        residuals.append((correlation_time(residual), correlation))
        variances.append(residual @ residual / n / (1 - lost))
    before, after = np.median(residuals, axis=0)
    true = (1 + pole) / (1 - pole)
    assert before < 0.7 * true
    # a median of 200 that scatter by a third is known to 3 %; the sum ends at a pair of lags
    assert after == pytest.approx(true, rel=0.15)
    # of each known to 19 %; the median, since what scatters stands in the denominator
    assert np.median(variances) == pytest.approx(1.0, rel=0.05)


def slow(n, seed, pole=0.9):
    """AR(1) noise of unit variance."""
    return lfilter([np.sqrt(1 - pole**2)], [1, -pole], white(n + 200, seed))[200:]


def restricted(columns, left, pole):
    """Restricted likelihood of AR(1) noise from its whole covariance, -2 log (Harville 1977)."""
    inverse = np.linalg.inv(toeplitz(pole ** np.arange(left.size)) / (1 - pole**2))
    inside = columns.T @ inverse @ columns
    rest = left - columns @ np.linalg.solve(inside, columns.T @ inverse @ left)
    freedom = left.size - columns.shape[1]
    sizes = np.linalg.slogdet(inside)[1] - np.linalg.slogdet(inverse)[1]
    return freedom * np.log(rest @ inverse @ rest) + sizes


def lags_and_a_step(n):
    """What a model of two lags has: level, drift, two free responses, and a step."""
    k = np.arange(n)
    return np.stack([k**0, k / n, np.exp(-k / 20), np.exp(-k / 6), k > 90], axis=1).astype(float)


@pytest.mark.parametrize(
    "columns", [np.polynomial.legendre.legvander(np.linspace(-1, 1, 250), 5), lags_and_a_step(250)]
)
def test_the_pole_of_noise_is_found_in_what_a_model_leaves_of_it(columns):
    project = columns @ np.linalg.pinv(columns)
    plain, found = [], []
    for seed in range(40):
        left = (noise := slow(250, seed)) - project @ noise
        plain.append(left[1:] @ left[:-1] / (left @ left))
        found.append(-whitening_filter(left, 1, np.inf, columns)[1])
    # one is off by sqrt(1 - rho^2) / sqrt(n) = 0.03 at least, the mean of 40 by a sixth of that
    assert np.mean(found) == pytest.approx(0.9, abs=0.02)
    assert np.mean(plain) < 0.86


def test_it_is_that_of_the_restricted_likelihood_of_the_whole_covariance():
    columns = lags_and_a_step(250)
    project = columns @ np.linalg.pinv(columns)
    for seed in range(5):
        left = (noise := slow(250, seed)) - project @ noise
        found = -whitening_filter(left, 1, np.inf, columns)[1]
        bounds = {"bounds": (0.5, 0.999), "method": "bounded"}
        best = minimize_scalar(lambda pole, left=left: restricted(columns, left, pole), **bounds)
        # Burg leaves one error of prediction at each end out: two of 250 samples
        assert found == pytest.approx(best.x, abs=0.01)


def test_noise_of_a_short_rest_goes_on_and_a_misfit_is_none():
    k = np.arange(250)
    misfit = 0.03 * np.exp(-k / 40) * np.sin(2 * np.pi * k / 90)
    went_on = [
        continues(noise[:60], noise[60:], 1.3) for noise in (slow(310, i) for i in range(40))
    ]
    assert np.mean(went_on) >= 0.85  # two tests that 95 % pass
    for seed in range(10):
        noise = 0.004 * white(310, seed)
        assert not continues(noise[:60], noise[60:] + misfit, 1.3)
    assert not continues(np.zeros(60), misfit, 1.3)
    assert not continues(misfit[:0], misfit, 1.3)
    assert not continues(slow(15, 0), slow(250, 1), 1.3)


def test_white_noise_loses_nothing_but_degrees_of_freedom():
    assert correlation_of_noise(1.0, 0.1) == (1.0, 0.0)


@pytest.mark.parametrize("level", [24.7, 20.9, 1.0])
def test_a_rest_on_one_level_of_a_quantiser_does_not_bend(level):
    # what an exponential gains there is rounding
    output = np.full(300, level)
    output[60:] += 6
    assert relaxation(output, 60) is None


def with_last_digits(values):
    sign = np.random.default_rng(0).choice([-1.0, 1.0], values.size)
    return values * (1 + sign * np.finfo(float).eps)


def test_what_repeats_a_sample_does_so_but_for_its_last_digit():
    k = np.arange(400)
    fitted = 1 - np.exp(-k / 100)  # not a ramp: held, that has the equal steps of a converter
    held = 5 + fitted[k // 10 * 10]
    again = with_last_digits(held)
    assert held_share(again, fitted) == held_share(held, fitted) == pytest.approx(0.9, abs=0.01)
    assert longest_hold(again, fitted) == longest_hold(held, fitted) == 9


def test_samples_at_a_limit_are_there_but_for_their_last_digit():
    output = np.minimum(20 + np.random.default_rng(1).standard_normal(400), 21.0)
    for values in (output, with_last_digits(output)):
        ((limit, samples),) = at_limit(values)
        assert limit == pytest.approx(21.0)
        assert np.all(samples[output == 21.0])
