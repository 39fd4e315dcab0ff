"""PID parameters in the forms and units of other controllers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._parameters import SECONDS, slope_unit
from ..._wording import in_digits
from ...errors import OptionError
from ...results import Result
from .entered import PERCENT, Scaling, from_form, labels_of
from .layouts import LAYOUTS, Layout
from .structures import INF, Ideal, structured

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class FormValue:
    """One parameter to enter: ``name = value unit``.

    Attributes
    ----------
    name : str
    value : float
    unit : str
        Empty if it has none.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.design.PIDController(0.5, 120.0).as_form("rockwell_pide_dependent").values[1]
    FormValue(name='IGain (Ti)', value=2.0, unit='min')
    """

    name: str
    value: float
    unit: str = ""


@dataclass(frozen=True, repr=False)
class PIDForm(Result):
    """Parameters of a PID controller as another controller asks for them.

    ``PIDController(*form.ideal)`` is the controller that the values give.

    Attributes
    ----------
    form : str
        Name of the form, see `pid_forms`.
    title : str
    values : tuple of FormValue
        What to enter; also by name: ``form["Ti"]``.
    reversed_action : bool
        The gain was negative: the output must rise when the measured value rises (direct acting).
    scaling : Scaling
        Ranges and unit of time of the values: the `measured_range`, `output_range` and `time_unit`
        of `PIDController.as_form`. `PIDController.from_form` takes it, and the direction of action,
        together with the values.
    ideal : tuple of float
        kp, ti, td, tf of the ideal form that the values give. It differs in tf from the controller
        if the filter cannot be set.
    source : str
        Where the form is documented.
    notes : tuple of str
        What differs from the controller.
    choices : tuple of str
        What the values refer to, and the document.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> pid = cr.design.PIDController(2.0, 40.0, 6.0, 0.6)
    >>> print(pid.as_form("siemens_pid_compact").report())
    Siemens S7-1200 and S7-1500, PID_Compact
      Gain         2
      Ti           40 s
      Td           6 s
      TdFiltRatio  0.1
      - output in 0...100, measured value in its unit
      - source: Siemens, S7-1200 system manual A5E02486680 (2012), section 9.2.2 (equation); PID
        control function manual A5E35300227-AC (2017), pages 258 to 261
    """

    form: str
    title: str
    values: tuple[FormValue, ...]
    reversed_action: bool
    scaling: Scaling
    ideal: Ideal
    source: str
    notes: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> float:
        for each in self.values:
            if each.name == name:
                return each.value
        raise KeyError(f"{name!r}; available: {', '.join(each.name for each in self.values)}")

    def table(self) -> pd.DataFrame:
        """One row for each parameter, with value and unit."""
        import pandas as pd

        return pd.DataFrame([vars(each) for each in self.values])

    def _title(self) -> str:
        return self.title

    def _rows(self) -> list[tuple[str, str]]:
        rows = [
            (each.name, f"{in_digits(each.value)} {each.unit}".rstrip()) for each in self.values
        ]
        if self.reversed_action:
            rows.append(("action", "direct: the output rises with the measured value"))
        return rows

    def _notes(self) -> list[str]:
        return list(self.notes)

    def __repr__(self) -> str:
        return f"<PIDForm {self.form}: {', '.join(f'{n} = {v}' for n, v in self._rows())}>"


def pid_forms() -> pd.DataFrame:
    """List the forms in which PID parameters can be written, with the document of each.

    Returns
    -------
    pandas.DataFrame
        Columns ``form``, ``title``, ``structure``, ``parameters``, ``time_unit`` and ``source``. A
        block of which no description was available is not in the list.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.design.pid_forms().query("form == 'emerson_deltav_series'")["parameters"].item()
    'GAIN, RESET, RATE, ALPHA'
    """
    import pandas as pd

    return pd.DataFrame(
        [
            {
                "form": form,
                "title": layout.title,
                "structure": layout.structure,
                "parameters": ", ".join([*labels_of(layout), *layout.weights]),
                "time_unit": layout.unit or "chosen",
                "source": layout.source,
            }
            for form, layout in LAYOUTS.items()
        ]
    )


def to_form(
    ideal: Ideal,
    form: str,
    scaling: Scaling,
    *,
    gain_unit: str = "",
    weights: tuple[float, float] | None = None,
) -> PIDForm:
    """Write the parameters of the ideal form in another form; see `PIDController.as_form`."""
    layout, scale, unit = scaling.of(form)
    *_, td, tf = ideal
    if td and not layout.derivative_allowed:
        raise OptionError(
            f"form={form!r} is known for P and PI only, since no description of its derivative "
            f"was available; got td={td:g} s. Tune a PI controller: design.pid(sys, kind='PI')"
        )
    whole = scaling.output_range is None
    physical = layout.percent == "none" or (layout.percent == "output" and whole)
    shown = _shown(ideal, layout, scale, unit, gain_unit if physical else "")
    typed = from_form(form, {each.name: each.value for each in shown}, scaling)
    reverse = ideal[0] < 0 and not layout.signed
    if reverse:
        typed = (-typed[0], *typed[1:])
    if layout.filter_kind == "none" and td:
        typed = (*typed[:3], tf)
    if weights is not None and layout.weights:
        shown += map(FormValue, layout.weights, weights)
    return PIDForm(
        form,
        layout.title,
        tuple(shown),
        reverse,
        scaling,
        typed,
        layout.source,
        _notes(layout, ideal, typed, weights),
        (*_ranges(layout, scaling), f"source: {layout.source}"),
    )


def _shown(
    ideal: Ideal, layout: Layout, scale: float, unit: str, gain_unit: str
) -> list[FormValue]:
    """Parameters in the units of a form; without sign if the form has none."""
    gain, integral, derivative, tf = structured(ideal, layout)
    if not layout.signed:
        scale *= np.sign(gain)
    seconds = SECONDS[unit]
    parallel = layout.structure == "parallel"
    gain *= scale
    shown = [FormValue(layout.gain, 100 / gain, "%") if layout.band else
             FormValue(layout.gain, gain, gain_unit)]  # fmt: skip
    if ideal[1] < INF:
        value, name = integral / seconds, unit
        if parallel:
            value, name = integral * scale * seconds, slope_unit(gain_unit, unit)
        elif layout.rate:
            value, name = seconds / integral, f"repeats/{unit}"
        shown.append(FormValue(layout.integral, value, name))
    if ideal[2]:
        size, name = (scale, f"{unit} {gain_unit}".rstrip()) if parallel else (1.0, unit)
        shown.append(FormValue(layout.derivative, derivative * size / seconds, name))
        if layout.filter_kind == "time":
            shown.append(FormValue(str(layout.filter_label), tf / seconds, unit))
        elif layout.filter_kind == "ratio":
            shown.append(FormValue(str(layout.filter_label), tf / derivative))
    return shown


def _notes(
    layout: Layout, ideal: Ideal, typed: Ideal, weights: tuple[float, float] | None
) -> tuple[str, ...]:
    """What differs between the controller and what the values give."""
    notes = []
    if ideal[2] and layout.filter_kind == "none":
        notes.append(f"the derivative filter, tf = {ideal[3]:.4g} s, cannot be entered")
    elif ideal[2] and not np.isclose(ideal[3], typed[3], rtol=1e-6):
        notes.append(
            f"the filter of the block is fixed: tf = {typed[3]:.4g} s instead of {ideal[3]:.4g} s"
        )
    if weights is not None and not layout.weights:
        notes.append("set-point weights are no parameters of this form")
    return tuple(notes)


def _ranges(layout: Layout, scaling: Scaling) -> list[str]:
    """Ranges that the gain refers to."""
    low, high = scaling.output_range or PERCENT
    if layout.percent == "both":
        bottom, top = scaling.measured_range or PERCENT
        return [
            f"gain in percent of range: measured value {bottom:g}...{top:g}, output "
            f"{low:g}...{high:g}"
        ]
    if layout.percent == "output":
        return [f"output in {low:g}...{high:g}, measured value in its unit"]
    return []
