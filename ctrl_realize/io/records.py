"""Read measured records from a file."""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from ..data import Record
from .checks import MAX_BYTES
from .columns import Selector, find_columns
from .signals.reading import Reading, record_of, tests_in


def read_record(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    input: Selector | None = None,
    output: Selector | None = None,
    reference: Selector | None = None,
    mode: str | int | None = None,
    dt: float | None = None,
    time_unit: str = "auto",
    time_format: str | None = None,
    time_zone: str | None = None,
    delimiter: str = "auto",
    decimal: str = "auto",
    thousands: str | None = "auto",
    encoding: str = "auto",
    comment: str | None = "auto",
    header: bool | Literal["auto"] = "auto",
    skip_rows: int = 0,
    variable: str | None = None,
    start: Any = None,
    stop: Any = None,
    missing: Literal["auto", "refuse", "keep", "hold"] = "auto",
    na_values: str | float | Sequence[str | float] | None = None,
    quality: str | int | None = "auto",
    good: str | float | Sequence[str | float] | None = None,
    wrap: float | None = None,
    resample: bool = False,
    rest: Sequence[Any] | None = None,
    name: str | None = None,
    max_bytes: float = MAX_BYTES,
) -> Record:
    r"""Read a measured record from a text, Excel, ``.mat``, ``.npz``, Parquet, HDF5 or TDMS file.

    Columns are identified by their names (``time_s``, ``t``, ``Zeit [ms]``; ``input``, ``u``,
    ``OP``, ``TIC101_MV``; ``output``, ``y``, ``PV``; numbered ones are channels). Without a header,
    three columns are time, input and output, and two with `dt` are input and output. A long table
    (columns of tag, time and value, as historians export) is read by its tags. Ambiguous columns
    are an error that lists them.

    Parameters
    ----------
    path : path-like
        The file; its type is determined from its first bytes.
    time : str or int, optional
        Time column, by name or by number from 0. It holds numbers, dates or times of day (with
        their date in a column of its own, too).
    input : str, int or sequence of them, optional
        Input column or tag, by name or by number from 0.
    output : str, int or sequence of them, optional
        Output column or tag. Several make a record of several channels. Columns of ``ON`` and
        ``OFF`` are 1 and 0; ``12.5 %`` is 12.5.
    reference : str, int or sequence of them, optional
        Column or tag of the set point, one for each output; it holds its value where a cell has
        none. Default: ``SP``, ``SV``, ``setpoint``, ``TIC101_SP``, ..., if there is one.
    mode : str or int, optional
        Column or tag of the controller's mode: ``MAN`` or ``AUTO``, ``CAS``, 0 or 1. In manual the
        set point is not in force, and NaN. Default: ``MODE``, ``A/M``, ..., if there is one.
    dt : float, optional
        Sample time in s, where there is no time column or its clock is coarser; other times are
        refused.
    time_unit : str, optional
        ``"s"``, ``"ms"``, ``"us"``, ``"ns"``, ``"min"``, ``"h"`` or ``"day"``. ``"auto"``: that of
        the header, or s. For a clock such as ``12:34`` it is the unit of the first number.
    time_format : str, optional
        Format of dates, such as ``%d.%m.%Y %H:%M:%S``, see `datetime.strptime`. Default: ISO 8601
        or, where the cells tell, the order of day and month.
    time_zone : str, optional
        Zone of a clock that has summer time, such as ``"Europe/Berlin"``. The hour that comes twice
        and the one that is left out are put right. Dates in `start` and `stop` are of that zone.
    delimiter : str, optional
        Column separator, such as ``,`` or ``;`` or tab; ``"auto"``: detected.
    decimal : str, optional
        Decimal sign, ``.`` or ``,``; ``"auto"``: detected.
    thousands : str or None, optional
        Separator of thousands, such as ``,`` in ``1,234.5``; ``"auto"``: detected.
    encoding : str, optional
        Encoding of text; ``"auto"``: detected.
    comment : str or None, optional
        Sign that begins comments; ``"auto"``: detected.
    header : bool or "auto", optional
        False: The first line holds no names.
    skip_rows : int, optional
        Lines to skip at the start.
    variable : str, optional
        Matrix or struct of a ``.mat`` or ``.npz`` file, group of an HDF5 or TDMS file, or sheet of
        a workbook to use.
    start : float, str or datetime, optional
        First time to use, in s or as a date: as the file writes it, or in ISO 8601. A date without
        time of day is its midnight; without an offset from UTC it is on the clock of the file.
    stop : float, str or datetime, optional
        Last time to use, likewise.
    missing : {"auto", "refuse", "keep", "hold"}, optional
        Bad cells, gaps and irregular times are kept as missing samples and told, refused, kept, or
        kept with an input that holds its last value meanwhile. Bad cells have no value (empty,
        ``NaN``, ``Bad``, ``I/O Timeout``, ...), or a bad quality; times are irregular if their
        stamps repeat, too. ``"auto"`` holds an input that has the same value behind a gap, and
        refuses a gap in time in which it moved. ``"hold"`` is for inputs that were only stored when
        they changed, as historians do; with gaps and irregular stamps it is always done, see
        `Record.from_samples`.
    na_values : str, float or sequence of them, optional
        Further words and numbers without a value, such as -9999.
    quality : str or int, optional
        Column of the quality; none: qualities are ignored. ``"auto"``: ``Quality``, ``Status``,
        ``Good``, ..., and ``TIC101/PV.quality`` or a second ``Quality`` for the signal of that name
        or to its left.
    good : str, float or sequence of them, optional
        Good qualities. Default: all but ``Bad...`` and the bad codes of OPC DA (below 64), OPC UA
        (bit 31), Ignition (500, ...) and AVEVA PI (states such as 246).
    wrap : float, optional
        Number of values of a counter that starts again, such as 4096 for 12 bits or 360 for an
        angle; the turns of the output are joined as by `numpy.unwrap`. Default: if the output jumps
        as a counter does, which is told; 0: it is none.
    resample : bool, optional
        Resample jittering samples onto a uniform time axis, see `Record.resampled`. A step is then
        off by up to half a sample; as they are, stamps tell its moment.
    rest : (float, float), optional
        Input and output in the steady state before a record that begins with its step. See
        `Record.with_baseline`.
    name : str, optional
        Name of the record; default: the file's, without its ending.
    max_bytes : float, optional
        Largest file, packed or unpacked; 2 GiB.

    Returns
    -------
    Record

    Raises
    ------
    MissingFileError
        There is no such file, or no permission to read it.
    FileFormatError
        The file is empty, too large, damaged, or not a table of numbers.
    DataError
        A cell is not a finite number; the message gives its line.
    TimeAxisError
        Time jitters, has gaps, repeats or decreases.
    OptionError
        The columns or the order of day and month are ambiguous, or the requested columns do not
        exist.

    Warns
    -----
    DataWarning
        Only a part could be used: samples of bad quality are left out, or the last line, which is
        incomplete as if writing was interrupted; or codes of qualities are not known, or the output
        jumps like a counter that starts again.

    See Also
    --------
    ctrl_realize.io.read_records : Several tests in one file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "valve.csv"
    ...     _ = file.write_text("Zeit [ms];u;y\n0;0;1,5\n10;1;1,5\n20;1;1,75\n")
    ...     record = cr.read_record(file)
    >>> record
    <Record 'valve': 3 samples of 0.01 s, 1 input, 1 output>
    """
    how = Reading(**locals())
    return record_of(how.table(), how, how.label)


