"""What helps against faults of a clock in a file."""

from __future__ import annotations

import re

import numpy as np

from ...data.samples import COARSE, Samples
from ...errors import TimeAxisError
from ..tables import Table


@np.errstate(over="ignore", invalid="ignore")  # the largest doubles
def explained(error: TimeAxisError, table: Table, samples: Samples) -> str:
    """Message of a fault of the time axis, with its place in the file and what helps."""
    row = re.search(r"row (\d+)", str(error))
    place = f" ({samples.place(int(row[1]))})" if row else ""
    steps = np.diff(samples.time)
    steps *= np.sign(np.median(steps)) or 1.0  # the newest sample may come first
    # many repeated time stamps: the samples are faster than the resolution of the clock
    if np.mean(steps == 0) > COARSE:
        advice = "; the clock is coarser than the sample time, give dt= instead"
    elif np.any(steps < 0):
        advice = (
            "; if the file has several tests, read them with read_records(path, by=); if the clock "
            "was set for summer time, time_zone= is its zone, such as 'Europe/Berlin'"
        )
    else:
        advice = (
            "" if "missing=" in str(error) else "; missing='keep' takes the samples as they are"
        )
    return f"{table.path}{place}: {error}{advice}"
