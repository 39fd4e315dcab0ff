"""What an estimated impulse response holds and says."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ctrl_realize.identification.impulse_estimate import ImpulseEstimate
from ctrl_realize.results import Flag

FLAG = Flag("no_response", "output 0 shows no response")


def estimate(markov=(0.0, 1.0, 0.5), std=(0.01, 0.0234, 0.02), noise=(0.125,), **beside):
    settings = {"method": "TC kernel, 3 free parameters", "rows": 560, **beside}
    return ImpulseEstimate(
        np.array(markov), 0.012345678, std=np.array(std), noise_std=np.array(noise), **settings
    )


def test_a_report_has_the_gain_the_largest_error_and_the_noise():
    told = estimate(name="hairdryer", choices=("OKID is no better",), flags=(FLAG,)).report()
    assert told.splitlines() == [
        "Impulse response 'hairdryer'",
        "  method       TC kernel, 3 free parameters",
        "  length       3 samples of 12.3457 ms, 560 equations",
        "  sum (gain)   1.5",
        "  largest std  0.0234",
        "  noise left   0.125",
        "  - OKID is no better",
        "  ! output 0 shows no response",
    ]
    assert estimate().report().startswith("Impulse response\n")


def test_every_channel_has_its_gain_and_every_output_its_noise():
    markov = np.arange(12.0).reshape(2, 2, 3)
    rows = dict(estimate(markov, 0.1 * markov, (0.5, 0.25))._rows())
    assert rows["sum (gain)"] == "3, 12, 21, 30"
    assert rows["largest std"] == "1.1"
    assert rows["noise left"] == "0.5, 0.25"


def test_an_estimate_keeps_what_it_is_given_and_cannot_be_changed():
    made = estimate(name="rig", flags=(FLAG,), choices=("a",))
    again = pickle.loads(pickle.dumps(made))
    for one in (made, again):
        assert (one.dt, one.name, one.rows) == (0.012345678, "rig", 560)
        assert (one.flags, one.choices) == ((FLAG,), ("a",))
        assert_array_equal(one.std, [0.01, 0.0234, 0.02])
        assert_array_equal(one.noise_std, [0.125])
    assert (estimate().flags, estimate().choices, estimate().name) == ((), (), "")
    for array in (made.std, made.noise_std):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        made.rows = 1
    assert repr(made) == "<ImpulseEstimate 'rig': 3 samples of 0.0123457 s>"
