"""What leaves the office: a PID controller in the forms of others, and as an algorithm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

from ..._checks import positive
from ...errors import OptionError
from .algorithm import INF, PIDAlgorithm
from .entered import Scaling, from_form
from .forms import PIDForm, to_form
from .layouts import LAYOUTS

if TYPE_CHECKING:
    import pandas as pd


class Delivered:
    """Part of `PIDController`: parameters for other controllers, and the algorithm."""

    if TYPE_CHECKING:
        name: str
        dt: float
        method: str
        kp: float
        ti: float
        td: float
        tf: float
        gain_unit: str
        time_unit: str

        def __init__(self, *parameters: Any, **settings: Any) -> None: ...

    @property
    def ideal(self) -> tuple[float, float, float, float]:
        """The parameters kp, ti, td, tf of the ideal form; times in s."""
        return self.kp, self.ti, self.td, self.tf

    def as_form(
        self,
        form: str = "ideal",
        *,
        measured_range: tuple[float, float] | None = None,
        output_range: tuple[float, float] | None = None,
        time_unit: str | None = None,
        setpoint_weight: float | None = None,
        derivative_weight: float = 0.0,
    ) -> PIDForm:
        """Write the parameters as another controller asks for them.

        Parameters
        ----------
        form : str
            ``"ideal"``, ``"series"``, ``"parallel"``, ``"proportional_band"``, or the block of a
            manufacturer; `design.pid_forms` lists them with their documents.
        measured_range : tuple of float, optional
            Lower and upper end of the range of the measured value, for forms whose gain refers to
            percent of it; default: 0 and 100.
        output_range : tuple of float, optional
            The same of the controller output; default: 0 and 100.
        time_unit : {"s", "ms", "min", "h", "day"}, optional
            For forms without a unit of their own. Default: that of the controller.
        setpoint_weight : float, optional
            Weight of the set-point in the proportional action, for blocks that have one.
        derivative_weight : float, optional
            Weight of the set-point in the derivative action, for blocks that have one.

        Returns
        -------
        PIDForm

        Raises
        ------
        OptionError
            An unknown form; or a series form of a controller with complex zeros.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> pid = cr.design.PIDController(0.5, 120.0)  # in %/degC
        >>> print(pid.as_form("honeywell_hc900", measured_range=(0, 400)).report())
        Honeywell HC900, PID block (P and PI)
          Prop Band  50 %
          Reset      0.5 repeats/min
          - gain in percent of range: measured value 0...400, output 0...100
          - source: Honeywell, HC900 Hybrid Control Designer Function Block Reference Guide,
            revision 11 (2007), page 281
        """
        if time_unit is None and form in LAYOUTS and LAYOUTS[form].unit is None:
            time_unit = self.time_unit
        scaling = Scaling(measured_range, output_range, time_unit)
        proportional = 1.0 if setpoint_weight is None and derivative_weight else setpoint_weight
        weights = None if proportional is None else (proportional, derivative_weight)
        return to_form(self.ideal, form, scaling, gain_unit=self.gain_unit, weights=weights)

    def forms(self, **ranges: Any) -> pd.DataFrame:
        """List what to enter in each form: one row for each; arguments as for `as_form`.

        Forms in which the controller cannot be written say why.
        """
        import pandas as pd

        rows = []
        for form, layout in LAYOUTS.items():
            settings = dict(ranges)
            if layout.unit is not None:
                settings.pop("time_unit", None)
            try:
                written = self.as_form(form, **settings)
                enter = ", ".join(f"{name} = {value}" for name, value in written._rows())
            except OptionError as error:
                enter = str(error)
            rows.append({"form": form, "enter": enter, "title": layout.title})
        return pd.DataFrame(rows)

    @classmethod
    def from_form(
        cls,
        form: str,
        values: Mapping[str, float],
        *,
        measured_range: tuple[float, float] | None = None,
        output_range: tuple[float, float] | None = None,
        time_unit: str | None = None,
        derivative_filter: float = 10.0,
        reversed_action: bool = False,
        **settings: Any,
    ) -> Self:
        """Make the controller that the entered values of another controller give.

        Parameters
        ----------
        form, measured_range, output_range, time_unit
            As for `as_form`.
        values : mapping of str to float
            Parameter -> value, with the names that `as_form` lists.
        derivative_filter : float
            td / tf if the form has no filter.
        reversed_action : bool
            The block is direct acting: the values are those of a negative gain, entered without
            sign, as `PIDForm.reversed_action` tells.
        **settings
            Further arguments of `PIDController`: `dt`, `name`.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> values = {"PGain (Kc)": 2.0, "IGain (Ti)": 1.5}
        >>> cr.design.PIDController.from_form("rockwell_pide_dependent", values)
        <PIDController 'PI': kp = 2, ti = 90 s, continuous>
        """
        scaling = Scaling(measured_range, output_range, time_unit)
        kp, ti, td, tf = from_form(form, values, scaling)
        ratio = positive(derivative_filter, "derivative_filter", "td / tf")
        return cls(-kp if reversed_action else kp, ti, td, tf or td / ratio, **settings)

    def algorithm(
        self,
        *,
        setpoint_weight: float = 1.0,
        derivative_weight: float = 0.0,
        output_limits: tuple[float, float] = (-INF, INF),
        tracking_time: float | None = None,
        bias: float = 0.0,
    ) -> PIDAlgorithm:
        """Return the algorithm with weights, limits and anti-windup, for simulation and code.

        The arguments are those of `PIDAlgorithm`; the controller must be discrete.

        Raises
        ------
        OptionError
            A continuous controller.
        """
        if not self.dt:
            raise OptionError(
                f"{self.name!r} is continuous; expected a discrete controller: "
                ".discretised(dt), with dt the cycle time of the controller in s"
            )
        return PIDAlgorithm(
            *self.ideal,
            self.dt,
            self.method,
            setpoint_weight,
            derivative_weight,
            output_limits,
            tracking_time,
            bias,
            str(self.name),
        )