def read_records(
    path: str | os.PathLike[str], *, by: str | int | None = None, **options: Any
) -> list[Record]:
    r"""Read several tests in one file as a list of records.

    Parameters
    ----------
    path : path-like
    by : str or int, optional
        A file holds several tests: the column that separates them, by name or number. Default: a
        new test begins where time jumps back, or forward by more than ten usual steps.
    **options
        Arguments of `read_record`.

    Returns
    -------
    list of Record
        In the order of the file; their names are that of the file and the value in the column, or
        a number.

    Raises
    ------
    CtrlRealizeError
        As for `read_record`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "tests.csv"
    ...     _ = file.write_text("test,t,u,y\nup,0,0,5\nup,1,1,5\nup,2,1,6\n"
    ...                         "down,0,1,6\ndown,1,0,6\ndown,2,0,5\n")
    ...     records = cr.io.read_records(file, by="test")
    >>> [record.name for record in records]
    ['tests up', 'tests down']
    """
    how = asked(path, options)
    table = how.table()
    taken = [] if by is None else find_columns(table, by, "by")
    return [
        record_of(table.rows(rows, range(len(table.columns))), how, f"{how.label} {value}", taken)
        for value, rows in tests_in(table, how, taken)
    ]


def asked(path: str | os.PathLike[str], options: Mapping[str, Any]) -> Reading:
    """Return the arguments of `read_record`, checked."""
    given = inspect.signature(read_record).bind(path, **options)
    given.apply_defaults()
    return Reading(**given.arguments)
