"""Means of responses over blocks of samples, without the response at every sample."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.engine.responses import SampledInput
from ctrl_realize.numerics.output_error.any_input.averaged_input import AveragedInput

DT = 0.3
SIGNAL = np.random.default_rng(0).choice([-1.0, 1.0], 2003)
DELAYS = DT * np.array([0.0, 7.0, 33.4, 1500.2])


@pytest.mark.parametrize(
    ("every", "width", "blocks", "off"),
    # up to 16 samples exact; longer blocks for time constants of so many of them
    [(1, 1, 0.1, 1e-12), (5, 5, 0.1, 1e-12), (7, 1, 3.0, 1e-12), (40, 40, 1.0, 1e-11),
     (40, 13, 0.5, 1e-8), (40, 1, 0.25, 1e-4)],
)  # fmt: skip
def test_means_are_those_of_the_response_at_every_sample(every, width, blocks, off):
    lag = blocks * every * DT
    poles = np.tile(np.array([-1, -1 + 1j, -1 - 1j]) / lag, (DELAYS.size, 1))
    count = SIGNAL.size // every
    found = AveragedInput(SIGNAL, DT, every, width).modes(DELAYS, poles)
    each = SampledInput(SIGNAL, DT).modes(DELAYS, poles)
    for mean, values in zip(found, each, strict=True):
        parts = values[:, : count * every].reshape(DELAYS.size, count, every, *values.shape[2:])
        exact = parts[:, :, :width].mean(axis=2)
        assert_allclose(mean, exact, atol=off * np.abs(exact).max())


def test_real_poles_have_real_modes_and_a_late_response_is_nothing():
    one = AveragedInput(SIGNAL, DT, 20, 20)
    late = one.modes(np.array([DT * SIGNAL.size]), np.array([[-0.1 + 0j]]))
    for values in late:
        assert values.dtype == np.float64
        assert not values.any()
