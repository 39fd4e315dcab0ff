"""Read a measured frequency response from a file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .._facts import facts
from ..data import MeasuredFRF
from ..errors import DataError, OptionError
from ..numerics.arrays import ComplexArray, FloatArray
from .checks import MAX_BYTES
from .columns import ambiguous, check_lengths, find_column, has_header, named, plain_name
from .read import read_table
from .tables import Table
from .text_options import TextOptions
from .units import plain_unit

_NAMES = facts("io/words.toml")["frf"]
_IN_HZ = {"mHz": 1e-3, "Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "rad/s": 1 / (2 * np.pi)}
_SHALLOW = 60.0  # degrees, by which a lag turns the phase where it has halved the magnitude
_UNITS = {"frequency": tuple(_IN_HZ), "magnitude": ("abs", "dB"), "phase": ("deg", "rad")}


def read_frf(
    path: str | os.PathLike[str],
    *,
    frequency: str | int | None = None,
    magnitude: str | int | None = None,
    phase: str | int | None = None,
    real: str | int | None = None,
    imag: str | int | None = None,
    response: str | int | None = None,
    coherence: str | int | None = None,
    std: str | int | None = None,
    frequency_unit: str = "auto",
    magnitude_unit: str = "auto",
    phase_unit: str = "auto",
    delimiter: str = "auto",
    decimal: str = "auto",
    encoding: str = "auto",
    comment: str | None = "auto",
    header: bool | Literal["auto"] = "auto",
    skip_rows: int = 0,
    variable: str | None = None,
    name: str | None = None,
    max_bytes: float = MAX_BYTES,
) -> MeasuredFRF:
    r"""Read a measured frequency response from a CSV, TSV, ``.npz``, ``.mat`` or Parquet file.

    Columns are identified by their names (``frequency_hz``, ``omega``, ``magnitude_db``, ``phase
    [rad]``, ``real``, ``imag``, ``coherence``, ``std``); without a header, three columns are
    frequency, magnitude and phase. Units are taken from the header; default: frequency in Hz
    (``omega``: rad/s), magnitude as a ratio and phase in degrees. A ratio of other units, as of
    ``gain [%/mA]``, is kept as it is. If the values contradict this, or the frequency is in rad/s
    and the phase has no unit, it is an error.

    Parameters
    ----------
    path : path-like
        The file; its type is determined from its first bytes.
    frequency : str or int, optional
        Column of the frequency, by name or by number from 0.
    magnitude : str or int, optional
        Column of the magnitude.
    phase : str or int, optional
        Column of the phase.
    real : str or int, optional
        Column of the real part.
    imag : str or int, optional
        Column of the imaginary part.
    response : str or int, optional
        Complex numbers (as text ``0.5-0.3i``), in place of magnitude and phase, or real and
        imaginary part.
    coherence, std : str or int, optional
        Columns of the coherence, from 0 to 1 or in %, and of the standard deviation of the complex
        response, in its unit.
    frequency_unit : str, optional
        ``"mHz"``, ``"Hz"``, ``"kHz"``, ``"MHz"`` or ``"rad/s"``.
    magnitude_unit : str, optional
        ``"abs"`` or ``"dB"``.
    phase_unit : str, optional
        ``"deg"`` or ``"rad"``.
    delimiter, decimal, encoding, comment, header, skip_rows, variable, max_bytes
        As for `read_record`.
    name : str, optional
        Name of the system; default: the file's, without its ending.

    Returns
    -------
    MeasuredFRF

    Raises
    ------
    MissingFileError, FileFormatError, DataError, OptionError
        As for `read_record`.

    Warns
    -----
    DataWarning
        The last line is incomplete, as if writing was interrupted; it is left out.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "bench.csv"
    ...     _ = file.write_text("f [Hz],gain [dB],phase [deg]\n1,0,0\n10,-20,-90\n")
    ...     frf = cr.read_frf(file)
    >>> frf
    <MeasuredFRF 'bench': 2 points, 1...10 Hz>
    >>> print(abs(frf.frdata[0, 0]).round(6))
    [1.  0.1]
    """
    given = locals()
    units = {part: _checked_unit(given, f"{part}_unit", known) for part, known in _UNITS.items()}
    table = read_table(path, TextOptions.among(given), variable=variable, max_bytes=max_bytes)
    columns = _columns(table, given)
    check_lengths(table, columns.values())
    _check_unit_of_std(table, columns)
    coherences, stds = (
        table.numbers(columns[key]) if key in columns else None for key in ("coherence", "std")
    )
    if coherences is not None and table.columns[columns["coherence"]].unit == "%":
        coherences = coherences / 100
    try:
        values = _response(table, columns, units)
        points = _frequency_hz(table, columns["frequency"], units["frequency"])
        called = Path(path).stem if name is None else name
        return MeasuredFRF(values, points, coherence=coherences, std=stds, name=called)
    except DataError as error:
        if str(error).startswith(str(table.path)):
            raise
        raise DataError(f"{table.path}: {error}") from error


def _checked_unit(given: Mapping[str, Any], argument: str, known: Iterable[str]) -> str | None:
    """Unit that the caller gives; None is determined from the file."""
    unit = given[argument]
    if unit == "auto":
        return None
    plain = plain_unit(str(unit))
    if plain not in map(plain_unit, known):
        names = ", ".join(map(repr, known))
        raise OptionError(f"{argument}={unit!r} must be one of {names} or 'auto'")
    return plain


def parts_of_frf(table: Table) -> dict[str, int]:
    """Position of each part of a frequency response, by the header; none in another file."""
    try:
        return _columns(table, dict.fromkeys(_NAMES)) if has_header(table) else {}
    except OptionError:
        return {}


def _columns(table: Table, asked: Mapping[str, Any]) -> dict[str, int]:
    """Position of each part that is present."""
    columns = {
        part: find_column(table, asked[part], part) for part in _NAMES if asked[part] is not None
    }
    if not has_header(table) and not columns and len(table.columns) == 3:
        return {"frequency": 0, "magnitude": 1, "phase": 2}
    given = set(columns)
    for part, names in _NAMES.items():
        found = named(table, names, columns.values()) if part not in given else []
        if len(found) > 1:
            raise ambiguous(table, found, part, part)
        if found:
            columns[part] = found[0]
    forms = [("response",), ("real", "imag"), ("magnitude", "phase")]
    # columns given by the caller have priority over those found by name
    forms.sort(key=lambda form: -len(given.intersection(form)))
    complete = [form for form in forms if all(part in columns for part in form)]
    if "frequency" not in columns or not complete:
        missing = "the frequency" if "frequency" not in columns else "the response"
        raise OptionError(
            f"{table.path}: cannot tell which column is {missing}; give frequency= and "
            f"magnitude= with phase=, or real= with imag=; it has {table.listing()}"
        )
    kept = {"frequency", "coherence", "std", *complete[0]}
    return {part: index for part, index in columns.items() if part in kept}


def _unit(table: Table, index: int, given: str | None) -> str:
    """Unit that was given, or that of the header."""
    return plain_unit(table.columns[index].unit) if given is None else given


def _frequency_unit(table: Table, index: int, unit: str | None) -> str:
    named_omega = plain_name(table.columns[index].name) in ("omega", "ω", "w")
    return _unit(table, index, unit) or ("rad/s" if named_omega else "hz")


def _frequency_hz(table: Table, index: int, unit: str | None) -> FloatArray:
    unit = _frequency_unit(table, index, unit)
    in_hz = {plain_unit(name): size for name, size in _IN_HZ.items()}
    if unit not in in_hz:
        *names, last = map(repr, _IN_HZ)
        raise OptionError(
            f"{table.at(index)} is in {unit!r}; give frequency_unit={', '.join(names)} or {last}"
        )
    return table.numbers(index) * in_hz[unit]


def _check_unit_of_std(table: Table, columns: Mapping[str, int]) -> None:
    """Refuse a standard deviation that is not in the unit of the response.

    Raises
    ------
    OptionError
    """
    if (index := columns.get("std")) is None:
        return
    unit = plain_unit(table.columns[index].unit)
    others = {plain_unit(table.columns[at].unit) for part, at in columns.items() if part != "std"}
    if unit in ("db", "deg", "rad") or (unit == "%" and unit not in others):
        raise OptionError(
            f"{table.at(index)} is in {unit!r}; expected the standard deviation of the complex "
            "response in its own unit. Convert it, 1 % of a response G being 0.01 |G| and 1 dB "
            "0.115 |G|, or rename the column to leave it out"
        )


def _response(
    table: Table, columns: dict[str, int], units: Mapping[str, str | None]
) -> ComplexArray:
    if "response" in columns:
        return table.numbers(columns["response"], complex_too=True)
    if "real" in columns:
        return table.numbers(columns["real"]) + 1j * table.numbers(columns["imag"])
    magnitude = _magnitude(table, columns["magnitude"], units["magnitude"])
    radians = _frequency_unit(table, columns["frequency"], units["frequency"]) == "rad/s"
    falls = magnitude.min() < np.cos(np.deg2rad(_SHALLOW)) * magnitude.max()
    phase = _phase(table, columns["phase"], units["phase"], radians, falls)
    return np.asarray(magnitude * np.exp(1j * phase), dtype=np.complex128)


def _magnitude(table: Table, index: int, unit: str | None) -> FloatArray:
    values = table.numbers(index)
    unit = _unit(table, index, unit)
    if unit == "db":
        if values.max() > 400:
            raise DataError(f"{table.at(index)} goes up to {values.max():g} dB")
        return np.asarray(10 ** (values / 20), dtype=np.float64)
    if values.min() < 0 or unit.startswith("db"):  # dBV, dB V/V, dB re 1 mm/N
        seen = "has negative values" if values.min() < 0 else f"is in {unit!r}"
        raise OptionError(f"{table.at(index)} {seen}; is it in dB? give magnitude_unit='dB'")
    return values


def _phase(table: Table, index: int, unit: str | None, radians: bool, falls: bool) -> FloatArray:
    """Phase in rad; `radians` tells whether the frequency is in rad/s, as in python-control.

    A response that `falls` by so much has a phase of more than `_SHALLOW` degrees: less are rad.
    """
    values = table.numbers(index)
    unit = _unit(table, index, unit)
    if unit not in ("", "deg", "rad"):
        raise OptionError(f"{table.at(index)} is in {unit!r}; give phase_unit='deg' or 'rad'")
    largest = np.abs(values).max(initial=0.0)
    doubtful = radians or largest <= 2 * np.pi or (falls and largest <= _SHALLOW)
    if not unit and largest and doubtful:
        raise OptionError(
            f"{table.at(index)} could be in degrees or in radians; give phase_unit='deg' or 'rad'"
        )
    return values if unit == "rad" else np.deg2rad(values)
