"""The words and the arrays of tracked delays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.identification.tracked import TrackedDelay, track_of

NOW = TrackedDelay(
    time=12.25,
    delay=37,
    dead_time=0.0372124,
    interval=(36, 39),
    gain_ratio=0.81,
    gain_std=0.005,
    speed_ratios=(0.9, 1.125),
    noise_std=0.0812,
    tells=True,
)
LATER = replace(
    NOW,
    time=13.0,
    dead_time=0.04,
    interval=(35, 44),
    gain_ratio=0.7,
    tells=False,
    reason="it rests",
)


def test_a_moment_is_reported_with_units_and_two_deviations_of_the_gain():
    assert NOW.report().splitlines() == [
        "Tracked delay at 12.25 s",
        "  delay           37 samples (36 to 39), 37.21 ms",
        "  gain            0.81 +- 0.01 of the starting model's",
        "  speed of poles  0.9, 1.12",
        "  noise left      0.0812",
        "  the data tell   yes",
    ]
    assert repr(NOW) == "<TrackedDelay 37 (36, 39) at 12.25 s>"


def test_a_moment_that_does_not_tell_says_why():
    rows = dict(replace(LATER, speed_ratios=())._rows())
    assert rows["the data tell"] == "no: it rests"
    assert rows["speed of poles"] == "kept"
    assert repr(LATER) == "<TrackedDelay 37 (35, 44) at 13 s, cannot tell: it rests>"


def test_a_track_has_an_entry_for_every_moment():
    track = track_of([LATER, NOW, LATER], 0.001)
    assert_array_equal(track.time, [13.0, 12.25, 13.0])
    assert_array_equal(track.dead_time, [0.04, 0.0372124, 0.04])
    assert_array_equal(track.low, [35, 36, 35])
    assert_array_equal(track.high, [44, 39, 44])
    assert_array_equal(track.gain_ratio, [0.7, 0.81, 0.7])
    assert_array_equal(track.tells, [False, True, False])
    assert_allclose(track.delay, [40, 37.2124, 40], rtol=1e-12)
    assert {track.time.dtype, track.low.dtype, track.high.dtype} == {np.dtype(float)}
    for array in (track.time, track.tells):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_a_track_is_reported_by_its_first_and_last_told_moment():
    second = replace(NOW, time=14.0, dead_time=0.0385, gain_ratio=0.78)
    between = replace(NOW, time=13.0, dead_time=0.01, gain_ratio=0.5)
    track = track_of([LATER, NOW, between, second, LATER], 0.001)
    assert track.report().splitlines() == [
        "Tracked delay",
        "  told   3 of 5 moments",
        "  first  37.21 samples at 12.25 s",
        "  last   38.50 samples at 14 s",
        "  gain   0.81 to 0.78",
    ]
    assert repr(track) == "<DelayTrack: 5 moments, told at 3>"


def test_a_track_without_a_told_moment_has_no_first_one():
    track = track_of([LATER], 0.001)
    assert track.report().splitlines() == ["Tracked delay", "  told  0 of 1 moments"]
