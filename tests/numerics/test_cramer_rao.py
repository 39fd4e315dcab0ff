"""What can be known about a dead time: bound and identifiability."""

import numpy as np
import pytest

from ctrl_realize.numerics.cramer_rao import dead_time_bound
from ctrl_realize.numerics.separable.poles import parameters_from_poles
from ctrl_realize.numerics.separable.responses import StepSequence
from ctrl_realize.numerics.separable.varpro import KnownFactor, respond
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


@pytest.mark.parametrize(("extra", "deficiency"), [(0, 0), (1, 1), (2, 1)])
def test_fisher_matrix_loses_one_rank_with_a_superfluous_zero(extra, deficiency):
    # All parameters (dead time, poles, numerator, offset) by central differences of the response:
    # nothing here knows of the elimination that the fit uses.
    poles = rigs.R3.poles().astype(complex)
    time = rigs.TS * np.arange(-50, 1100)
    drive = StepSequence(time, np.ones(1150, dtype=np.int64), rigs.TS, np.zeros(1), np.ones(1))
    unit = 2 * np.pi * 8  # rad/s: numerator coefficients of comparable size
    numerator = np.zeros(1 + extra)
    numerator[0] = np.prod(-poles).real
    truth = np.concatenate([[37.3 * rigs.TS], parameters_from_poles(poles), numerator])
    size = np.concatenate([[rigs.TS], np.ones(3), numerator[0] / unit ** np.arange(1 + extra)])

    def response(x):
        return respond(drive, KnownFactor(), x[4:], x[:4])

    columns = [np.ones(time.size)]
    for i in range(truth.size):
        step = np.zeros_like(truth)
        step[i] = 1e-5 * size[i]
        columns.append((response(truth + step) - response(truth - step)) / 2e-5)
    matrix = np.stack(columns, axis=1)
    singular = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), compute_uv=False)
    # differences of step 1e-5 leave 1e-7; the smallest regular singular value is above 1e-3
    assert np.sum(singular < 1e-6) == deficiency
    assert np.sum(singular > 1e-4) == singular.size - deficiency
