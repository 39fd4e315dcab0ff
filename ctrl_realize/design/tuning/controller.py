"""PID controllers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..._checks import not_negative, one_of, positive, real, system_name
from ..._parameters import SECONDS, checked_time_unit, slope_unit
from ..._shown import Card, ShownSystem
from ..._wording import in_time, times_in
from ...data.shown_units import in_shown_units
from ...delayed.operators import BesideDelays
from ...errors import OptionError
from ...numerics.arrays import FloatArray
from ..loops.loop_check import LoopCheck
from ..models.process_model import ProcessModel
from .algorithm import DISCRETIZATIONS, INF, SHARES, PIDAlgorithm
from .entered import Scaling, from_form
from .forms import PIDForm, to_form
from .layouts import LAYOUTS

if TYPE_CHECKING:
    import pandas as pd


class PIDController(ShownSystem, BesideDelays):
    """PID controller in ideal form, continuous or discrete; a `control.StateSpace`.

    Continuous: ``kp (1 + 1/(ti s) + td s / (tf s + 1))`` from error to plant input. Discrete: the
    integral by `method`, the derivative by backward differences, which do not ring.

    Parameters
    ----------
    kp : float
        Gain.
    ti : float
        Integral time in s; inf for no integral.
    td : float
        Derivative time in s; 0 for no derivative.
    tf : float
        Time constant of the derivative filter in s; > 0 if there is a derivative.
    dt : float
        Sample time in s; 0 for a continuous controller.
    method : {"tustin", "forward", "backward"}
        Discretization of the integral.
    rule : str
        Tuning rule.
    model : ProcessModel, optional
        Process model used by the rule.
    name : str, optional
    check : LoopCheck, optional
        Check of the closed loop with the model that the controller was tuned for.
    gain_unit : str, optional
        Unit of `kp`, such as ``"%/degC"``; `pid` takes it from the record of the model.
    time_unit : {"s", "ms", "min", "h", "day"}, optional
        Unit in which times are shown; the attributes are in s.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> pi = cr.design.PIDController(0.5, 0.2, dt=0.001)
    >>> pi
    <PIDController 'PI': kp = 0.5, ti = 0.2 s, dt = 0.001 s>
    >>> pi.kind, pi.nstates
    ('PI', 1)
    >>> print(pi)
    PID controller PI
      type          PI
      rule          given
      gain kp       0.5
      integral ti   200 ms
      gains         kp = 0.5, ki = kp / ti = 2.5 1/s
      sample time   1 ms, tustin rule
      next          pid.as_form("siemens_pid_compact"); pid.forms() lists all
    """

    def __init__(
        self,
        kp: float,
        ti: float = INF,
        td: float = 0.0,
        tf: float = 0.0,
        *,
        dt: float = 0.0,
        method: str = "tustin",
        rule: str = "given",
        model: ProcessModel | None = None,
        name: str | None = None,
        check: LoopCheck | None = None,
        gain_unit: str = "",
        time_unit: str = "s",
    ) -> None:
        self.kp = real(kp, "kp", "gain")
        self.ti = INF if ti == INF else positive(ti, "ti", "integral time in s")
        self.td = real(td, "td", "derivative time in s")
        self.tf = real(tf, "tf", "time constant of the derivative filter in s")
        self.method = one_of(method, "method", DISCRETIZATIONS)
        self.rule = rule
        self.model = model
        self.check = check
        self.gain_unit = gain_unit
        self.time_unit = checked_time_unit(time_unit)
        if self.td < 0 or self.tf < 0 or (self.td > 0 and self.tf == 0):
            raise OptionError(
                f"td={self.td:g} s, tf={self.tf:g} s; expected td >= 0 and, with a "
                "derivative, tf > 0 (td/10 is usual)"
            )
        step = not_negative(dt, "dt", "sample time in s, 0 for continuous")
        self.kind = "P" + "I" * (self.ti < INF) + "D" * (self.td > 0)
        own = self.kind if rule == "given" else f"{self.kind}_{rule}"
        super().__init__(
            *self._matrices(step),
            step,
            name=system_name(own if name is None else name),
            inputs=["e"],
            outputs=["u"],
            remove_useless_states=False,
        )

    def _matrices(self, h: float) -> tuple[FloatArray, ...]:
        actions = {"I": self._integral, "D": self._derivative}
        parts = [action(h) for letter, action in actions.items() if letter in self.kind]
        a, b, c, d = np.array(parts).reshape(-1, 4).T
        return np.diag(a), b[:, None], c[None, :], np.array([[sum(d, self.kp)]])

    def _integral(self, h: float) -> tuple[float, float, float, float]:
        if h == 0:
            return 0.0, 1.0, self.kp / self.ti, 0.0
        share = self.kp * h / self.ti
        return 1.0, 1.0, share, share * SHARES[self.method]

    def _derivative(self, h: float) -> tuple[float, float, float, float]:
        if h == 0:
            slope = self.kp * self.td / self.tf
            return -1 / self.tf, 1 / self.tf, -slope, slope
        pole = self.tf / (self.tf + h)
        slope = self.kp * self.td / (self.tf + h)
        return pole, 1.0, slope * (pole - 1), slope

    def discretised(self, dt: float, method: str | None = None) -> PIDController:
        """Discretize the controller (or change its sample time) with `dt` in s."""
        positive(dt, "dt", "sample time in s")
        # The loop check is valid for one sample time only.
        return self._again(dt=dt, method=method or self.method, check=None)

    @property
    def continuous(self) -> PIDController:
        """The same controller in continuous time."""
        return self._again(dt=0.0, check=None)

    def checked(self, check: LoopCheck) -> PIDController:
        """The same controller with a loop check."""
        return self._again(check=check)

    def report(self) -> str:
        """List the parameters and the loop check as plain text."""
        return self._card().text()

    def _again(self, **changes: Any) -> PIDController:
        settings = {**self._settings(), **changes}
        return PIDController(self.kp, self.ti, self.td, self.tf, **settings)

    def _settings(self) -> dict[str, Any]:
        """All arguments of the constructor beside the four parameters."""
        names = ("dt", "method", "rule", "model", "name", "check", "gain_unit", "time_unit")
        return {name: getattr(self, name) for name in names}

    def _made_by(self) -> tuple[Any, ...]:
        return PIDController, self.ideal, self._settings()

    def _repr_eval_(self) -> str:
        parameters = ", ".join(
            f"float('{value!r}')" if np.isinf(value) else repr(value)
            for value in (self.kp, self.ti, self.td, self.tf)
        )
        # Without process model and loop check.
        settings = self._settings()
        words = ", ".join(f"{key}={settings[key]!r}" for key in ("dt", "method", "rule", "name"))
        return f"PIDController({parameters}, {words})"

    def _line(self) -> str:
        words = [f"kp = {self.kp:.4g}"]
        if "I" in self.kind:
            words.append(f"ti = {self.ti:.4g} s")
        if "D" in self.kind:
            words.append(f"td = {self.td:.4g} s, tf = {self.tf:.4g} s")
        words.append(f"dt = {self.dt:.4g} s" if self.dt else "continuous")
        return f"<PIDController {self.name!r}: {', '.join(words)}>"

    def __str__(self) -> str:
        # python-control shows only matrices, in which the parameters are not visible.
        return self.report()

    def _gains(self) -> str:
        """The gains of the parallel form, ``kp + ki / s + kd s / (tf s + 1)``."""
        unit, seconds = self.time_unit, SECONDS[self.time_unit]
        gains = [f"kp = {self.kp:.4g} {self.gain_unit}".rstrip()]
        if "I" in self.kind:
            ki = self.kp / self.ti * seconds
            gains.append(f"ki = kp / ti = {ki:.4g} {slope_unit(self.gain_unit, unit)}")
        if "D" in self.kind:
            kd = self.kp * self.td / seconds
            gains.append(f"kd = kp td = {kd:.4g} {unit} {self.gain_unit}".rstrip())
        return ", ".join(gains)

    @in_shown_units
    def _card(self) -> Card:
        gain = f"{self.kp:.4g} {self.gain_unit}".rstrip()
        rows = [("type", self.kind), ("rule", self.rule), ("gain kp", gain)]
        if "I" in self.kind:
            rows.append(("integral ti", in_time(self.ti, 4)))
        if "D" in self.kind:
            rows.append(("derivative td", in_time(self.td, 4)))
            rows.append(("its filter tf", in_time(self.tf, 4)))
        if self.kind != "P":
            rows.append(("gains", self._gains()))
        with times_in("s"):  # cycle times are set in s or ms
            step = f"{in_time(self.dt, 6)}, {self.method} rule" if self.dt else "none: continuous"
        rows.append(("sample time", step))
        flags = []
        if self.check is not None:
            rows += self.check._rows()
            flags = [str(flag) for flag in self.check.flags]
        rows.append(("next", 'pid.as_form("siemens_pid_compact"); pid.forms() lists all'))
        return Card(f"PID controller {self.name}", rows, flags=flags)

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
        form = one_of(form, "form", tuple(LAYOUTS))
        if time_unit is None and LAYOUTS[form].unit is None:
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
        values: Mapping[str, float] | PIDForm,
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
        values : mapping of str to float, or PIDForm
            Parameter -> value, with the names that `as_form` lists; or what it returns, with its
            ranges and unit of time where no others are given.
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
        if isinstance(values, PIDForm):
            reversed_action = reversed_action or values.reversed_action
            given = {name: one for name, one in vars(scaling).items() if one is not None}
            scaling = replace(values.scaling, **given)
            values = {one.name: one.value for one in values.values}
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
            *self.ideal, self.dt, self.method, setpoint_weight, derivative_weight, output_limits,
            tracking_time, bias, str(self.name), self.gain_unit, self.time_unit,
        )  # fmt: skip
