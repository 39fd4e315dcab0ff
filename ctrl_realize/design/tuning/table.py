"""Comparison of tuning rules on one plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..._checks import each_of
from ..._wording import in_time
from ...data.shown_units import unit_among
from ...errors import OptionError
from ...numerics.blas_threads import single_threaded
from ...results import Flag, Result
from ..loops.loop_check import LoopCheck, loop_check, warn_of
from ..loops.margin_result import Margins
from ..loops.performance import Performance, plant_time, sampled_performance, settled_responses
from .controller import PIDController
from .pid import KINDS, RULES, TuningOptions, tuned
from .plant import TuningPlant, finely_sampled
from .rules import kinds_of

if TYPE_CHECKING:
    import pandas as pd

UNSTABLE = Performance(float("inf"), float("inf"), float("nan"), float("inf"))
"""Performance of a loop that does not settle."""


@dataclass(frozen=True, eq=False, repr=False)
class PIDComparison(Result):
    """Controllers of several rules for one plant, with margins and performance.

    ``margins[i]`` and ``performance[i]`` belong to ``controllers[i]``.

    Attributes
    ----------
    controllers : tuple of PIDController
    margins : tuple of Margins
    performance : tuple of Performance
        inf if the loop is unstable.
    refused : tuple of (str, str, str)
        Rule, kind and reason if a rule does not apply to this plant.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> found = cr.design.compare_pid(plant, ["simc", "amigo"], ["PI"])
    >>> print(found.table()[["rule", "kp", "ti", "ms", "iae_load"]].round(3).to_string(index=False))
     rule    kp   ti    ms  iae_load
     simc 1.356 0.08 1.591     0.059
    amigo 0.565 0.07 1.222     0.125
    """

    controllers: tuple[PIDController, ...]
    performance: tuple[Performance, ...]
    refused: tuple[tuple[str, str, str], ...] = ()

    @property
    def margins(self) -> tuple[Margins, ...]:
        """Margins of the loops."""
        return tuple(c.check.margins for c in self.controllers if c.check is not None)

    @property
    def time_unit(self) -> str:
        """Unit in which cards and plots write times, that of the plant."""
        return unit_among(*self.controllers)

    def table(self) -> pd.DataFrame:
        """One row for each controller; times in s, phase margin in degrees."""
        import pandas as pd

        parts: list[tuple[tuple[Any, ...], tuple[str, ...]]] = [
            (self.controllers, ("rule", "kind", "kp", "ti", "td")),
            (self.margins, ("stable", "gain_margin", "phase_margin", "ms", "delay_margin")),
            (self.performance, ("setpoint_error", "load_error", "overshoot", "settling_time")),
        ]
        columns = {name: [getattr(one, name) for one in each]
                   for each, names in parts for name in names}  # fmt: skip
        errors = {"setpoint_error": "iae_setpoint", "load_error": "iae_load"}
        return pd.DataFrame(columns).rename(columns=errors)

    def best(self, max_sensitivity: float = 2.0) -> PIDController:
        """Controller with the smallest load error among the stable ones with Ms within the limit.

        If the system has intervals of dead time and gain, the loop must be stable over all of them,
        and those whose Ms is at most 2 there come first.

        Warns
        -----
        ModelWarning
            None of them is robust with all that the record leaves open, see `pid`.
        """
        fit = [
            (len(self._flags(i)), p.load_error, i)
            for i, (m, p) in enumerate(zip(self.margins, self.performance, strict=True))
            if m.stable and m.ms <= max_sensitivity and not self._unsafe(i)
        ]
        if not fit:
            unsafe = sum(map(self._unsafe, range(len(self.controllers))))
            raise OptionError(
                f"no controller has Ms <= {max_sensitivity:g}; the smallest is "
                f"{min((m.ms for m in self.margins if m.stable), default=float('inf')):.3g}"
                + (f"; {unsafe} are unstable within the interval of the dead time" * bool(unsafe))
            )
        best = self.controllers[min(fit)[2]]
        if best.check is not None:
            warn_of(best.check, "It is the best of the table; design.pid(sys) names a slower one")
        return best

    def _flags(self, i: int) -> tuple[Flag, ...]:
        check = self.controllers[i].check
        return () if check is None else check.flags

    def _unsafe(self, i: int) -> bool:
        """Whether a controller is unstable somewhere within the intervals."""
        return any(flag.code == "unstable_within_interval" for flag in self._flags(i))

    _heading = "PID rules"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for c, m, p in zip(self.controllers, self.margins, self.performance, strict=True):
            load, setpoint = in_time(p.load_error), in_time(p.setpoint_error)
            told = (
                f"Ms {m.ms:.3g}, phase {m.phase_margin:.3g} deg, IAE load {load}, "
                f"set-point {setpoint}, overshoot {100 * p.overshoot:.3g} %"
            )
            rows.append((f"{c.kind} {c.rule}", told if m.stable else "UNSTABLE"))
        return rows

    def _notes(self) -> list[str]:
        refused = [f"{kind} {rule}: {reason}" for rule, kind, reason in self.refused]
        unsafe = [
            f"{c.kind} {c.rule}: {flag}"
            for i, c in enumerate(self.controllers)
            for flag in self._flags(i)
            if flag.code != "sensitive"  # Ms is in the row
        ]
        return unsafe + refused

    def __repr__(self) -> str:
        stable = sum(m.stable for m in self.margins)
        return f"<PIDComparison: {len(self.controllers)} controllers, {stable} stable>"


@single_threaded
def compare_pid(
    system: Any,
    rules: str | Sequence[str] | None = None,
    kinds: str | Sequence[str] = ("PI", "PID"),
    **options: Any,
) -> PIDComparison:
    """Tune by several rules and compare margins and step responses on the plant itself.

    Parameters
    ----------
    system : DelayedStateSpace, DelaySystem or ProcessModel
        See `pid`. For the responses of a continuous plant and controller both are sampled finely
        (1000 samples per total time, 50 while the loop turns by 1 rad at its crossover).
    rules : str or sequence of str, optional
        All by default.
    kinds : str or sequence of str, optional
    **options
        Further arguments of `pid`.

    Returns
    -------
    PIDComparison

    Notes
    -----
    For the sources of the rules see `pid`; the default limit on the sensitivity of the best is the
    usual one [1]_.

    References
    ----------
    .. [1] K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 4 (Controller
       design).

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> found = cr.design.compare_pid(valve, ["simc", "amigo", "optimal"], ["PI"])
    >>> found
    <PIDComparison: 3 controllers, 3 stable>
    >>> found.best(max_sensitivity=1.5).rule
    'optimal'
    """
    tried, kinds = each_of(rules or RULES, "rule", RULES), each_of(kinds, "kind", KINDS)
    plant = TuningPlant(system, options.get("dt"))  # what no rule can tune is refused at once
    made: list[tuple[PIDController, Performance]] = []
    refused: list[tuple[str, str, str]] = []
    for rule in tried:
        for kind in kinds:
            if kind not in kinds_of(rule):
                continue
            try:
                controller = tuned(plant, TuningOptions(rule, kind, **options))
            except ValueError as error:
                # A rule that does not apply to this plant becomes a row of the result.
                refused.append((rule, kind, str(error)))
                continue
            if controller.kind != kind and controller.kind in kinds:
                refused.append((rule, kind, f"for this plant it is the {controller.kind}"))
                continue
            check = loop_check(plant.exact, controller)
            reached = _performance(plant.exact, controller, check) if check.stable else UNSTABLE
            made.append((controller.checked(check), reached))
    if not made:
        reasons = "; ".join(f"{kind} {rule}: {why}" for rule, kind, why in refused)
        raise OptionError(f"no rule could tune this plant: {reasons or 'none has these kinds'}")
    controllers, performance = zip(*made, strict=True)
    return PIDComparison(controllers, performance, tuple(refused))


def _performance(plant: Any, controller: PIDController, check: LoopCheck) -> Performance:
    """Performance of a stable loop; one in continuous time is sampled finely."""
    crossovers = check.margins.gain_crossovers
    if not controller.dt:
        plant = finely_sampled(plant, 1 / float(crossovers[-1]) if crossovers.size else 0.0)
        controller = controller.discretised(plant.dt)
    setpoint, load, _ = settled_responses(plant, controller, plant_time(plant))
    return sampled_performance(setpoint, load, float(plant.dt))
