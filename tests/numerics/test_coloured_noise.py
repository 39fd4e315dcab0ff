from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ctrl_realize.numerics.signals.noise_model import coloured_criterion, noise_lags


def test_the_lags_of_autoregressive_noise_are_found():
    white = np.random.default_rng(0).standard_normal(4000)
    assert coloured_criterion([white])[1] == 0
    criterion, lags = coloured_criterion([lfilter([1.0], [1, -1.2, 0.5], white)])
    assert lags == 2
    # the likelihood is that of what drives the noise: unit variance, to 4 x sqrt(2 / N)
    n = white.size - noise_lags(white.size)
    assert abs((criterion - 2 * np.log(n)) / n) < 4 * np.sqrt(2 / n)


def test_stretches_of_one_noise_count_together_and_means_do_not():
    white = np.random.default_rng(1).standard_normal(3000)
    noise = lfilter([1.0], [1, -0.9], white)
    parts = [noise[:1000], 5 + noise[1000:]]
    assert coloured_criterion(parts)[1] == 1
    assert abs(coloured_criterion(parts)[0] - coloured_criterion([noise])[0]) < 0.02 * 3000


def test_a_residual_of_nothing_has_a_finite_criterion():
    assert np.isfinite(coloured_criterion([np.zeros(100)])[0])
    assert np.isfinite(coloured_criterion([np.sin(np.arange(400.0))])[0])
