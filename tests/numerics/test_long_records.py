"""What is done to every sample of a long record costs one pass, and finds the same."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics import noise_level
from ctrl_realize.numerics.first_motion import _lasting_excursion
from ctrl_realize.numerics.noise_level import hum_frequencies


def excursion_by_excursion(moved, threshold, smoothing):
    """The definition: the first sample beyond from which on most samples stay on one side."""
    for k in np.flatnonzero(np.abs(moved) > threshold):
        lasting = max(3 * smoothing, int(np.ceil(0.25 * k)))
        stretch = moved[k : k + lasting]
        outside = np.mean(np.abs(stretch) > 0.6 * threshold) > 0.8
        if outside and abs(np.mean(np.sign(stretch))) > 0.7:
            return int(k)
    return None


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("smoothing", [1, 8])
def test_the_first_lasting_excursion_is_found_among_many_short_ones(seed, smoothing):
    rng = np.random.default_rng(seed)
    # a slow rise in noise: the threshold is passed many times before it is for good
    moved = np.linspace(0, 6, 3000) + 1.5 * rng.standard_normal(3000)
    moved *= rng.choice([-1.0, 1.0])
    found = _lasting_excursion(moved, 4.0, smoothing)
    assert found == excursion_by_excursion(moved, 4.0, smoothing)
    assert found is not None
    assert np.count_nonzero(np.abs(moved[:found]) > 4.0) > 5


@pytest.mark.parametrize("seed", range(4))
def test_noise_and_a_rest_have_no_lasting_excursion(seed):
    noise = np.random.default_rng(seed).standard_normal(2000)
    assert _lasting_excursion(noise, 2.0, 1) == excursion_by_excursion(noise, 2.0, 1)
    assert _lasting_excursion(np.zeros(50), 1.0, 1) is None


def test_an_excursion_at_the_very_end_is_judged_by_the_samples_there_are():
    moved = np.zeros(400)
    moved[395:] = 3.0
    assert _lasting_excursion(moved, 1.0, 1) == 395


@pytest.mark.parametrize("size", [4095, 4096, 4097, 20_000])
@pytest.mark.parametrize("frequency", [0.0213, 0.31])
def test_a_line_is_found_to_its_bound_however_many_samples_there_are(size, frequency):
    rng = np.random.default_rng(size)
    rest = np.sin(2 * np.pi * frequency * np.arange(size) + 0.4) + 0.1 * rng.standard_normal(size)
    (found,) = hum_frequencies(rest)
    # Cramer-Rao: sqrt(6) sigma / (pi A N^1.5), and the last of fourteen halvings
    bound = np.sqrt(6) * 0.1 / (np.pi * size**1.5)
    assert abs(found - frequency) < 4 * bound + 2.0**-14 / size


def test_a_line_that_is_far_too_weak_is_given_up_before_its_frequency_is_refined(monkeypatch):
    rng = np.random.default_rng(0)
    weak = 0.1 * np.sin(0.4 * np.arange(30_000)) + rng.standard_normal(30_000)
    monkeypatch.setattr(noise_level, "_refine", lambda values, frequency: pytest.fail("refined"))
    # it stands far above its neighbours in the spectrum, and carries half a percent
    assert hum_frequencies(weak) == []
