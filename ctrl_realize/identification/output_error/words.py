"""Texts about an output-error fit for cards, flags and reports."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..._flags import Flag, marked
from ..._wording import in_time, interval_in_time, numbers_alike, only_end, time_within
from ...numerics.arrays import FloatArray
from ...numerics.constants import SMALLEST
from ...numerics.engine.problem import Structure
from ...numerics.families.equal_lags import LagChain
from ...numerics.families.flow import DispersedFlow
from ...numerics.families.process_form import ProcessForm
from ...numerics.output_error.result import OutputErrorEstimate, RobustKey, StructureFit

ESTIMATE_WORDS: dict[RobustKey, str] = {
    "onset": "visible onset",
    "one_lag_early": "first-order model of the first 15 %",
    "two_lags_early": "second-order model of the first 15 %",
    "three_lags_early": "third-order model of the first 15 %",
    "model_of_rise": "best model of the first 63 %",
    "model_of_record": "best model of the whole record",
}

FAR_APART = 0.5  # width of an interval, in dead times, from which it is wide
_FIRM = 0.1  # relative half width of the interval of a total delay that is called well determined


class Stated(NamedTuple):
    """Fastest lag in s, and range of the dead time in s, as stated by the user."""

    fastest_lag: float | None = None
    dead_time: tuple[float, float] | None = None

    def in_words(self) -> str:
        """What was stated, for a card."""
        said = []
        if self.fastest_lag is not None:
            said.append(f"no lag is faster than {in_time(self.fastest_lag)}")
        if self.dead_time is not None:
            said.append(f"it is within {interval_in_time(*self.dead_time)}")
        return f"if {' and '.join(said)} (stated)"


def model_words(model: LagChain | DispersedFlow) -> str:
    """Name a model other than the structures."""
    if isinstance(model, DispersedFlow):
        return "axial-dispersion model"
    if model.truncated:
        return "diffusion model"
    return f"model of {model.candidate.structure.order} nearly equal lags"


def form_words(form: ProcessForm) -> str:
    """Name a process model with what was prescribed."""
    said = [f"{name} fixed at {value:.4g}" for name, value in form.fixed.items()]
    said += [f"{name} in {low:.4g}...{high:.4g}" for name, (low, high) in form.bounds.items()]
    return form.name + (f" with {', '.join(said)}" if said else "")


def order_words(structure: Structure | StructureFit) -> str:
    """Name a structure by its numbers of poles and zeros."""
    return f"order {structure.order}, relative degree {structure.relative_degree}"


def structure_words(fit: OutputErrorEstimate) -> str:
    """Name the structure of a model, or the process model that was prescribed."""
    plain = order_words(fit.structure)
    return plain if fit.process.form is None else f"{form_words(fit.process.form)} ({plain})"


def total_in_words(total: float, interval: tuple[float, float], flags: Iterable[Flag]) -> str:
    """Write a total delay with its interval, and whether it is well determined."""
    low, high = interval
    doubted = any(flag.code in marked("total_in_doubt") for flag in flags)
    if high == np.inf:
        why = ": the record is much shorter than the slowest time constant"
        return "not determined" + why * (not doubted)
    if np.isnan(high):
        return f"{in_time(total, 5)} (dead time plus lags)"
    if low < 0 < high:  # of a ratio with the gain, as beside a slow mode of the other sign
        return f"not determined ({interval_in_time(low, high)})"
    firm = "well determined, " if not doubted and is_firm(total, interval) else ""
    said = f"dead time plus lags; {firm}{interval_in_time(low, high)}"
    return f"{time_within(total, low, high)} ({said})"


def is_firm(value: float, interval: tuple[float, float]) -> bool:
    """Whether the ends of an interval are within a tenth of the estimate."""
    low, high = interval
    return bool(max(high - value, value - low) <= _FIRM * abs(value))


def sign_is_told(interval: tuple[float, float] | None) -> bool:
    """Whether the interval of a gain, if there is one, excludes zero."""
    return interval is not None and (interval[0] > 0 or interval[1] < 0)


def gain_in_words(gain: float, interval: tuple[float, float]) -> str:
    """Write a gain with its interval, or that it is not determined."""
    low, high = interval
    if said := only_end(low, high):
        return f"{said}, the rest is extrapolated (gain of the model: {gain:.4g})"
    if np.isinf(low):
        return f"not determined by this record (gain of the model: {gain:.4g})"
    if np.isnan(low):
        return f"{gain:.6g}"
    number, *ends = numbers_alike((gain, low, high), low, high)
    return f"{number} ({ends[0]} to {ends[1]})"


def gain_scatter(gains: FloatArray) -> list[tuple[str, str]]:
    """State the spread of the gains of several records."""
    told = gains[np.isfinite(gains)]
    if told.size < 2:
        return []
    low, high = float(told.min()), float(told.max())
    share = 100 * float(np.std(told, ddof=1)) / max(abs(float(np.mean(told))), SMALLEST)
    ends = " to ".join(numbers_alike((low, high), low, high))
    return [("gains of the records", f"{ends} (std {share:.2g} %)")]
