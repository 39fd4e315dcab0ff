"""Parameters that were entered in another controller, as the ideal form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..._checks import one_of, real, rising
from ..._parameters import SECONDS, checked_time_unit
from ...errors import OptionError
from .layouts import LAYOUTS, Layout
from .structures import INF, Ideal, ideal_of_series

PERCENT = (0.0, 100.0)


@dataclass(frozen=True)
class Scaling:
    """Ranges and unit of time that the parameters of a form refer to, as given."""

    measured_range: tuple[float, float] | None = None
    output_range: tuple[float, float] | None = None
    time_unit: str | None = None

    def of(self, form: str) -> tuple[Layout, float, str]:
        """Layout of a form, factor of the gain and unit of time."""
        layout = LAYOUTS[one_of(form, "form", tuple(LAYOUTS))]
        given = self.time_unit
        if given is not None and layout.unit is not None and given != layout.unit:
            raise OptionError(f"time_unit={given!r}; form={form!r} has its times in {layout.unit}")
        unit = checked_time_unit(given or layout.unit or "s")
        measured = _span(self.measured_range, "measured_range")
        output = _span(self.output_range, "output_range")
        scale = {"none": 1.0, "output": 100 / output, "both": measured / output}[layout.percent]
        return layout, scale, unit


def from_form(form: str, values: Mapping[str, float], scaling: Scaling) -> Ideal:
    """Parameters of the ideal form from those of another; see `PIDController.from_form`."""
    layout, scale, unit = scaling.of(form)
    labels = labels_of(layout)
    unknown = sorted(set(values) - {*labels, *layout.weights})
    if unknown or layout.gain not in values:
        raise OptionError(
            f"form={form!r} got {', '.join(map(repr, values)) or 'no values'}; expected "
            f"{layout.gain!r}, and of the others what is in use: {', '.join(labels[1:])}"
        )
    number = {name: real(value, name, "parameter of a PID") for name, value in values.items()}
    gain = number[layout.gain]
    if layout.band:
        if gain == 0:
            raise OptionError(f"{layout.gain}=0; expected a proportional band in percent")
        gain = 100 / gain
    gain /= scale
    seconds = SECONDS[unit]
    if layout.structure == "parallel":
        return _from_parallel(layout, number, gain, scale, seconds)
    integral = number.get(layout.integral, 0.0)  # 0 means none, as in the blocks themselves
    if integral:
        integral = seconds / integral if layout.rate else seconds * integral
    derivative = seconds * number.get(layout.derivative, 0.0)
    tf = _filter(layout, number, derivative, seconds)
    if layout.structure == "ideal" or derivative == 0:
        return gain, integral or INF, derivative, tf
    lead = derivative + tf if layout.added else derivative
    return ideal_of_series(gain, integral or INF, lead, tf)


def _from_parallel(
    layout: Layout, number: Mapping[str, float], gain: float, scale: float, seconds: float
) -> Ideal:
    integral = number.get(layout.integral, 0.0) / scale / seconds
    derivative = number.get(layout.derivative, 0.0) / scale * seconds
    if gain == 0 and (integral or derivative):
        raise OptionError(
            f"{layout.gain}=0; a controller without proportional action has no ideal form"
        )
    td = derivative / gain if derivative else 0.0
    return gain, gain / integral if integral else INF, td, _filter(layout, number, td, seconds)


def _filter(layout: Layout, number: Mapping[str, float], td: float, seconds: float) -> float:
    if layout.filter_kind == "fixed":
        return layout.filter_ratio * td
    given = number.get(layout.filter_label or "", 0.0)
    return given * (seconds if layout.filter_kind == "time" else td)


def _span(given: tuple[float, float] | None, name: str) -> float:
    low, high = PERCENT if given is None else rising(given, name, "ends of the range of a signal")
    return high - low


def labels_of(layout: Layout) -> list[str]:
    """Names of the parameters of a form, the gain first."""
    labels = [layout.gain, layout.integral]
    if layout.derivative_allowed:
        labels.append(layout.derivative)
    return labels + ([layout.filter_label] if layout.filter_label else [])
