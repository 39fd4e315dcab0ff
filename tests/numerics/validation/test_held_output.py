"""Outputs that repeat themselves while a plant moves."""

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrl_realize.numerics.validation.held_output import (
    held_share,
    hold_in_noise,
    longest_hold,
    straight_lines,
    stuck_samples,
    updates,
)

TIME = np.arange(300)
RISE = np.where(TIME > 100, -np.expm1(-(TIME - 100) / 40), 0.0)


@pytest.mark.parametrize("period", [2, 5, 12])
def test_an_output_held_for_a_period_repeats_all_samples_but_one(period):
    held = RISE[TIME - TIME % period]
    assert held_share(held, RISE) == pytest.approx((period - 1) / period, abs=0.05)
    assert longest_hold(held, RISE) == period - 1


def test_rest_is_no_holding():
    assert held_share(RISE, RISE) == 0
    assert held_share(np.zeros(300), np.zeros(300)) == 0


@pytest.mark.parametrize("digits", [8, 2])
def test_a_coarse_converter_repeats_values_that_are_not_held(digits):
    # 20 steps over the rise, as the tacho of a small motor has them, written with a few digits
    noisy = RISE + 0.01 * np.random.default_rng(0).standard_normal(300)
    converted = np.round(0.0445 * np.round(noisy / 0.0445), digits)
    assert np.mean(np.diff(converted)[100:160] == 0) > 0.3
    assert held_share(converted, RISE) < 0.1
    assert longest_hold(converted, RISE) < 5


def test_a_coarse_converter_that_is_held_too_still_shows_it():
    held = np.round(RISE[TIME - TIME % 12] / 0.0445) * 0.0445
    assert held_share(held, RISE) > 0.6
    assert longest_hold(held, RISE) >= 11


@pytest.mark.parametrize(("first", "last"), [(10, 60), (110, 140), (200, 299)])
def test_a_value_that_stands_in_a_noisy_output_is_found(first, last):
    output = RISE + 0.01 * np.random.default_rng(1).standard_normal(300)
    output[first : last + 1] = output[first]
    assert stuck_samples(output, RISE) == (first, last)


@pytest.mark.parametrize("step", [0, 0.002, 0.02, 0.1])
@pytest.mark.parametrize("noise", [0, 0.001, 0.01])
def test_rest_and_quantisation_are_not_taken_for_a_stuck_sensor(step, noise):
    for before in (100, 0):
        output = RISE + noise * np.random.default_rng(2).standard_normal(300)
        output = (np.round(output / step) * step if step else output)[100 - before :]
        first, last = stuck_samples(output, RISE[100 - before :])
        assert first == last


STEP = np.where(TIME >= 100, 1.0, 0.0)[None]


@pytest.mark.parametrize(("period", "first"), [(2, 1), (5, 0), (12, 7)])
def test_updates_of_a_held_output_are_found_though_some_samples_are_missing(period, first):
    rng = np.random.default_rng(3)
    noisy = np.append(RISE, RISE[-1] * np.ones(300)) + 0.01 * rng.standard_normal(600)
    at, step = np.arange(600), np.append(STEP, np.ones((1, 300)), axis=1)
    new = (at - first) % period == 0
    held = noisy[np.clip(at - (at - first) % period, 0, None)]
    assert np.array_equal(updates(held, step), new)
    held[30:70] = np.nan
    assert np.array_equal(updates(held, step), new)


def test_updates_at_about_equal_distances_and_those_of_a_dead_band_are_found():
    rng = np.random.default_rng(4)
    noisy = RISE + 0.01 * rng.standard_normal(300)
    new = np.zeros(300, dtype=bool)
    new[[0, *np.cumsum(rng.integers(4, 9, 48)), 299]] = True
    held = noisy[np.maximum.accumulate(np.where(new, TIME, 0))]
    assert np.array_equal(updates(held, STEP), new)
    stored, last = [0], noisy[0]
    for k in TIME:
        if abs(noisy[k] - last) > 0.05:
            stored, last = [*stored, k], noisy[k]
    new = np.isin(TIME, [*stored, 299])
    held = noisy[np.maximum.accumulate(np.where(np.isin(TIME, stored), TIME, 0))]
    assert np.array_equal(updates(held, STEP), new)


