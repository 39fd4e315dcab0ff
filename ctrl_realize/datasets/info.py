"""What is known of a data set: origin, licence, signals, dead time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from .._wording import interval_in_time
from ..results import Result


@dataclass(frozen=True)
class DataFile:
    """One file of a data set.

    Attributes
    ----------
    name : str
        Name of the record or frequency response.
    file : str
        File name in the folder of the set.
    kind : {"record", "frf"}
    inputs, outputs : tuple of str
        Signals with their units in brackets; ``[-]`` where the source states none.
    n_samples : int
        Rows of the file.
    dt : float or None
        Sample time in s (the mean, where the stamps have jitter); None for a frequency response.
    reading : dict
        Arguments of `read_record` beside the path that make the record; empty where its defaults
        do.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> file = cr.datasets.load("tclab").info.files[0]
    >>> file.name, file.n_samples, file.reading
    ('steps', 571, {'resample': True})
    """

    name: str
    file: str
    kind: Literal["record", "frf"]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    n_samples: int
    dt: float | None = None
    reading: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DatasetInfo(Result):
    """Origin, licence and known facts of a data set.

    Attributes
    ----------
    name : str
    plant : str
        What was measured.
    files : tuple of DataFile
    dead_time_band : tuple of float, or None
        Lowest and highest dead time in s that is compatible with what is known; None where nothing
        is.
    dead_time_source : str
        Who states it: the authors, or our look at the first motion of the output. A band, not a
        truth; exact for simulated data.
    facts : tuple of str
        What the authors or the literature state, and what a first look at the data shows.
    origin : str
        Where the data come from, and who measured them.
    licence : str
        SPDX identifier, or ``"facts"``: numbers printed in a book, which nobody owns.
    licence_note : str
        To whom the licence is owed and why it applies; its text lies beside the data.
    changes : str
        What differs from the source.
    citation : str
    simulated : bool

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> info = cr.datasets.load("gas_furnace").info
    >>> info.dead_time_band, info.licence
    ((27.0, 27.0), 'facts')
    """

    name: str
    plant: str
    files: tuple[DataFile, ...]
    dead_time_band: tuple[float, float] | None
    dead_time_source: str
    facts: tuple[str, ...]
    origin: str
    licence: str
    licence_note: str
    changes: str
    citation: str
    simulated: bool = False

    @property
    def dead_time_text(self) -> str:
        """The dead time that is known, with its source."""
        if self.dead_time_band is None:
            return self.dead_time_source
        low, high = self.dead_time_band
        value = f"{low:.5g} s" if low == high else interval_in_time(low, high)
        return f"{value} ({self.dead_time_source})"

    def _title(self) -> str:
        kind = "simulated, not measured" if self.simulated else "measured"
        return f"Data set {self.name} ({kind})"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("plant", self.plant),
            *((each.name, _signals(each)) for each in self.files),
            ("dead time", self.dead_time_text),
            ("origin", self.origin),
            ("changes", self.changes),
            ("licence", f"{self.licence}: {self.licence_note}"),
            ("cite", self.citation),
        ]

    def _choices(self) -> list[str]:
        return list(self.facts)

    def __repr__(self) -> str:
        return f"<DatasetInfo {self.name!r}: {self.plant}, {self.licence}>"


def _signals(file: DataFile) -> str:
    """Signals, size and sample time in one line."""
    signals = f"{', '.join(file.inputs)} -> {', '.join(file.outputs)}"
    if file.dt is None:
        return f"{signals}; frequency response, {file.n_samples} points"
    return f"{signals}; {file.n_samples} samples of {file.dt:.5g} s"
