"""Step responses in closed form, at the places where the formula changes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.state_space.process_models import process_step

TIME = np.linspace(0, 20, 41)


@pytest.mark.parametrize(("lag", "second"), [(3.0, 0.0), (3.0, 0.5), (0.5, 3.0), (3.0, 3.0)])
@pytest.mark.parametrize("integrating", [False, True])
def test_the_response_obeys_its_differential_equation(lag, second, integrating):
    # T1 T2 y'' + (T1 + T2) y' + y = u, or its integral, by differences of a fine grid
    h = 1e-3
    t = 1.5 + h * np.arange(3, 9000)
    y = [process_step(t + s, lag, second, 1.5, integrating=integrating) for s in (-h, 0, h)]
    slope, bend = (y[2] - y[0]) / (2 * h), (y[2] - 2 * y[1] + y[0]) / h**2
    forced = lag * second * bend + (lag + second) * slope + y[1]
    # second differences: h^2 / 12 of the fourth derivative, below 1 / 0.5^4
    assert_allclose(forced, t - 1.5 if integrating else 1.0, atol=1e-5)


@pytest.mark.parametrize("integrating", [False, True])
@pytest.mark.parametrize("second", [0.0, 0.7, 2.0])
def test_nothing_happens_before_the_dead_time_and_it_starts_at_zero(integrating, second):
    y = process_step(TIME, 2.0, second, 5.0, integrating=integrating)
    assert_allclose(y[TIME <= 5.0], 0, atol=1e-15)
    assert np.all(y[TIME > 5.0] > 0)


@pytest.mark.parametrize("integrating", [False, True])
@pytest.mark.parametrize("near", [0.9e-6, 1.1e-6, 1e-4])
def test_equal_lags_are_the_limit_of_nearly_equal_ones(integrating, near):
    equal = process_step(TIME, 2.0, 2.0, 1.0, integrating=integrating)
    nearly = process_step(TIME, 2.0, 2.0 * (1 - near), 1.0, integrating=integrating)
    # the response changes by at most d/dT of it, about 1 a second, times the lag's change;
    # digits that cancel in the difference of the lags: 1e-16 / near
    assert_allclose(nearly, equal, atol=2 * 2.0 * near + 20e-16 / near * 20)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize(("lag", "second"), [(2.0, 0.0), (2.0, 1e-5), (2.0, 0.5), (2.0, 2.0)])
def test_the_unit_of_time_does_not_matter(unit, lag, second):
    for integrating, size in ((False, 1.0), (True, unit)):
        plain = process_step(TIME, lag, second, 1.0, integrating=integrating)
        other = process_step(unit * TIME, unit * lag, unit * second, unit, integrating=integrating)
        assert_allclose(other, size * plain, rtol=1e-9, atol=1e-9 * size)
