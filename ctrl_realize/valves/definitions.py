"""What each metric of a valve test means, where the definition is from, which test it needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

STEPS = "steps of several sizes in both directions, each held until the stem stands still"
STAIRCASE = "a staircase of small steps (0.1 to 1 %) up, down and up again"
STROKES = "full strokes in both directions"
RAMP = "a slow ramp over the range in both directions"
REPEATS = "at least three steps of one size and direction"

_GLOSSARY = "glossary of control valve terms at iamechatronics.com"
_OTHER_GLOSSARY = "glossary of control valve terms at industrialseparation.com"
_ISA = (
    "ISA-75.25.01, ISA-TR75.25.02 and the EnTech specification (version 3.0) have this metric; "
    "wording and clause not verified against the documents"
)
_IEC = (
    "IEC 61298-2 and ISA-51.1 have this metric; wording and clause not verified against the "
    "documents"
)
_OWN = "our own rule, stated here in full"


@dataclass(frozen=True)
class Definition:
    """Definition of a metric.

    Attributes
    ----------
    name : str
    unit : str
        ``"s"``, ``"%"`` (of the span), ``"%/%"``, ``"%/s"``.
    sentence : str
        What is measured.
    source : str
        Where the definition is from, as far as it was read.
    needs : str
        The test without which it is not known.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.valves.DEFINITIONS["t86"].unit
    's'
    """

    name: str
    unit: str
    sentence: str
    source: str
    needs: str


_ALL = {
    "dead_time": Definition(
        "dead time Td (first motion)",
        "s",
        "time from the step of the command to the first visible motion: the rise through 5 and "
        "15 standard deviations of the noise, extrapolated to the level before",
        f"{_OTHER_GLOSSARY}, entry dead time (no response detected after a small step); threshold "
        f"and extrapolation: {_OWN}; {_ISA}",
        STEPS,
    ),
    "fitted_dead_time": Definition(
        "dead time (fit)",
        "s",
        "dead time of the linear model that `identify` fits to the steps of one size and direction",
        _OWN,
        STEPS,
    ),
    "t63": Definition(
        "T63",
        "s",
        "time from the step of the command until 63.2 % of the change, dead time included",
        f"{_GLOSSARY}, entry T63; {_ISA}",
        STEPS,
    ),
    "t86": Definition(
        "T86",
        "s",
        "time from the step of the command until 86.5 % of the change, dead time included",
        _ISA,
        STEPS,
    ),
    "t98": Definition(
        "T98",
        "s",
        "time from the step of the command until 98 % of the change, dead time included",
        _ISA,
        STEPS,
    ),
    "settling_time": Definition(
        "settling time",
        "s",
        "time from the step of the command from which on the position stays within 2 % of the "
        "change about its final level",
        f"{_OWN}; {_ISA}",
        STEPS,
    ),
    "overshoot": Definition(
        "overshoot",
        "%",
        "largest excursion beyond the final level, in % of the change; 0 if noise explains it",
        f"{_OWN}; {_ISA}",
        STEPS,
    ),
    "gain": Definition(
        "travel gain",
        "%/%",
        "change of the position in % of travel over the change of the command in % of its span",
        f"{_OWN}; {_ISA}",
        STEPS,
    ),
    "gain_scatter": Definition(
        "scatter of the travel gain",
        "%/%",
        "largest standard deviation of the travel gain between steps of one size and direction",
        _OWN,
        REPEATS,
    ),
    "resolution": Definition(
        "resolution",
        "%",
        "smallest change of the command in one direction after which the position moves; between "
        "the last level without and the first with movement",
        _ISA,
        STAIRCASE,
    ),
    "dead_band": Definition(
        "dead band",
        "%",
        "change of the command after a reversal through which the position does not move: width of "
        "the play that fits the levels of the staircase, or change between the movements before "
        "and after a reversal; without a staircase, width of the loop in the slow ramp",
        f"{_OTHER_GLOSSARY}, entry dead band (range through which the input can be varied, upon "
        f"reversal, without an observable change of the output); {_ISA}",
        STAIRCASE,
    ),
    "backlash": Definition(
        "backlash",
        "%",
        "dead band minus resolution: the part of the dead band that the position crosses without "
        "sticking",
        f"{_OWN}; {_ISA}",
        STAIRCASE,
    ),
    "hysteresis": Definition(
        "hysteresis",
        "%",
        "largest difference between closing and opening at the same command, in % of travel, minus "
        "the dead band",
        f"largest difference: Kistler glossary, entry hysteresis, after ANSI/ISA-S37.1; minus the "
        f"dead band: {_IEC}",
        RAMP,
    ),
    "linearity": Definition(
        "linearity",
        "%",
        "largest distance of the mean of the opening and the closing curve from the straight line "
        "of least squares, in % of travel",
        f"{_OWN}; {_IEC}",
        RAMP,
    ),
    "slew_rate_opening": Definition(
        "slew rate, opening",
        "%/s",
        "largest mean rate between 40 and 80 % of a change of any size",
        _OWN,
        STROKES,
    ),
    "slew_rate_closing": Definition(
        "slew rate, closing",
        "%/s",
        "largest mean rate between 40 and 80 % of a change of any size",
        _OWN,
        STROKES,
    ),
    "stroke_time_opening": Definition(
        "full-stroke time, opening",
        "s",
        "time from the command until 98 % of a full stroke (at least 80 % of the command's span)",
        _OWN,
        STROKES,
    ),
    "stroke_time_closing": Definition(
        "full-stroke time, closing",
        "s",
        "time from the command until 98 % of a full stroke (at least 80 % of the command's span)",
        _OWN,
        STROKES,
    ),
}

DEFINITIONS: Mapping[str, Definition] = MappingProxyType(_ALL)
"""Metrics by name, in the order of the report."""
