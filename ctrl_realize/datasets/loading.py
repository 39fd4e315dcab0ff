"""Find and read the data sets."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._shown import Card
from ..data import MeasuredFRF, Record
from ..errors import OptionError
from ..io import read_frf, read_record
from ..results import Result
from .catalogue import DATASETS
from .info import DataFile, DatasetInfo

if TYPE_CHECKING:
    import pandas as pd

_BY_NAME = {each.name: each for each in DATASETS}


@dataclass(frozen=True, eq=False)
class Dataset(Result):
    """Records and frequency responses of one plant, with what is known of it.

    Attributes
    ----------
    info : DatasetInfo
        Origin, licence, dead time, citation.
    records : tuple of Record
    frfs : tuple of MeasuredFRF

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> data = cr.datasets.load("stage")
    >>> data
    <Dataset 'stage': 0 records, 2 frequency responses>
    >>> data.frf
    <MeasuredFRF 'stage output 1': 423 points, 0.1...1000 Hz>
    """

    info: DatasetInfo
    records: tuple[Record, ...]
    frfs: tuple[MeasuredFRF, ...]

    @property
    def record(self) -> Record:
        """The first record."""
        if not self.records:
            raise OptionError(f"{self.info.name} has no record, only frequency responses: use .frf")
        return self.records[0]

    @property
    def frf(self) -> MeasuredFRF:
        """The first frequency response."""
        if not self.frfs:
            raise OptionError(
                f"{self.info.name} has no measured frequency response; spectral_frf(...) estimates "
                "one from a record"
            )
        return self.frfs[0]

    def _card(self) -> Card:
        return self.info._card()

    def __repr__(self) -> str:
        count, responses = len(self.records), len(self.frfs)
        return (
            f"<Dataset {self.info.name!r}: {count} record{'s' * (count != 1)}, "
            f"{responses} frequency response{'s' * (responses != 1)}>"
        )


def names() -> list[str]:
    """Return the names of all data sets.

    Returns
    -------
    list of str

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.datasets.names()
    ['gas_furnace', 'motor_bench', 'simulated_valve', 'stage', 'sugar_actuator', 'tclab']
    """
    return sorted(_BY_NAME)


def load(name: str) -> Dataset:
    """Load a data set: its records and frequency responses, with origin and licence.

    Parameters
    ----------
    name : str
        One of `names`.

    Returns
    -------
    Dataset

    Raises
    ------
    OptionError
        There is no such data set.

    See Also
    --------
    path : The file itself, for `read_record` and the command line.
    table : All data sets at a glance.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> data = cr.datasets.load("tclab")
    >>> data.records[0]
    <Record 'tclab steps': 571 samples of 1.00375 s, 1 input, 1 output>
    >>> print(data.info.dead_time_text)
    0 to 5.00 s (our look at the first motion)
    """
    info = _info(name)
    files = [(each, _located(info, each)) for each in info.files]
    records = tuple(_read(info, each, file) for each, file in files if each.kind == "record")
    frfs = tuple(
        read_frf(file, name=f"{info.name} {_spelled(each)}")
        for each, file in files
        if each.kind == "frf"
    )
    return Dataset(info, records, frfs)


def path(name: str, file: str | None = None) -> Path:
    """Return the path of a file of a data set, to read it with `read_record` or `read_frf`.

    Parameters
    ----------
    name : str
        One of `names`.
    file : str, optional
        Name of the record or frequency response within the set; default: the first one.

    Returns
    -------
    Path

    Raises
    ------
    OptionError
        There is no such data set, or it has no such file.

    See Also
    --------
    load : Records and frequency responses, read.

    Notes
    -----
    The licence of the data lies beside the file. ``python -m ctrl_realize.datasets NAME`` prints
    the path, so that the command line can be tried on a real file::

        ctrl-realize identify $(python -m ctrl_realize.datasets simulated_valve) -o result

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.read_record(cr.datasets.path("simulated_valve"))
    <Record 'step': 2560 samples of 0.00078125 s, 1 input, 1 output>
    >>> cr.datasets.path("stage", "output_2").name
    'frf_output_2.csv'
    """
    info = _info(name)
    if file is None:
        return _located(info, info.files[0])
    known = {each.name: each for each in info.files}
    if file not in known:
        raise OptionError(f"{info.name} has no file {file!r}{_nearest(file, list(known))}")
    return _located(info, known[file])


def table() -> pd.DataFrame:
    """List all data sets: plant, what was recorded, dead time, licence.

    Returns
    -------
    pandas.DataFrame
        A row for each data set.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.datasets.table()["licence"].to_dict()["stage"]
    'MIT'
    """
    import pandas as pd

    rows = [
        {
            "name": info.name,
            "plant": info.plant,
            "records": sum(file.kind == "record" for file in info.files),
            "frfs": sum(file.kind == "frf" for file in info.files),
            "dead_time": info.dead_time_text,
            "licence": info.licence,
            "simulated": info.simulated,
        }
        for info in (_BY_NAME[name] for name in names())
    ]
    return pd.DataFrame(rows).set_index("name")


def _info(name: object) -> DatasetInfo:
    if not isinstance(name, str) or name not in _BY_NAME:
        raise OptionError(f"there is no data set {name!r}{_nearest(name, names())}")
    return _BY_NAME[name]


def _nearest(given: object, known: list[str]) -> str:
    """Say what was probably meant, and what there is."""
    near = get_close_matches(str(given), known, n=1)
    meant = f"; did you mean {near[0]!r}?" if near else ""
    return f"{meant} (expected one of {', '.join(map(repr, known))})"


def _spelled(file: DataFile) -> str:
    return file.name.replace("_", " ")


def _located(info: DatasetInfo, file: DataFile) -> Path:
    return Path(str(resources.files(__package__).joinpath("files", info.name, file.file)))


def _read(info: DatasetInfo, file: DataFile, path: Path) -> Record:
    found = read_record(path, **file.reading)
    name = f"{info.name} {_spelled(file)}"
    labels: dict[str, Any] = {"input_labels": file.inputs, "output_labels": file.outputs}
    return Record(found.time, found.input, found.output, name=name, **labels)
