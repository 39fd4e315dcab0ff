"""TDMS files of LabVIEW, if npTDMS is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..checks import check_size
from ..tables import Table
from .arrays import AnyArray, table_of_arrays


def read_tdms(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the channels of a TDMS file as columns, named ``group.channel``.

    The sample time of a waveform (``wf_increment``) is used where there is no channel of time.

    Raises
    ------
    FileFormatError
        npTDMS is not installed, or the file is damaged, too large or without channels.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise FileFormatError(
            f"{path} is a LabVIEW TDMS file: pip install 'ctrl-realize[tdms]' (npTDMS) to read "
            "it, or export it as CSV"
        ) from error
    arrays: dict[str, AnyArray] = {}
    steps: set[float] = set()
    try:
        with path.open("rb") as raw, TdmsFile.open(raw) as file:
            channels = [channel for group in file.groups() for channel in group.channels()]
            size = sum(8 * len(channel) for channel in channels)
            check_size(path, size, max_bytes, ", unpacked,")
            for channel in channels:
                unit = channel.properties.get("unit_string")
                name = f"{channel.group_name}.{channel.name}" + (f" [{unit}]" if unit else "")
                arrays[name] = np.asarray(channel[:])
                steps.add(float(channel.properties.get("wf_increment", 0.0)))
    except FileFormatError:
        raise
    # damaged files raise errors of struct, ValueError, KeyError and others
    except Exception as error:
        reason = str(error).partition("\n")[0][:200]
        raise FileFormatError(f"{path} is a damaged TDMS file: {reason}") from error
    if len(steps) == 1 and (step := steps.pop()) > 0:
        arrays["dt"] = np.array(step)
    return table_of_arrays(path, arrays, variable)
