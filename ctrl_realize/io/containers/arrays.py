"""Named arrays (from ``.npz`` and ``.mat``) as columns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError
from ..checks import MAX_COLUMNS, MAX_NAME
from ..tables import Column, Table
from ..units import unit_of

AnyArray = np.ndarray[Any, np.dtype[Any]]


def table_of_arrays(path: Path, arrays: Mapping[str, AnyArray], variable: str | None) -> Table:
    """Convert named arrays to columns; single numbers become constants.

    A matrix becomes one column for each channel, ``u[0]``, ``u[1]``, ...; its longer side is time.
    If it is the only array, its columns have no names, as in a text table without header.

    Parameters
    ----------
    path : pathlib.Path
        Where they are from.
    arrays : mapping of str to ndarray
    variable : str or None
        Use only this array, or the fields of this struct.

    Raises
    ------
    FileFormatError
        It contains no columns of numbers.
    """
    if variable is not None:
        inside = variable + "."
        chosen = {
            name.removeprefix(inside): array
            for name, array in arrays.items()
            if name == variable or name.startswith(inside)
        }
        if not chosen:
            raise FileFormatError(
                f"{path} has no variable {variable!r}; it has {', '.join(list(arrays)[:20])}"
            )
        arrays = chosen
    constants: dict[str, float] = {}
    columns: list[Column] = []
    for name, array in arrays.items():
        squeezed = np.squeeze(array)
        if squeezed.dtype.kind not in "biufcmMU" or squeezed.size == 0:
            continue
        if squeezed.ndim == 0:
            if squeezed.dtype.kind in "iuf":
                constants[name] = float(squeezed)
        elif squeezed.ndim <= 2:
            columns += _columns(name, squeezed, nameless=len(arrays) == 1)
    if not columns:
        found = ", ".join(f"{name} {array.shape}" for name, array in list(arrays.items())[:20])
        raise FileFormatError(f"{path} has no numeric columns; it has {found or 'nothing'}")
    return Table(path, tuple(columns), constants, place="sample {}".format)


def _columns(name: str, array: AnyArray, *, nameless: bool) -> list[Column]:
    name = name[:MAX_NAME]
    unit = unit_of(name)
    if array.ndim == 1:
        return [Column(name, unit, array)]
    channels = array if array.shape[0] <= array.shape[1] else array.T
    if len(channels) > MAX_COLUMNS:
        return []
    return [
        Column("" if nameless else f"{name}[{k}]", unit, channel)
        for k, channel in enumerate(channels)
    ]
