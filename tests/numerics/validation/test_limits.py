"""Which samples of an output are at its limit, behind its noise or before it."""

import numpy as np
import pytest

from ctrl_realize.numerics.constants import VERY_STRONG
from ctrl_realize.numerics.validation.limits import at_limit, clips, plateaus

TIME = np.arange(300)
AFTER = np.maximum(TIME - 100, 0) / 30
RISE = 1 - np.exp(-AFTER) * (1 + AFTER)
NOISE = 0.01 * np.random.default_rng(0).standard_normal(300)


@pytest.mark.parametrize("step", [0, 0.005])
@pytest.mark.parametrize("sign", [1, -1])
def test_noise_that_is_cut_off_is_found_at_the_limit(sign, step):
    noisy = RISE + NOISE
    cut = sign * np.minimum(np.round(noisy / step) * step if step else noisy, 0.6)
    ((limit, samples),) = at_limit(cut)
    assert limit == sign * 0.6
    assert np.all(samples[np.abs(cut - limit) < 1e-12])
    assert not samples[RISE < 0.55].any()


def test_a_converter_with_two_ends_is_found_at_both():
    wave = np.sin(TIME / 9) + NOISE
    limits = at_limit(np.clip(wave, -0.7, 0.8))
    assert sorted(limit for limit, _ in limits) == [-0.7, 0.8]
    for limit, samples in limits:
        # ten samples between two at the limit count as well
        assert np.mean(samples == (wave * np.sign(limit) >= abs(limit))) > 0.95


@pytest.mark.parametrize("step", [0, 0.005, 0.02, 0.1])
@pytest.mark.parametrize("noise", [0, 0.1, 1])
def test_rest_and_quantisation_are_no_limit(step, noise):
    output = RISE + noise * NOISE
    assert not at_limit(np.round(output / step) * step if step else output)


def test_a_code_for_missing_samples_is_no_limit():
    output = RISE + NOISE
    output[::20] = -9999.0
    assert not at_limit(output)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("noise", [0, 0.1, 1])
def test_a_plateau_is_found_where_the_response_ends_with_a_kink(noise, sign):
    found, evidence = plateaus(sign * (np.minimum(RISE, 0.6) + noise * NOISE), [90])
    assert evidence > VERY_STRONG
    # some samples at the kink are left out as well
    assert np.all(found[RISE > 0.63])
    assert not found[RISE < 0.5].any()


def test_a_step_without_a_response_at_the_highest_level_is_a_plateau():
    settled = 1 - np.exp(-2 * AFTER)
    output = np.minimum(settled, 0.99) + NOISE  # no kink that noise would show
    assert not plateaus(output, [90])[0].any()
    found, evidence = plateaus(output, [90, 220])
    assert evidence == np.inf
    assert found[220:].all()
    assert not found[settled < 0.9].any()


@pytest.mark.parametrize("noise", [0, 0.1, 1])
def test_a_response_that_settles_has_no_such_plateau(noise):
    assert not plateaus(RISE + noise * NOISE, [90])[0].any()
    assert not plateaus(-np.expm1(-AFTER) + noise * NOISE, [90])[0].any()


def test_an_output_clips_if_a_limit_explains_it_and_a_model_passes_that():
    held = RISE >= 0.8
    limited = np.minimum(RISE, 0.8) + NOISE
    poor = np.where(held, 0.8, RISE + 0.02)
    assert clips(limited, poor, RISE, held, loaded=False)
    same = np.minimum(RISE, 0.8)  # as good without a limit
    assert not clips(limited, same, RISE, held, loaded=False)
    assert not clips(limited, poor, np.minimum(RISE, 0.805), held, loaded=False)  # hardly passed
    # a load that does the same has two parameters more
    assert clips(limited, same, RISE, held, loaded=True)
