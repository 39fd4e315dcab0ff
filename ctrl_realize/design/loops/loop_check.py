"""Check of the closed loop before a design function returns a controller.

The loop is closed with the model itself, not with a reduced one, and with the models that the data
of an output-error fit do not rule out; for other fits, over the intervals of dead time and gain
from the identification.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import in_time, interval_in_time
from ...data.shown_units import in_shown_units
from ...delayed import DelayedStateSpace
from ...errors import ModelWarning, UnsuitableSystemError, warn_caller
from ...identification.plausible import PlausibleModels
from ...numerics.arrays import ComplexArray
from ...results import ModelFit, Result
from ..siso import interval_of_dead_time
from .delay_robustness import over_interval
from .delay_robustness_result import DelayRobustness
from .factors import factor
from .loop import Loop, open_loop
from .margin_result import Margins
from .margins import distance_if_stable, loop_margins

TRIED = 2
"""Delays of the interval whose margins are computed: its ends. Stability between them follows from
the crossovers, see `DelayRobustness`."""

MOST_SENSITIVE = 2.0
"""Largest Ms without a warning: gain and phase margin are then at least 2 and 29 deg (Astrom and
Hagglund, Advanced PID Control, 2006, chapter 4)."""
ROUNDED = 1e-3
"""Share by which Ms may exceed a limit that a controller was optimized for."""


@dataclass(frozen=True)
class Corner:
    """Dead time in s and gain of a plant that the data do not rule out, and Ms; inf if unstable.

    At the ends of their intervals, or those of a plausible model.
    """

    dead_time: float
    gain: float | None
    ms: float

    def __str__(self) -> str:
        gain = "" if self.gain is None else f" and a gain of {self.gain:.4g}"
        return f"a dead time of {in_time(self.dead_time, 4)}{gain}"


@dataclass(frozen=True, eq=False, repr=False)
class LoopCheck(Result):
    """Check of the closed loop with the design model.

    ``stable`` is ``margins.stable``; `robustness`, if there is an interval of dead times, has the
    nominal delay and the ends of the interval among its `delays`. `corners` are the pairs of the
    ends of both intervals, ``worst`` is that of the largest Ms.

    Attributes
    ----------
    margins : Margins
        Of the controller with the design model, with exact dead time.
    robustness : DelayRobustness or None
        Over ``system.fit.dead_time_interval``; None if the system has no interval.
    corners : tuple of Corner
        Ms with each of ``system.fit.plausible_models`` but the worst, which one of forty is, if the
        fit has them; otherwise at the ends of its intervals of dead time and gain.
    flags : tuple of Flag
        ``"sensitive"`` if Ms is larger than 2 on the model; ``"unstable_within_interval"`` if some
        dead time within the interval, or a corner, makes the loop unstable;
        ``"sensitive_within_interval"`` if Ms is larger than 2 at a corner.
    by_models : bool
        The corners are plausible models, whose dead times are no whole samples: they decide on
        `stable_within_interval`, not the interval widened to whole samples.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> check = cr.design.pid(plant).check
    >>> check.stable, round(check.margins.ms, 2), check.robustness
    (True, 1.59, None)
    """

    margins: Margins
    robustness: DelayRobustness | None = None
    corners: tuple[Corner, ...] = ()
    flags: tuple[Flag, ...] = ()
    by_models: bool = False

    @property
    def time_unit(self) -> str:
        """Unit in which cards write times."""
        return self.margins.time_unit

    @property
    def worst(self) -> Corner | None:
        """Corner of the intervals with the largest Ms; None if there is no interval."""
        return max(self.corners, key=lambda corner: corner.ms, default=None)

    @property
    def stable(self) -> bool:
        """The loop with the model itself is stable."""
        return self.margins.stable

    @property
    def stable_within_interval(self) -> bool | None:
        """Stable for all dead times of the interval; None if there is no interval."""
        if self.by_models and self.worst is not None:
            return self.worst.ms < float("inf")
        return None if self.robustness is None else self.robustness.stable

    _heading = "Closed loop on the design model"

    def _rows(self) -> list[tuple[str, str]]:
        found = self.margins
        if not found.stable:
            return [("on the design model", "UNSTABLE")]
        reached = (
            f"stable, Ms {found.ms:.3g}, phase margin {found.phase_margin:.3g} deg, "
            f"delay margin {in_time(found.delay_margin, 3)}"
        )
        rows = [("on the design model", reached)]
        if self.robustness is not None:
            word = "stable" if self.stable_within_interval else "UNSTABLE somewhere"
            interval = interval_in_time(*self.robustness.dead_time_interval)
            rows.append(("over the interval", f"{word}, dead time {interval}"))
        if self.worst is not None:
            where = "with a plausible model: lags of its own" if self.by_models else "whole samples"
            rows.append(("at worst", f"Ms {self.worst.ms:.3g}, {where}, {self.worst}"))
        return rows

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable"
        inside = ""
        if self.robustness is not None:
            word_inside = "stable" if self.stable_within_interval else "unstable"
            inside = f", {word_inside} over the dead-time interval"
        return f"<LoopCheck {word} on the design model{inside}>"


@in_shown_units
def loop_check(plant: Any, controller: Any, *, models: bool = True) -> LoopCheck:
    """Check the closed loop with the model, and over its interval of dead times if it has one.

    Parameters
    ----------
    plant : DelayedStateSpace, or a continuous system
    controller : system of the same time base
    models : bool, optional
        Whether the loop is closed by the output of the plant, which the models that its data do not
        rule out have as well. States of the core they have not: the intervals are tried instead.
    """
    loop = open_loop(plant, controller)
    found = loop_margins(loop)
    flags: tuple[Flag, ...] = ()
    if found.stable and found.ms > MOST_SENSITIVE * (1 + ROUNDED):
        flags = (flagged("sensitive", ms=found.ms, most=MOST_SENSITIVE),)
    fit = plant.fit if isinstance(plant, DelayedStateSpace) else None
    if fit is None or not found.stable:
        return LoopCheck(found, flags=flags)
    interval = interval_of_dead_time(plant, None)
    robust = None if interval is None else over_interval(plant, loop, found, interval, TRIED)
    others = fit.plausible_models if models else None
    if others is None:
        corners = _corners(plant, fit, loop, found, robust)
    else:
        corners = _of_models(loop, others, fit.integrators)
    made = LoopCheck(found, robust, corners, by_models=others is not None)
    return replace(made, flags=(*flags, *_left_open(made)))


def _corners(
    plant: DelayedStateSpace, fit: ModelFit, loop: Loop, found: Margins,
    robust: DelayRobustness | None,
) -> tuple[Corner, ...]:  # fmt: skip
    """Ms at the ends of the intervals of dead time and gain; the gain scales the whole loop."""
    gains = _gains(fit)
    if robust is None and not gains:
        return ()
    if robust is None:
        ends = [(int(plant.delay), float(plant.dead_time), found.modulus_margin)]
    else:
        tried = [*zip(robust.delays, robust.dead_times, robust.modulus_margin, strict=True)]
        ends = [
            (int(d), float(t), float(m)) for d, t, m in tried if d != plant.delay or len(tried) < 3
        ]
    corners = [Corner(time, fit.gain, _ms(size)) for _, time, size in ends]
    for gain, ratio in gains:
        for delay, time, _ in ends:
            corners.append(Corner(time, gain, _ms(distance_if_stable(_moved(loop, delay, ratio)))))
    return tuple(corners)


def _of_models(loop: Loop, models: PlausibleModels, integrators: int) -> tuple[Corner, ...]:
    """Ms with other models of the plant, in the place of the first factor of a loop."""
    found = []
    for one, system in zip(models.models, models.systems, strict=True):
        plant = factor(system, loop.dt)
        ms = _ms(distance_if_stable(replace(loop, factors=(plant, *loop.factors[1:]))))
        if integrators:  # the slope per second, as that of the model
            moving = one.poles[np.argsort(np.abs(one.poles))[integrators:]]
            gain = float(one.numerator[0] / np.prod(-moving).real)
        else:
            gain = float(plant.response(np.zeros(1, dtype=np.complex128))[0].real)
        found.append(Corner(one.dead_time, gain if np.isfinite(gain) else None, ms))
    worst = max(found, key=lambda corner: corner.ms)
    return tuple(corner for corner in found if corner is not worst)


def _ms(modulus_margin: float) -> float:
    return 1 / modulus_margin if modulus_margin else float("inf")


def _gains(fit: ModelFit) -> list[tuple[float, float]]:
    """Ends of the interval of the gain, each with its ratio to that of the model."""
    if not fit.gain or fit.gain_interval is None:
        return []
    ends = [(float(end), float(end) / fit.gain) for end in fit.gain_interval]
    return ends if all(np.isfinite(ratio) and ratio for _, ratio in ends) else []


def _moved(loop: Loop, delay: int, factor: float) -> Loop:
    """Change delay and gain of the first factor of a loop, the plant."""
    plant = loop.factors[0]
    scaled = replace(plant, delay=delay, response=lambda w: factor * plant.response(w))
    return replace(loop, factors=(scaled, *loop.factors[1:]))


def _left_open(made: LoopCheck) -> Iterator[Flag]:
    """What the identification leaves open does to the loop: its models, or else its intervals.

    The interval of a dead time alone is for fits that say nothing on the lags that go with it.
    """
    models, worst, most = made.by_models, made.worst, MOST_SENSITIVE
    if not models and made.robustness is not None and not made.robustness.stable:
        interval = interval_in_time(*made.robustness.dead_time_interval)
        stable = interval_in_time(made.robustness.stable_from, made.robustness.stable_to)
        yield flagged("unstable_within_interval", interval=interval, stable=stable)
    elif worst is None or worst.ms <= most * (1 + ROUNDED):
        return
    elif worst.ms == float("inf") and models:
        yield flagged("unstable_within_interval.model", corner=worst)
    elif worst.ms == float("inf"):
        yield flagged("unstable_within_interval.corner", corner=worst)
    elif models:
        yield flagged("sensitive_within_interval.model", ms=worst.ms, most=most, corner=worst)
    else:
        yield flagged("sensitive_within_interval", ms=worst.ms, most=most, corner=worst)


def verified(
    plant: Any, controller: Any, what: str, to_stabilize: str, more_robust: str,
    *, models: bool = True,
) -> LoopCheck:  # fmt: skip
    """Check a loop; refuse one that is unstable, and warn of one that is not robust.

    Raises
    ------
    UnsuitableSystemError
    """
    check = loop_check(plant, controller, models=models)
    refuse_unstable(check, what, to_stabilize)
    warn_of(check, more_robust)
    return check


def warn_of(check: LoopCheck, advice: str) -> None:
    """Warn of a loop that is not robust on its model or its intervals, with what to try."""
    if check.flags:
        warn_caller(f"{'; '.join(map(str, check.flags))}. {advice}", ModelWarning)


def refuse_unstable(check: LoopCheck, what: str, advice: str) -> None:
    """Refuse a controller whose loop with the design model is unstable.

    Raises
    ------
    UnsuitableSystemError
    """
    if not check.stable:
        _refuse(check.margins.unstable_poles, what, advice)


def refuse_poles(poles: ComplexArray, what: str, advice: str) -> None:
    """Refuse a loop of several channels by its poles; see `refuse_unstable`."""
    if np.any(np.abs(poles) >= 1):
        _refuse(int(np.sum(np.abs(poles) > 1)), what, advice)


def _refuse(count: int, what: str, advice: str) -> None:
    state = f"{count} unstable pole{'s' * (count > 1)}" if count else "on the stability boundary"
    raise UnsuitableSystemError(
        f"{what} does not stabilize the model that it was designed for ({state}). {advice}"
    )
