"""A planned input: as arrays, as a file, and with its measured output as a record."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._checks import numbers
from ..data import Record
from ..errors import DataError
from ..io.atomic import replaced_when_complete
from ..numerics.arrays import FloatArray, lock_fields
from ..results import Result


@dataclass(frozen=True, eq=False, repr=False)
class PlannedInput(Result):
    """Input of a test.

    Attributes
    ----------
    time : ndarray, shape (N,)
        In s, uniform.
    command : ndarray, shape (N,)
        Held over each sample.
    """

    time: FloatArray
    command: FloatArray

    def __post_init__(self) -> None:
        lock_fields(self, "time", "command")

    def __repr__(self) -> str:
        words = duration_in_words(self.duration)
        return f"<{type(self).__name__}: {words}, {self.time.size} samples of {self.dt:g} s>"

    @property
    def dt(self) -> float:
        """Sample time in s."""
        return float(self.time[1] - self.time[0])

    @property
    def duration(self) -> float:
        """Duration in s."""
        return self.time.size * self.dt

    @property
    def _afterwards(self) -> float:
        """Command once the plan is over."""
        return float(self.command[-1])

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the command to a file, atomically.

        Parameters
        ----------
        path : path-like
            Its columns are ``time_s`` and ``command``; a third one with the measured output makes
            it a record for `read_record`.

        Raises
        ------
        OSError
            The folder is missing or cannot be written.
        """
        target = Path(path)
        table = np.stack([self.time, self.command], axis=1)
        with replaced_when_complete(target) as temporary:
            np.savetxt(
                temporary, table, fmt="%.10g", delimiter=",", header="time_s,command", comments=""
            )
        return target

    def record(self, output: ArrayLike, *, time: ArrayLike | None = None, **labels: Any) -> Record:
        """Make a record of the measured output and the command of the plan.

        Parameters
        ----------
        output : array_like, shape (N,)
            For a valve its position.
        time : array_like, shape (N,), optional
            In s from the start of the plan. Default: that of the plan. After the plan of an
            experiment its command is that at rest, after that of a valve the last one.
        **labels
            Further arguments of `Record`.

        Raises
        ------
        DataError
            An output that is not as long as its time.
        """
        measured = numbers(output, "output")
        stamps = self.time if time is None else numbers(time, "time")
        if measured.shape != stamps.shape:
            raise DataError(
                f"output has shape {measured.shape}; expected {stamps.shape}, one for each time"
            )
        last = np.searchsorted(self.time, stamps + 1e-6 * self.dt, side="right") - 1
        played = self.command[np.clip(last, 0, None)]
        played[stamps + 1e-6 * self.dt >= self.time[-1] + self.dt] = self._afterwards
        return Record(stamps, played, measured, **labels)


def duration_in_words(seconds: float) -> str:
    """Write the duration of a test in s, or in minutes."""
    return f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.1f} min"
