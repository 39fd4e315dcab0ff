"""Channels of a measured frequency response, taken by indexing."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError

HZ = np.array([3.0, 1.0, 2.0])
LABELS = {"inputs": ["a", "b", "c"], "outputs": ["x", "y"]}
RNG = np.random.default_rng(0)
RESPONSE = RNG.standard_normal((2, 3, 3)) + 1j * RNG.standard_normal((2, 3, 3))
COHERENCE, STD = RNG.uniform(size=(2, 3, 3)), RNG.uniform(size=(2, 3, 3))


@pytest.fixture
def frf():
    return cr.MeasuredFRF(
        RESPONSE, HZ, coherence=COHERENCE, std=STD, repeats=7, name="rig", **LABELS
    )


@pytest.mark.parametrize(
    ("key", "rows", "columns"),
    [
        ((slice(None), 0), [0, 1], [0]),
        ((1, slice(1, 3)), [1], [1, 2]),
        (([0, 1], ["a", "c"]), [0, 1], [0, 2]),
        ((slice(None), slice(None)), [0, 1], [0, 1, 2]),
    ],
)
def test_coherence_and_deviation_go_with_the_channels(frf, key, rows, columns):
    part = frf[key]
    assert isinstance(part, cr.MeasuredFRF)
    rising = np.argsort(HZ)
    for name, values in (("frdata", RESPONSE), ("coherence", COHERENCE), ("std", STD)):
        assert_array_equal(getattr(part, name), values[np.ix_(rows, columns, rising)])
    assert_array_equal(part.frequency_hz, [1.0, 2.0, 3.0])
    assert part.repeats == part.between_hz(1.0, 2.0).repeats == 7


@pytest.mark.parametrize("key", [(0, 1), ("x", "b"), (slice(0, 1), 1)])
def test_one_channel_is_as_from_one_record(frf, key):
    one = frf[key]
    rising = np.argsort(HZ)
    assert_array_equal(one.std, STD[0, 1, rising])
    assert_array_equal(one.coherence, COHERENCE[0, 1, rising])
    assert_array_equal(one.complex, RESPONSE[0, 1, rising])
    assert one.between_hz(1.5, 3).std.shape == (2,)
    assert one[0, 0].std.shape == (3,)


@pytest.mark.parametrize("key", [(0, 1), (slice(None), 0), (1, slice(1, 3)), ("y", ["a", "b"])])
def test_channels_are_those_of_python_control(frf, key):
    plain = ct.FrequencyResponseData(frf.frdata, frf.omega, smooth=False, name="rig", **LABELS)[key]
    ours = frf[key]
    assert_array_equal(ours.frdata, plain.frdata)
    assert ours.input_labels == plain.input_labels
    assert ours.output_labels == plain.output_labels
    assert ours.name == plain.name


def test_without_coherence_and_deviation_there_is_none_to_take():
    part = cr.MeasuredFRF(RESPONSE, HZ)[1, 0]
    assert part.coherence is None
    assert part.std is None
    assert part.repeats is None


def test_no_channel_is_refused(frf):
    with pytest.raises(DataError, match="chooses no channel"):
        frf[-1, -1]


def test_one_channel_of_many_is_fitted_with_its_own_weights():
    f = np.geomspace(0.1, 10, 40)
    s = 2j * np.pi * f
    response = np.array([[1 / (0.1 * s + 1), np.exp(-0.05 * s) / (0.1 * s + 1)]])
    std = np.array([[np.full(40, 0.3), np.full(40, 0.01)]])
    frf = cr.MeasuredFRF(response, f, std=std)
    fit = cr.fit_frf(frf[0, 1], 1, dt=1e-3).fit
    assert fit.noise_known
    assert np.all(fit.sigma == pytest.approx(0.01))
    assert fit.dead_time == pytest.approx(0.05, abs=1e-6)
