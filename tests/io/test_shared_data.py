"""Every measured record and response at hand is read, and read right."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ctrl_realize.io import read_frf, read_record


def test_every_measured_record_in_text_is_read_to_the_last_bit(shared_data):
    files = [f for f in shared_data.rglob("*.csv") if "frf" not in f.name]
    assert len(files) >= 25
    for file in files:
        record = read_record(file)
        names = file.read_text().partition("\n")[0].split(",")
        # NumPy's own reader is the second opinion
        table = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)
        assert_array_equal(record.time, table[0])
        inputs = [k for k, name in enumerate(names) if name.startswith("input")]
        outputs = [k for k, name in enumerate(names) if name.startswith("output")]
        assert_array_equal(np.atleast_2d(record.input), table[inputs])
        assert_array_equal(np.atleast_2d(record.output), table[outputs])


def test_every_measured_frequency_response_is_read(shared_data):
    files = list(shared_data.rglob("*frf*.csv"))
    assert len(files) >= 5
    for file in files:
        frf = read_frf(file)
        frequency, magnitude, phase = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)
        assert_array_equal(frf.frequency_hz, frequency)
        np.testing.assert_allclose(np.abs(frf.frdata[0, 0]), magnitude, rtol=1e-15)
        turns = (np.angle(frf.frdata[0, 0], deg=True) - phase) / 360
        # angle() and exp() round, and 2160 degrees cost three digits
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-13)


@pytest.mark.parametrize(
    ("name", "dt", "samples"),
    [("motor_bench_multisine.npz", 0.0004, 50_000), ("tue_load_500k.npz", 0.00025, 500_000)],
)
def test_long_records_in_npz_are_read(shared_data, name, dt, samples):
    record = read_record(shared_data / name)
    assert (record.dt, record.n_samples) == (dt, samples)
    with np.load(shared_data / name) as arrays:
        assert_array_equal(record.output, arrays["y"])
