"""Bins of a record through an actuator: single samples where responses begin."""

import numpy as np
import pytest

from ctrl_realize.numerics.actuated.records import actuated_record

DELAY, LAG, HOLD = 30, 15.0, 200


def staircase(rest):
    """Three moves and the response of a lag behind a delay, with noise."""
    command = np.repeat([0.0, 1.0, 0.2, 1.5], [rest, HOLD, HOLD, HOLD])
    t = np.arange(command.size)
    output = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    for move in np.flatnonzero(np.diff(command, prepend=0.0)):
        after = np.clip(t - move - DELAY, 0, None)
        output -= (command[move] - command[move - 1]) * np.expm1(-after / LAG)
    return output, command


@pytest.mark.parametrize("rest", [100, 3])
def test_means_are_single_samples_where_a_response_begins_with_a_rest_or_without(rest):
    output, command = staircase(rest)
    record = actuated_record(output, command, 0.1)
    begins = record.moves + DELAY
    beside = np.abs(record.first[:, None] - begins).min(axis=1) <= 15
    assert np.all(record.width[beside] == 1)
    assert record.width.sum() == output.size
    np.testing.assert_allclose(record.width @ record.averaged(output), output.sum(), rtol=1e-12)


def test_missing_samples_and_a_drift_at_rest_leave_single_samples_there():
    output, command = staircase(100)
    output += 1e-3 * np.arange(output.size)
    output[110:118] = np.nan
    record = actuated_record(output, command, 0.1)
    begins = np.searchsorted(record.rows, record.moves + DELAY)
    beside = np.abs(record.first[:, None] - begins).min(axis=1) <= 15
    assert np.all(record.width[beside] == 1)