@pytest.mark.parametrize("digits", [16, 6, 3])
@pytest.mark.parametrize(("period", "first"), [(2, 1), (6, 0), (10, 7)])
def test_updates_of_an_interpolated_output_are_found_behind_the_digits_of_a_file(
    period, first, digits
):
    # with 3 or 6 digits none was found: 7 of 21 good dead times were wrong
    noisy = RISE + 0.03 * np.random.default_rng(6).standard_normal(300)
    new = (TIME - first) % period == 0
    between = np.interp(TIME, TIME[new], noisy[new])
    assert np.array_equal(updates(np.round(between, digits), STEP), new)


def test_kinks_of_a_response_to_an_input_that_moves_at_even_times_are_no_updates():
    levels = np.repeat(np.random.default_rng(7).uniform(-1, 1, 30), 10)
    for signs in (levels, np.sign(levels)):
        response = lfilter([0.1], [1, -0.9], np.append(np.zeros(3), signs[:-3]))
        assert updates(np.round(response, 6), signs[None]).all()


def test_noise_steps_of_a_converter_an_even_ramp_and_a_gain_are_no_updates():
    rng = np.random.default_rng(0)
    noisy = RISE + 0.01 * rng.standard_normal(300)
    ramp = np.floor(TIME / 4) - np.floor(np.clip(TIME - 150, 0, None) / 2)
    coarse = np.round(noisy / 0.05) * 0.05
    tacho = np.round(0.0445 * np.round(noisy / 0.0445), 2)
    late = np.append(np.zeros(400), rng.uniform(0.1, 1, 100) * np.tile([1, -1], 50))
    assert updates(late, np.append(STEP, np.ones((1, 200)), axis=1)).all()
    for output in (noisy, coarse, tacho, RISE, ramp, np.zeros(300)):
        assert updates(output, STEP).all()
    levels = np.repeat(rng.uniform(-1, 1, 30), 10)
    gain = 2 * np.append(np.zeros(12), levels[:-12])
    assert updates(gain, levels[None]).all()
    assert updates(np.clip(gain, -1.5, 1.5), levels[None]).all()


def test_held_output_beside_a_curve_that_it_follows_is_no_gain():
    curve, new = (TIME / 100.0) ** 2, TIME % 10 == 0
    held = curve[np.maximum.accumulate(np.where(new, TIME, 0))]
    assert np.array_equal(updates(held, curve[None]), new)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("digits", [None, 4])
def test_corners_of_straight_lines_are_found_in_any_unit(digits, scale):
    corners = np.array([0, 108, 121, 140, 166, 205, 299])  # as of a historian, 1 % off at most
    lines = np.interp(TIME, corners, RISE[corners])
    output = scale * (lines if digits is None else np.round(lines, digits))
    assert np.array_equal(straight_lines(output, STEP[0]), corners)


def test_noise_curves_and_what_follows_its_input_are_no_straight_lines():
    rng = np.random.default_rng(5)
    binary = np.repeat(rng.choice([-1.0, 1.0], 30), 10)
    ramps, steps = np.cumsum(binary), np.diff(binary, prepend=0.0).cumsum()
    smooth = lfilter([0.05], [1, -0.95], rng.standard_normal(300))
    coarse = np.round(RISE / 0.03) * 0.03
    for output in (RISE + 0.01 * smooth, RISE, np.round(RISE, 3), coarse, np.zeros(300)):
        assert not straight_lines(output, STEP[0]).size
    assert not straight_lines(ramps, steps).size


@pytest.mark.parametrize(("period", "first"), [(2, 1), (5, 0), (12, 7), (30, 11)])
def test_holds_beneath_noise_are_found_with_their_first_update(period, first):
    noise = 0.003 * np.random.default_rng(period).standard_normal(300)
    held = RISE[np.maximum((TIME - first) // period * period + first, 0)] + noise
    late = np.interp(TIME - period / 2, TIME, RISE)  # as a model without holds has it
    spiked = np.where(TIME % 50 == 49, np.nan, held)
    for output in (held, spiked):
        at_period, at, variance = hold_in_noise(output, late)
        assert (at_period, at) == (period, first)
        assert variance == pytest.approx(0.003**2, rel=0.3)  # a few of 290 degrees of freedom


@pytest.mark.parametrize("seed", range(10))
def test_an_output_that_follows_its_model_has_no_holds(seed):
    noise = 0.03 * np.random.default_rng(seed).standard_normal(300)
    assert hold_in_noise(RISE + noise, RISE) is None
    assert hold_in_noise(noise, RISE * 0) is None
    assert hold_in_noise(0.9 * RISE + noise, RISE) is None
