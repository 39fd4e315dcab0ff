"""Parameters of a process model with their errors, as a table and as one line of text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ._checks import one_of
from ._wording import number_within, numbers_alike, only_end
from .numerics.constants import Z_95

if TYPE_CHECKING:
    import pandas as pd

SECONDS: dict[str, float] = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "day": 86400.0}
"""Seconds in a unit of time of results."""

_LABELS = {
    "pair_time": "time constant of the pair",
    "pair_damping": "damping of the pair",
    "zero_time": "time constant of the zeros",
    "zero_damping": "damping of the zeros",
    "travel_low": "lower end of travel",
    "travel_high": "upper end of travel",
}
"""Beginnings of names that are not the words of the label."""

_LETTERS = {"dead": "L", "lag": "T", "pair_time": "Tw", "lead": "Tz", "zero_time": "Tz"}
"""Beginning of a time's name -> its letter beside a transfer function, as in MATLAB's process
models."""


@dataclass(frozen=True)
class Parameter:
    """Parameter of a process model.

    ``low <= value <= high``. The model is

    ``gain e^(-dead_time s) prod(lead s + 1) / (prod(lag s + 1) prod(T^2 s^2 + 2 damping T s + 1))``

    over s, if it has an integrator; T is ``pair_time``.

    Attributes
    ----------
    name : str
        ``"gain"``, ``"dead_time"``, ``"lag_1"``, ``"lag_2"`` (the slowest first),
        ``"pair_time_1"``, ``"pair_damping_1"``, ``"lead_1"`` (negative for an inverse
        response), ...
    value : float
        Times in s.
    std_given_structure : float
        Standard error if the structure of the model is that of the plant; NaN if it is not known.
    low, high : float
        95 % interval; NaN if it is not known. The gain of a response that has not settled may have
        one end alone; the other is infinite.
    all_structures : bool
        Whether the interval covers the choice of the structure, too.
    unit : str
        Of `value`; empty if it is a ratio or not known.
    times : {0, 1, -1}
        Power of the time in the unit: 1 for a time constant, -1 for the gain of an integrating
        model.

    Examples
    --------
    >>> from ctrl_realize.results import Parameter
    >>> lag = Parameter("lag_1", 179.2, 0.5, 178.2, 180.2, unit="s", times=1)
    >>> lag.in_time_unit("min").text()
    '2.987 +-0.008 min'
    """

    name: str
    value: float
    std_given_structure: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")
    all_structures: bool = False
    unit: str = ""
    times: int = 0

    @property
    def std(self) -> float:
        """Standard error, of an interval for all structures half of it over 1.96."""
        half = (self.high - self.low) / 2
        wide = np.isfinite(half) and (self.all_structures or np.isnan(self.std_given_structure))
        return half / Z_95 if wide else self.std_given_structure

    @property
    def label(self) -> str:
        """Name in words."""
        name = self.name
        for begin, words in _LABELS.items():
            if name.startswith(begin):  # one pair, but several lags
                name = words + name.removeprefix(begin).removesuffix("_1")
        return name.replace("_", " ")

    def in_time_unit(self, unit: str) -> Parameter:
        """Convert from seconds to ``"ms"``, ``"s"``, ``"min"``, ``"h"`` or ``"day"``."""
        factor = SECONDS[checked_time_unit(unit)] ** -self.times
        numbers = (self.value, self.std_given_structure, self.low, self.high)
        value, std, low, high = (factor * number for number in numbers)
        name = unit if self.times == 1 else self.unit
        if self.times == -1 and self.unit:
            closed = self.unit.endswith(")")
            name = self.unit[: -2 if closed else -1] + unit + ")" * closed
        return replace(self, value=value, std_given_structure=std, low=low, high=high, unit=name)

    def text(self) -> str:
        """Write value, standard error and unit, rounded to the same digit."""
        return f"{with_error(self.value, self.std)}{self.unit and ' ' + self.unit}"

    def interval_text(self) -> str:
        """Write the 95 % interval, rounded like the value; empty if it is not known."""
        unit = self.unit and " " + self.unit
        if np.isfinite([self.low, self.high]).all():
            return " to ".join(numbers_alike((self.low, self.high), self.low, self.high)) + unit
        said = only_end(self.low, self.high)
        return said and said + unit


def checked_time_unit(unit: str) -> str:
    """Return a unit of time of results, or raise an error that lists them."""
    return one_of(unit, "time_unit", tuple(SECONDS))


def slope_unit(gain_unit: str, time_unit: str) -> str:
    """Unit of the gain of an integrating model, from that of the gain.

    Examples
    --------
    >>> from ctrl_realize._parameters import slope_unit
    >>> slope_unit("°C/%", "min"), slope_unit("bar", "s"), slope_unit("", "s")
    ('°C/(% min)', 'bar/s', '1/s')
    >>> slope_unit("(mm/s)/V", "s"), slope_unit("bar/(l/min)", "s")
    ('(mm/s)/(V s)', 'bar/((l/min) s)')
    """
    parts = re.fullmatch(r"(\([^)]*\)|[^/(]*)/(.+)", gain_unit)
    return f"{parts[1]}/({parts[2]} {time_unit})" if parts else f"{gain_unit or '1'}/{time_unit}"


def gain_unit(output: str, input: str) -> str:
    """Unit of a gain from those of output and input; empty if they are not known or the same.

    Examples
    --------
    >>> from ctrl_realize._parameters import gain_unit
    >>> gain_unit("degC", "%"), gain_unit("m3/h", "%"), gain_unit("", "V"), gain_unit("V", "V")
    ('degC/%', '(m3/h)/%', '1/V', '')
    """
    if output == input:
        return ""
    above, below = (f"({unit})" if "/" in unit or " " in unit else unit for unit in (output, input))
    if not below:
        return output
    return f"{above or '1'}/{below}"


def with_error(value: float, error: float) -> str:
    """Write a value and its standard error, which has one digit, or two from 1.1 to 1.9.

    Examples
    --------
    >>> from ctrl_realize._parameters import with_error
    >>> with_error(0.79971, 0.00132), with_error(179.04, 0.4), with_error(3.2, float("nan"))
    ('0.7997 +-0.0013', '179.0 +-0.4', '3.2')
    >>> with_error(2400.0, 31.0), with_error(5.0, 0.0)
    ('2400 +-31', '5')
    >>> with_error(2.424, 450.0)  # not 2, which its interval need not hold
    '2.42 +-450'
    """
    if not np.isfinite(error) or error <= 0 or error < 1e-9 * abs(value):
        return f"{value:.4g}"
    digits = -int(np.floor(np.log10(error)))
    if 10 < round(error * 10.0 ** (digits + 1)) < 20:
        digits += 1
    if digits > 9 or max(abs(value), error) >= 1e6:
        return f"{value:.4g} +-{error:.1g}"
    decimals = max(digits, 0)
    unsure = error >= 10 and abs(value) < min(error, 999)  # its own digits tell it from its bound
    return (f"{value:.3g}" if unsure else f"{value:.{decimals}f}") + f" +-{error:.{decimals}f}"


def formula(parameters: Sequence[Parameter], integrators: int = 0, time_unit: str = "s") -> str:
    """Write a transfer function in one line, the gain with its standard error and four digits.

    It is in seconds, because the s of Laplace beside another unit reads as seconds.

    Parameters
    ----------
    parameters : sequence of Parameter
        In seconds.
    integrators : int, optional
    time_unit : str, optional
        If it is not the second, the times follow in it: L is the dead time, T1, T2, ... are lags,
        Tw is that of a pair, and Tz are those of zeros.

    Examples
    --------
    >>> from ctrl_realize._parameters import formula
    >>> from ctrl_realize.results import Parameter
    >>> gain = Parameter("gain", 0.8, 0.001, unit="degC/%")
    >>> times = [("dead_time", 44.7), ("lag_1", 179.0), ("lag_2", 41.0)]
    >>> print(formula([gain, *(Parameter(*pair) for pair in times)]))
    0.800 (+-0.001) degC/% e^(-44.7 s) / ((179 s + 1)(41 s + 1))
    >>> print(formula([gain, Parameter("lag_1", 179.0, times=1)], time_unit="min"))
    0.800 (+-0.001) degC/% / (179 s + 1), T1 = 2.983 min
    """
    values = {one.name: one for one in parameters}
    gain = values.get("gain")
    if gain is None:
        return ""
    number, _, error = with_error(gain.value, gain.std).partition(" +-")
    said = (f" (+-{error})" if error else "") + (gain.unit and f" {gain.unit}")
    known = not gain.low <= 0 <= gain.high
    if "." in number and sum(map(str.isdigit, number.lstrip("-0."))) > 4:
        number = f"{gain.value:#.4g}".rstrip(".")
    head = [number + said if known else "K"]
    dead_time = values.get("dead_time")
    if dead_time is not None and dead_time.value > 0:
        head.append(f"e^(-{_short(dead_time)} s)")
    above = _factors(values, "lead", "zero")
    power = "" if not integrators else "s" if integrators == 1 else f"s^{integrators}"
    lags = _factors(values, "lag", "pair")
    text = " ".join([*head, *above])
    if below := f"{power} {''.join(lags)}".strip():
        text += f" / ({below})" if len(lags) + bool(power) > 1 else f" / {below}"
    if not known:
        text += f", gain K not determined: {number}{said}"
    if time_unit != "s":
        for one in parameters:
            letter = _LETTERS.get(one.name.rpartition("_")[0] or one.name)
            if one.times == 1 and letter:
                number = one.name.rpartition("_")[2] if letter.startswith("T") else ""
                text += f", {letter}{number} = {_short(one.in_time_unit(time_unit))} {time_unit}"
    return text


def _factors(values: dict[str, Parameter], real: str, pair: str) -> list[str]:
    factors = [f"({_short(one)} s + 1)" for name, one in values.items() if name.startswith(real)]
    for name, one in values.items():
        damped = values.get(name.replace("_time_", "_damping_"))
        if name.startswith(f"{pair}_time_") and damped is not None:
            damping, T = damped.value, one.value
            factors.append(f"({T**2:.3g} s^2 + {2 * damping * T:.3g} s + 1)".replace("+ -", "- "))
    return factors


def _short(one: Parameter) -> str:
    """Write a value with the digits that its interval leaves, three or four in any case."""
    reach = Z_95 * one.std
    if not np.isfinite(reach) or not reach > 1e-4 * abs(one.value):
        return f"{one.value:.4g}"
    said = number_within(one.value, one.value - reach, one.value + reach)
    if float(said):
        return said
    return f"{one.value:.2g}" if abs(one.value) > 0.01 * reach else "0"


def parameter_table(parameters: Sequence[Parameter]) -> pd.DataFrame:
    """List parameters in a table, one row each."""
    import pandas as pd

    columns = ("value", "std_given_structure", "low", "high", "all_structures", "unit")
    index = pd.Index([one.name for one in parameters], name="parameter")
    rows = [[getattr(one, name) for name in columns] for one in parameters]
    return pd.DataFrame(rows, index=index, columns=list(columns))
