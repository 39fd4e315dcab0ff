"""TDMS files of LabVIEW, if npTDMS is installed."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..checks import check_size, package_for, told_if_damaged
from ..tables import Table
from .arrays import AnyArray, table_of_arrays

_LEAD_IN = struct.Struct("<4sIIQQ")
"""Mark, contents, version, and lengths of the segment and of its metadata ("TDMS File Format
Internal Structure", NI, section Lead In)."""
_BIG_ENDIAN = 1 << 6
_VERSIONS = (4712, 4713)


def read_tdms(path: Path, *, variable: str | None, max_bytes: float) -> Table:
    """Read the channels of a TDMS file as columns, named ``group.channel``.

    The sample time of a waveform (``wf_increment``) is used where there is no channel of time.

    Raises
    ------
    FileFormatError
        npTDMS is not installed, or the file is damaged, too large or without channels.
    """
    with package_for(path, "a LabVIEW TDMS file", "tdms", "npTDMS"):
        from nptdms import TdmsFile
    content = path.read_bytes()
    _check_lead_in(path, content)
    arrays: dict[str, AnyArray] = {}
    steps: set[float] = set()
    # from memory: a file would make room for whatever length a damaged one announces
    with told_if_damaged(path, "TDMS file"), TdmsFile.open(io.BytesIO(content)) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        # samples are not packed: more than one for each byte are only announced
        count = sum(len(channel) for channel in channels)
        check_size(path, 8 * count, max_bytes, ", unpacked,")
        if count > len(content):
            raise FileFormatError(f"{path} is a damaged TDMS file: it is shorter than it says")
        for channel in channels:
            unit = channel.properties.get("unit_string")
            name = f"{channel.group_name}.{channel.name}" + (f" [{unit}]" if unit else "")
            arrays[name] = np.asarray(channel[:])
            steps.add(float(channel.properties.get("wf_increment", 0.0)))
    if len(steps) == 1 and (step := steps.pop()) > 0:
        arrays["dt"] = np.array(step)
    return table_of_arrays(path, arrays, variable)


def _check_lead_in(path: Path, content: bytes) -> None:
    """Refuse a file that only begins like one: its reader would believe any number in it."""
    size = len(content)
    if size < _LEAD_IN.size:
        raise FileFormatError(f"{path} is a damaged TDMS file: it has {size} bytes")
    _, contents, version, _, metadata = _LEAD_IN.unpack_from(content)
    if contents & _BIG_ENDIAN:
        version = int.from_bytes(content[8:12], "big")
        metadata = int.from_bytes(content[20:28], "big")
    if version not in _VERSIONS or metadata > size:
        raise FileFormatError(
            f"{path} is a damaged TDMS file, of version {version}; expected {_VERSIONS[0]} or "
            f"{_VERSIONS[1]}"
        )
