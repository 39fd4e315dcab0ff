from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.errors import OptionError
from ctrl_realize.io.units import is_units_line, split_unit, to_seconds


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("time", ("time", "")),
        ("time_ms", ("time", "ms")),
        ("t [µs]", ("t", "us")),
        ("Zeit/ms", ("Zeit", "ms")),
        ("Time (Seconds)", ("Time", "s")),
        ("frequency_hz", ("frequency", "hz")),
        ("omega [rad/s]", ("omega", "rad/s")),
        ("w_rad_s", ("w", "rad/s")),
        ("phase deg", ("phase", "deg")),
        ("|G| [dB]", ("|G|", "db")),
        ("output_1", ("output_1", "")),
        ("u[0]", ("u", "0")),
        ("position (V)", ("position", "v")),
        ("[s]", ("[s]", "s")),
        ("", ("", "")),
    ],
)
def test_a_name_splits_into_what_and_unit(name, parts):
    assert split_unit(name) == parts


@pytest.mark.parametrize(
    ("cells", "answer"),
    [
        (["s", "mA", "V"], True),
        (["[s]", "[bar]", ""], True),
        (["(sec)", "(1)", "(mm)"], True),
        (["time", "u", "y"], False),
        (["", "", ""], False),
    ],
)
def test_a_line_of_units_is_known_by_a_unit_or_by_brackets(cells, answer):
    assert is_units_line(cells) is answer


@pytest.mark.parametrize(
    ("unit", "seconds"),
    [("s", 7.0), ("ms", 7e-3), ("µs", 7e-6), ("ns", 7e-9), ("min", 420.0), ("Hours", 25200.0)],
)
def test_scaled_time_is_the_double_nearest_to_the_decimal_number(unit, seconds):
    assert to_seconds(np.array([7.0]), unit)[0] == seconds


def test_an_unknown_unit_of_time_is_named_with_those_that_are_known():
    with pytest.raises(OptionError, match=r"'ticks'.*ms.*min"):
        to_seconds(np.arange(3.0), "ticks")
