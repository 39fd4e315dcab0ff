"""Process models by name, with fixed and bounded parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, TypeAlias

from .._checks import band, real
from ..errors import OptionError, OrderError
from ..numerics.engine.problem import Structure
from ..numerics.families.process_form import ProcessForm
from ..numerics.output_error.other_structures import Requested

MOST_ORDER = 8  # higher orders suffer from rounding in the partial fractions
MOST_LAGS = 3

_NAMES = {
    "FOPDT": "P1D", "FOPTD": "P1D", "FOLPD": "P1D",
    "SOPDT": "P2D", "SOPTD": "P2D", "SOLPD": "P2D",
    "IPDT": "P0DI", "IPTD": "P0DI", "FOLIPD": "P1DI", "FOPDTI": "P1DI",
}  # fmt: skip
"""Names of textbooks and their meaning in those of process models."""
_PARAMETERS = {
    "KP": "gain", "TD": "dead_time", "TP1": "lag_1", "TP2": "lag_2", "TP3": "lag_3",
    "TZ": "lead_1", "TW": "pair_time_1", "ZETA": "pair_damping_1",
    "LEAD": "lead_1", "LAG": "lag_1", "PAIR_TIME": "pair_time_1", "PAIR_DAMPING": "pair_damping_1",
}  # fmt: skip
"""Further names of parameters."""
_EXPECTED = (
    "a pair (order, relative_degree) or a process model such as 'P1D', 'P2DZ', 'P2DU', 'P1DI', "
    "'FOPDT' or 'SOPDT': P, 0 to 3 lags, then D (dead time), I (integrator), Z (zero), U (two of "
    "the poles may oscillate)"
)


@dataclass(frozen=True)
class ProcessStructure:
    """A process model by name, with parameters that are fixed, bounded, or start somewhere.

    Attributes
    ----------
    name : str
        ``P``, the number of lags (0 to 3) without an integrator, and any of ``D`` (dead time),
        ``I`` (integrator), ``Z`` (a zero), ``U`` (two of the poles are a pair that oscillates), in
        any order; also ``"FOPDT"`` (``P1D``), ``"SOPDT"`` (``P2D``), ``"IPDT"`` (``P0DI``).
    fixed : mapping of str to float
        Parameters that are known: ``gain``, ``dead_time``, ``lag_1`` to ``lag_3``, ``lead_1``,
        ``pair_time_1``, ``pair_damping_1``; or ``Kp``, ``Td``, ``Tp1`` to ``Tp3``, ``Tz``, ``Tw``,
        ``Zeta``. Times in s.
    bounds : mapping of str to (low, high)
        Ranges of others; None for no end.
    start : mapping of str to float
        Values from which the search starts, beside those that the data suggest.

    Raises
    ------
    OptionError, OrderError
        A name or parameter that does not exist, a value out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(900)
    >>> y = np.where(t < 1.125, 0.0, 6 * -np.expm1(-(t - 1.125) / 0.4))
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(t.size)
    >>> record = cr.Record(t, np.where(t < 1.0, 0.0, 2.0), y + noise)
    >>> known = cr.identification.ProcessStructure("FOPDT", fixed={"dead_time": 0.125})
    >>> fit = cr.fit_output_error(record, structures=known).fit
    >>> fit.interval, round(fit.parameter_table().loc["lag_1", "value"], 3)
    ((0.125, 0.125), np.float64(0.4))
    """

    name: str
    fixed: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._checked()

    def _checked(self) -> ProcessForm:
        """Form for the fit, with checked values."""
        plain = _form(self.name)
        fixed = {key: _value(key, value) for key, value in _named(self.fixed, "fixed", plain)}
        bounds = {key: _ends(key, ends) for key, ends in _named(self.bounds, "bounds", plain)}
        start = {key: _value(key, value) for key, value in _named(self.start, "start", plain)}
        if both := sorted(fixed.keys() & bounds.keys()):
            raise OptionError(f"{', '.join(both)} is fixed and bounded; expected one of the two")
        return replace(plain, fixed=fixed, bounds=bounds, start=start)


StructureLike: TypeAlias = "tuple[int, int] | str | ProcessStructure"
Structures: TypeAlias = "Sequence[StructureLike] | StructureLike"


def requested(given: Structures | None) -> Requested:
    """Check structures, pairs or names.

    Raises
    ------
    OptionError, OrderError
        What is no structure; none at all.
    """
    if given is None:
        return Requested()
    if isinstance(given, int | float):
        raise OptionError(f"structures={given!r}; expected (order, relative_degree), or a name")
    pair = isinstance(given, tuple) and [type(one) for one in given] == [int, int]
    alone = pair or isinstance(given, str | ProcessStructure)
    several: Iterable[Any] = [given] if alone else given  # type: ignore[assignment]
    pairs: list[Structure] = []
    forms: list[ProcessForm] = []
    for one in several:
        if isinstance(one, str | ProcessStructure):
            forms.append((ProcessStructure(one) if isinstance(one, str) else one)._checked())
        else:
            pairs.append(_pair(one))
    if not pairs and not forms:
        raise OptionError("structures is empty; give None for all of them")
    if pairs and forms:
        raise OptionError(
            "structures has pairs and names of process models; expected one of the two"
        )
    every = [*pairs, *(form.structure for form in forms)]
    return Requested(tuple(dict.fromkeys(every)), tuple(forms))


def plain_pairs(given: Structures | None, task: str) -> list[tuple[int, int]] | None:
    """Return structures as pairs, for a fit that has no prescribed parameters.

    Raises
    ------
    OptionError
        A process model with more than poles, zeros and a dead time.
    """
    found = requested(given)
    if found.structures is None:
        return None
    for form in found.forms:
        if form.prescribed or form.pair or form.integrator or not form.dead_time:
            raise OptionError(
                f"{task} takes process models without U and I, with D, and without fixed or "
                f"bounded parameters, got {form.name!r}; give (order, relative_degree)"
            )
    return [(one.order, one.relative_degree) for one in found.structures]


def _pair(given: Any) -> Structure:
    try:
        n, r = (int(number) for number in given)
    except (TypeError, ValueError):
        raise OptionError(f"structure {given!r}; expected {_EXPECTED}") from None
    if not (1 <= r <= n <= MOST_ORDER):
        raise OrderError(
            f"structure ({n}, {r}); expected 1 <= relative degree <= order <= {MOST_ORDER}"
        )
    return Structure(n, r)


def _form(name: str) -> ProcessForm:
    said = str(name).strip().upper().replace(" ", "")
    said = _NAMES.get(said, said)
    match = re.fullmatch(r"P([0-9])([DIUZ]*)", said)
    letters = match[2] if match else ""
    if match is None or len(set(letters)) < len(letters):
        raise OptionError(f"structure {name!r}; expected {_EXPECTED}")
    lags, pair, lead = int(match[1]), "U" in letters, "Z" in letters
    integrator = "I" in letters
    if lags > MOST_LAGS or lags < 2 * pair or lags + integrator < 1:
        raise OrderError(
            f"structure {name!r}: expected 0 to {MOST_LAGS} lags, at least 2 with U, and at least "
            "one lag or an integrator"
        )
    if lags + integrator <= lead:
        raise OrderError(
            f"structure {name!r} passes the input on at once; expected fewer zeros than poles"
        )
    return ProcessForm(str(name), lags - 2 * pair, pair, lead, integrator, "D" in letters)


def _named(given: Any, what: str, form: ProcessForm) -> list[tuple[str, Any]]:
    if not isinstance(given, Mapping):
        raise OptionError(f"{what}={given!r}; expected values by name, such as {{'lag_1': 10.0}}")
    found = {}
    for key, value in given.items():
        name = _PARAMETERS.get(str(key).upper(), str(key).lower())
        if name not in form.names or (name == "dead_time" and not form.dead_time):
            raise OptionError(
                f"{what} has {key!r}; the parameters of {form.name} are "
                f"{', '.join(n for n in form.names if form.dead_time or n != 'dead_time')}"
            )
        if name in found:
            raise OptionError(f"{what} has {name} twice, here as {key!r}; expected one value")
        found[name] = value
    return list(found.items())


def _value(name: str, value: Any) -> float:
    number = real(value, name, "value of a parameter, times in s")
    (low, high), zero = _range(name), name in ("dead_time", "lead_1")
    if not low <= number <= high or (number == 0 and not zero):
        least = "" if zero else ", not 0"
        raise OptionError(f"{name}={value!r}; expected a number in {low:g}...{high:g}{least}")
    return number


def _range(name: str) -> tuple[float, float]:
    """Possible values."""
    if name in ("gain", "lead_1"):
        return -inf, inf
    return 0.0, 1.0 if name.startswith("pair_damping") else inf


def _ends(name: str, ends: Any) -> tuple[float, float]:
    least, most = _range(name)
    try:
        first, last = ends
    except (TypeError, ValueError):
        first, last = band(ends, name, "bounds of a parameter")
    low = least if first in (None, -inf) else real(first, name, "lower bound")
    high = most if last in (None, inf) else real(last, name, "upper bound")
    if not least <= low < high <= most:
        raise OptionError(
            f"bounds of {name} are {ends!r}; expected low < high within {least:g}...{most:g}"
        )
    return low, high
