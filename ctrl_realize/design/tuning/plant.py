"""The plant of a tuning rule: sampled, in the time base of the controller, and reduced."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, cached_property
from typing import Any

from ..._parameters import gain_unit
from ...delayed import DelayedStateSpace, DelaySystem, delay
from ...delayed.operands import in_state_space
from ...errors import OptionError
from ..models.conversions import to_discrete
from ..models.process_model import ProcessModel
from ..models.reduction import both_forms, reduce_fopdt, reduce_sopdt
from ..resolved import check_sign, warn_unresolved
from ..siso import core_and_dead_time, delayed_system, is_continuous

FINE = 50
"""Samples within a dead time, or a turn of the loop by 1 rad, so many that a hold has no effect."""


class TuningPlant:
    """A plant as tuning rules need it: sampled, in the time base of the controller, and reduced.

    `sampled` and `exact` are those of `reference_plant`, `step` is the sample time.
    """

    def __init__(self, system: Any, dt: float | None) -> None:
        self.system = system
        self.sampled, self.exact, self.step = reference_plant(system, dt)
        self.reduced = cache(self._reduced)

    def _reduced(self, second: bool, method: str) -> ProcessModel:
        """Reduce it to one lag or two, with the dead time of the hold."""
        system = self.system
        model = isinstance(system, ProcessModel)
        if model and bool(system.lag) + bool(system.second_lag) + system.integrating <= 1 + second:
            found: ProcessModel = system
        else:
            given = system if model or is_continuous(system) else self.sampled
            found = (reduce_sopdt if second else reduce_fopdt)(given, method=method)
        # A held controller output is half a sample old on average.
        return replace(found, dead_time=found.dead_time + self.step / 2)

    @cached_property
    def total_time(self) -> float:
        """Dead time and lags together, in s."""
        if isinstance(self.system, ProcessModel):
            return self.system.total_time
        return reduce_sopdt(self.sampled).total_time + float(self.sampled.dt)


def reference_plant(
    system: Any, dt: float | None, purpose: str = "a PID controller"
) -> tuple[DelayedStateSpace, DelayedStateSpace | DelaySystem, float]:
    """Discrete plant, the plant in the time base of the controller, and its sample time.

    A continuous controller, with a sample time of 0, is tuned on a plant sampled so fast that it
    has no effect.
    """
    if isinstance(system, ProcessModel):
        system = DelaySystem(in_state_space(system.transfer_function())) * delay(system.dead_time)
    if is_continuous(system):
        core, dead_time = core_and_dead_time(system, purpose)
        if dt is not None:
            plant = to_discrete(core, dead_time, dt)
            return plant, plant, float(plant.dt)
        exact = system if isinstance(system, DelaySystem) else DelaySystem(core)
        return finely_sampled(exact, dead_time), exact, 0.0
    plant = delayed_system(system, purpose)
    check_sign(plant, purpose)
    warn_unresolved(plant)
    if dt is not None:
        raise OptionError(
            f"dt={dt:g} is an argument for process models and continuous systems; the controller "
            f"of a sampled system has its sample time, {plant.dt:g} s"
        )
    return plant, plant, float(plant.dt)


def finely_sampled(exact: DelaySystem, time: float) -> DelayedStateSpace:
    """Sample a continuous plant so fast that a hold has no effect within `time`, if it is not 0."""
    return both_forms(exact, longest=time / FINE or float("inf"))[1]


def turned_feedthrough(exact: Any) -> float:
    """|D| of a continuous plant with dead time, 0 without: its loops have that gain at infinity."""
    core, dead_time = core_and_dead_time(exact, "a PID controller")
    return abs(float(core.D[0, 0])) if dead_time else 0.0


def gain_and_time_units(plant: DelayedStateSpace) -> tuple[str, str]:
    """Units of a controller gain and of shown times, from the first record of a fitted plant."""
    fit = plant.fit
    gain = "" if fit is None else gain_unit(fit.input_unit, fit.output_unit)
    return gain, plant.time_unit
