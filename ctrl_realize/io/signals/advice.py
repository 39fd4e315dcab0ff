"""What helps against faults of a clock and a counter in a file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...errors import DataWarning, TimeAxisError, warn_caller
from ...numerics.signals.counters import counter_period
from ..tables import Table
from .samples import Samples

_HOUR = 3600.0  # s


def tell_counters(path: Path, samples: Samples) -> None:
    """Warn of an output that jumps like a counter that starts again."""
    for row in np.atleast_2d(samples.output):
        period = counter_period(row)
        if period is not None:
            warn_caller(
                f"{path}: the output jumps like a counter that starts again after {period:.6g}: "
                f"wrap={period:.6g} joins its turns",
                DataWarning,
            )


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def explained(error: TimeAxisError, table: Table, samples: Samples, dated: bool) -> str:
    """Message of a fault of the time axis, with its place in the file and what helps."""
    row = re.search(r"row (\d+)", str(error))
    place = f" ({samples.place(int(row[1]))})" if row else ""
    steps = np.diff(samples.time)
    steps *= np.sign(np.median(steps)) or 1.0  # the newest sample may come first
    usual = float(np.median(np.abs(steps)))
    back, forward = (
        dated and np.any(np.abs(steps - usual - turn) <= min(usual, _HOUR / 3))
        for turn in (-_HOUR, _HOUR)
    )
    zone = "time_zone= puts its hours in order: the zone of the clock, such as 'Europe/Berlin'"
    if back:
        advice = f"; the clock seems to be set back by an hour (summer time): {zone}"
    # many repeated time stamps: the samples are faster than the resolution of the clock
    elif np.mean(steps == 0) > 0.2:
        advice = "; the clock is coarser than the sample time, give dt= instead"
    elif np.any(steps < 0):
        advice = "; if the file has several tests, read them with read_records(path, by=)"
    else:
        advice = "; missing='keep' takes the samples as they are"
    if forward:
        advice += f"; if the clock was set forward by an hour (summer time), {zone}"
    return f"{table.path}{place}: {error}{advice}"
