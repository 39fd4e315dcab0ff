"""What can be known about a dead time: bound and identifiability."""

import numpy as np
import pytest

from ctrl_realize.numerics.cramer_rao import dead_time_bound
from ctrl_realize.numerics.separable.varpro import KnownFactor
from tests import rigs

SENSOR = 2 * np.pi * 30.0


def bound(plant, **kwargs):
    poles = plant.poles().astype(complex)
    gain = np.array([np.prod(-poles).real])
    return (
        dead_time_bound(poles, gain, 37 * rigs.TS, rigs.TS, (3840, 1101), 0.01, **kwargs) / rigs.TS
    )


@pytest.mark.parametrize(
    ("plant", "kwargs", "samples"),
    [
        (rigs.R3, {}, 0.920),
        (rigs.R4, {}, 4.33),
        (rigs.R3, {"known": KnownFactor(np.array([-SENSOR + 0j]), np.array([SENSOR]))}, 0.959),
    ],
)
def test_bounds_are_those_computed_independently(plant, kwargs, samples):
    # Samples per 1 % noise, from a separate program with numerical derivatives, three digits.
    assert bound(plant, **kwargs) == pytest.approx(samples, rel=2e-3)
