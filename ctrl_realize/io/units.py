"""Units in the names of columns: ``time_ms``, ``t [s]``, ``Zeit/ms``, ``phase (deg)``."""

from __future__ import annotations

from .._facts import facts
from ..errors import OptionError
from ..numerics.arrays import FloatArray

# Scale as (multiplier, divisor): t / 1000 is the double nearest to the decimal number in the file,
# t * 0.001 often is not. Not "d": a column u_d is more likely a disturbance than u in days.
TIME_UNITS: dict[str, tuple[float, float]] = {
    "s": (1.0, 1.0), "ms": (1.0, 1e3), "us": (1.0, 1e6), "ns": (1.0, 1e9),
    "min": (60.0, 1.0), "h": (3600.0, 1.0), "day": (86400.0, 1.0),
}  # fmt: skip

_WORDS = facts("io/words.toml")
_SPELLINGS: dict[str, str] = {
    word: unit for unit, words in _WORDS["spellings"].items() for word in words
}
_KNOWN = {*TIME_UNITS, *_WORDS["units"]["in_names"]}
_STANDING_ALONE = _KNOWN.union(_WORDS["units"]["below_names"])
_NO_TIMES = _STANDING_ALONE.union(_WORDS["units"]["temperatures"]) - TIME_UNITS.keys()

_PER_SECOND = ("rad_s", "rad/s", "rad/sec")
_SEPARATORS = " _/"
_OPENING = "[({<"
_CLOSING = "])}>"


def plain_unit(text: str) -> str:
    """Normalise a unit: ``"Sec" -> "s"``, ``"µs" -> "us"``, ``"Degrees" -> "deg"``."""
    bare = bare_unit(text)
    lower = bare.lower()
    if lower == "mhz":  # the only unit here that depends on its capital letter
        return "MHz" if bare[0] == "M" else bare
    return _SPELLINGS.get(lower, lower)


def split_unit(name: str) -> tuple[str, str]:
    """Split a column's name into name and unit in plain spelling.

    Examples
    --------
    >>> from ctrl_realize.io.units import split_unit
    >>> split_unit("time_ms"), split_unit("Zeit [s]"), split_unit("output_1")
    (('time', 'ms'), ('Zeit', 's'), ('output_1', ''))
    """
    base, unit = _parted(name.strip())
    return base, plain_unit(unit)


def unit_of(name: str) -> str:
    """Return the unit in a column's name as it is written, without brackets.

    Examples
    --------
    >>> from ctrl_realize.io.units import unit_of
    >>> unit_of("Temp [°C]"), unit_of("time_ms"), unit_of("output")
    ('°C', 'ms', '')
    """
    return bare_unit(_parted(name.strip())[1])


def stands_alone(unit: str) -> bool:
    """Whether a text is a unit and hardly anything else, as in a cell ``61.0 °C``."""
    plain = plain_unit(unit)
    return plain in _STANDING_ALONE or plain in _NO_TIMES or plain in _WORDS["units"]["in_cells"]


def unit_named(name: str) -> str:
    """Return the unit of time that is a column's whole name (``millis``), or ``""``."""
    plain = plain_unit(name)
    return plain if plain in TIME_UNITS else ""


def is_no_time(unit: str) -> bool:
    """Whether a unit is that of another quantity, as in ``T [°C]``."""
    return plain_unit(unit) in _NO_TIMES


def sample_time_unit(name: str) -> str:
    """Return the unit in a name such as ``SampleTime[ms]``; empty for other names."""
    base, unit = split_unit(name.rpartition(".")[2].replace("_", " "))
    if not unit and base.lower() in _WORDS["columns"]["in_seconds"]:
        return "s"  # as on all oscilloscopes
    return unit if base.lower() in _WORDS["columns"]["sample_time"] and unit in TIME_UNITS else ""


def bare_unit(text: str) -> str:
    """Return a unit without brackets and blanks."""
    return text.strip().strip("[](){}<>").strip()


def _parted(name: str) -> tuple[str, str]:
    if name.endswith(tuple(_CLOSING)):
        opening = max(name.rfind(bracket) for bracket in _OPENING)
        if opening >= 0:
            base = name[:opening].rstrip(_SEPARATORS)
            return base or name, name[opening:]
    tails = [tail for tail in _PER_SECOND if name.lower().endswith(tail)]
    start = max(name.rfind(separator) for separator in _SEPARATORS) + 1
    if tails:
        start = len(name) - len(tails[0])
    base = name[:start].rstrip(_SEPARATORS)
    if base and start and name[start - 1] in _SEPARATORS and plain_unit(name[start:]) in _KNOWN:
        return base, name[start:]
    return name, ""


def is_units_line(cells: list[str]) -> bool:
    """Whether the cells below a header are units, not names or numbers."""
    filled = [cell.strip() for cell in cells if cell.strip()]
    bracketed = [cell[0] in "[({<" and cell[-1] in "])}>" for cell in filled]
    known = [plain_unit(cell) in _STANDING_ALONE for cell in filled]
    alone = [stands_alone(one) or one.lower() in _WORDS["columns"]["counter"] for one in filled]
    return bool(filled) and (all(bracketed) or any(known) or all(alone))


def to_seconds(values: FloatArray, unit: str) -> FloatArray:
    """Scale time values to seconds."""
    multiplier, divisor = TIME_UNITS[checked_time_unit(unit)]
    return values * multiplier / divisor


def checked_time_unit(unit: object) -> str:
    """Return the plain spelling of a unit of time, or raise an error that lists them."""
    plain = plain_unit(unit) if isinstance(unit, str) else None
    if plain not in TIME_UNITS:
        raise OptionError(
            f"{unit!r} is not a known unit of time; give time_unit= one of " + ", ".join(TIME_UNITS)
        )
    return plain
