"""Loops of a session: the controller, its loop with the model and with all plausible plants."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._wording import in_time
from ..delayed import DelayedStateSpace, delayed_ss
from ..design import LoopSimulation, PIDController, simulate_loop, to_continuous
from ..design.tuning.pid import TuningOptions, pid, tuned
from ..errors import CtrlRealizeError, CtrlRealizeWarning
from ..identification.plausible import PlausibleModels, continuous_core
from ..numerics.arrays import FloatArray
from ..numerics.loops.reference import largest_sensitivity
from .drawing import JSON, axis, band, level, line, lines, number, panel, time_axis

SPEEDS = {"simc": 4.0, "imc": 4.0, "lambda": 4.0, "optimal": 1.0}
"""Rules that can be made quicker or more cautious, and the ratio of their closed-loop times at the
ends to that in the middle; for the optimal one it is Ms that changes."""
_MS = (1.2, 2.0)
_SAMPLES, _FEW_SAMPLES = 500, 250  # of a simulated loop, at rest and while the slider moves
_SETTLED = 4.0  # integral times or lags, which a loop is shown for
_POINTS = 600  # of frequency
_THIN = 4  # samples of a simulated loop for each point of a curve that is one of many


@dataclass(frozen=True, eq=False)
class TunedLoop:
    """A controller with what was said about it, and Ms with each plausible plant."""

    controller: PIDController
    sensitivities: FloatArray
    own: float
    warnings: tuple[str, ...] = ()
    checked: bool = True


def rule_options(settings: Mapping[str, Any], dead_time: float) -> JSON:
    """Keyword arguments of `pid` for the settings of a page; dead time with hold, in s."""
    rule, speed = settings["rule"], settings["speed"]
    options: JSON = {"rule": rule, "kind": settings["kind"]}
    if speed is None or rule not in SPEEDS:
        return options
    if rule == "optimal":
        options["max_sensitivity"] = float(f"{_MS[0] + speed * (_MS[1] - _MS[0]):.3g}")
    else:
        middle = dead_time * (3.0 if rule == "lambda" else 1.0)
        options["closed_loop_time"] = float(f"{middle * SPEEDS[rule] ** (1 - 2 * speed):.3g}")
    return options


def middle_time(system: DelayedStateSpace) -> float:
    """Dead time of a plant with half a sample for the hold; a sample at least."""
    return max(float(system.dead_time) + 0.5 * float(system.dt), float(system.dt))


def tuned_loop(system: DelayedStateSpace, settings: Mapping[str, Any]) -> TunedLoop:
    """Tune a controller and check its loop; a task, since the check takes a moment."""
    options = rule_options(settings, middle_time(system))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", CtrlRealizeWarning)
        controller = pid(system, **options)
    own, others = sensitivities(system, controller)
    said = tuple(str(one.message) for one in told)
    return TunedLoop(controller, others, own, said)


def sketched_loop(system: DelayedStateSpace, settings: Mapping[str, Any]) -> TunedLoop:
    """As `tuned_loop`, at once: without the margins and the advice."""
    options = rule_options(settings, middle_time(system))
    rule, kind = options.pop("rule"), options.pop("kind")
    controller, _ = tuned(system, rule, kind, TuningOptions(**options))
    own, others = sensitivities(system, controller)
    return TunedLoop(controller, others, own, checked=False)


def sensitivities(system: DelayedStateSpace, controller: PIDController) -> tuple[float, FloatArray]:
    """Ms with the model, and with each plausible plant; infinite where the loop is unstable."""
    dt = float(system.dt)
    # A crossover near half the sample rate needs steps of equal width.
    slow = np.geomspace(1e-3 / middle_time(system), np.pi / dt, _POINTS)
    omega = np.union1d(slow, np.linspace(0.0, np.pi / dt, _POINTS)[1:])
    z = np.exp(1j * omega * dt)
    models = plausible(system)
    plants = [system, *(() if models is None else models.systems)]
    response = np.stack([np.ravel(one(z)) for one in plants]) * np.ravel(controller(z))
    own, *others = largest_sensitivity(response)
    return float(own), np.array(others)


def plausible(system: DelayedStateSpace) -> PlausibleModels | None:
    """Models that the data do not rule out."""
    found = None if system.fit is None else system.fit.plausible_models
    return found if isinstance(found, PlausibleModels) else None


def simulated(
    system: DelayedStateSpace, loop: TunedLoop, settings: Mapping[str, Any], *, all_plants: bool
) -> list[tuple[str, list[LoopSimulation]]]:
    """Set-point and load steps: of the model, then of each plausible plant.

    Where a sample is short beside the loop, controller and plants are sampled more coarsely.
    """
    controller, count = loop.controller, _SAMPLES if all_plants else _FEW_SAMPLES
    slow = controller.ti if np.isfinite(controller.ti) else middle_time(system)
    length = _SETTLED * (slow + 2 * middle_time(system)) + 4 * middle_time(system)
    every = max(1, int(np.ceil(length / count / float(system.dt))))
    dt = every * float(system.dt)
    models = plausible(system)
    plants: list[DelayedStateSpace] = [system]
    if models is not None and all_plants:
        plants += models.systems
    if every > 1:
        controller = controller.discretised(dt)
        chosen = [] if models is None or not all_plants else list(models.models)
        core, wait = to_continuous(system)
        plants = [delayed_ss(core, dead_time=wait, dt=dt)] + [
            delayed_ss(continuous_core(one.numerator, one.poles), dead_time=one.dead_time, dt=dt)
            for one in chosen
        ]
    size = settings["setpoint"]
    limits = settings["limits"]
    given: JSON = {} if limits is None else {"output_limits": tuple(limits)}
    found = []
    for name, steps in (
        ("set point", {"setpoint_step": size}),
        ("load", {"setpoint_step": 0.0, "load_step": settings["load"]}),
    ):
        runs = [simulate_loop(one, controller, count, **steps, **given) for one in plants]
        found.append((name, runs))
    return found


def noise_at_actuator(system: DelayedStateSpace, controller: PIDController) -> float:
    """Standard deviation of the controller output from the noise of the record.

    The noise passes ``C / (1 + P C)``; its spectrum is that of the noise model of the fit.
    """
    noise = getattr(system.fit, "noise_model", None)
    if noise is None:
        return float("nan")
    omega = np.linspace(0.0, np.pi, 4000)[1:]
    z = np.exp(1j * omega)
    response = np.ravel(controller(z))
    through = response / (1 + response * np.ravel(system(z)))
    spectrum = noise.std**2 * np.abs(np.ravel(noise.system(z))) ** 2
    return float(np.sqrt(np.mean(np.abs(through) ** 2 * spectrum)))


def drawn(
    system: DelayedStateSpace, loop: TunedLoop, settings: Mapping[str, Any], *,
    all_plants: bool = True,
) -> JSON:  # fmt: skip
    """Panels, margins and noise of a loop; while a slider moves, of the model alone."""
    runs = simulated(system, loop, settings, all_plants=all_plants)
    noise = noise_at_actuator(system, loop.controller)
    unstable = ~np.isfinite(loop.sensitivities)
    panels = [one for name, each in runs for one in _panels(name, each, unstable, settings, noise)]
    return {
        "panels": panels,
        "margins": _margins(loop, unstable),
        "noise": "" if np.isnan(noise) else
                 f"the noise of the record moves the controller output by {number(noise)} (std)",
        "warnings": list(loop.warnings),
    }  # fmt: skip


def _panels(
    name: str, runs: Sequence[LoopSimulation], unstable: FloatArray, settings: Mapping[str, Any],
    noise: float,
) -> list[JSON]:  # fmt: skip
    factor, across = time_axis(float(runs[0].time[-1]))
    time = factor * runs[0].time
    across["ends"] = [0.0, float(time[-1])]
    found = []
    for key, title in (("measured", "measured value"), ("output", "controller output")):
        own = np.asarray(getattr(runs[0], key))
        others = [np.asarray(getattr(one, key)) for one in runs[1:]]
        ends = _view_of(own, [one for one, bad in zip(others, unstable, strict=False) if not bad])
        far, layers = _far(ends), []
        for look, bad, said in (
            ("plausible", False, "plants that the record allows"),
            ("bad", True, "unstable"),
        ):
            shown = [one for one, is_bad in zip(others, unstable, strict=False) if is_bad == bad]
            if shown:
                curves = [np.clip(one[::_THIN], *far) for one in shown]
                layers.append(lines(time[::_THIN], curves, look, said))
        if key == "output" and np.isfinite(noise):
            layers.append(band(time, own - 2 * noise, own + 2 * noise, "noise", "with its noise"))
        if key == "output" and settings["limits"] is not None:
            layers += [level(end, "input", "limit") for end in settings["limits"]]
        if key == "measured" and name == "set point":
            layers.append(level(settings["setpoint"], "input", "set point"))
        layers.append(line(time, own, "model", "model", key="model"))
        x = dict(across)
        y = axis(title, "", ends)
        found.append(panel(f"{key}-{name.replace(' ', '-')}", f"{name.capitalize()}: {title}", x, y,
                           layers))  # fmt: skip
    return found


def _view_of(own: FloatArray, others: Sequence[FloatArray]) -> list[float]:
    """Ends of an axis, by the loops that are stable."""
    every = np.concatenate([own, *others])
    low, high = float(every.min()), float(every.max())
    room = 0.08 * (high - low or 1.0)
    return [low - room, high + room]


def _far(ends: Sequence[float]) -> tuple[float, float]:
    size = ends[1] - ends[0]
    return ends[0] - size, ends[1] + size


def _margins(loop: TunedLoop, unstable: FloatArray) -> list[tuple[str, str]]:
    rows = []
    check = loop.controller.check
    if check is not None and check.stable:
        found = check.margins
        rows = [
            ("Ms", f"{found.ms:.3g}"),
            ("gain margin", f"{found.gain_margin:.3g}"),
            ("phase margin", f"{found.phase_margin:.3g}°"),
            ("delay margin", in_time(found.delay_margin, 3)),
        ]
    else:
        rows = [("Ms", f"{loop.own:.3g}" if np.isfinite(loop.own) else "unstable")]
    if loop.sensitivities.size:
        worst = float(np.sort(loop.sensitivities)[-2])
        rows.append(("Ms on plausible plants", f"at most {worst:.3g}" if np.isfinite(worst)
                     else "unstable"))  # fmt: skip
        rows.append(("unstable plants", f"{int(unstable.sum())} of {unstable.size}"))
    return rows


def form_ranges(settings: Mapping[str, Any]) -> JSON:
    """Keyword arguments of `as_form`."""
    return {
        key: tuple(settings[key]) if isinstance(settings[key], list) else settings[key]
        for key in ("measured_range", "output_range", "time_unit")
        if settings[key] is not None
    }


def numbers_to_enter(controller: PIDController, settings: Mapping[str, Any]) -> JSON:
    """PID numbers in the form and units that were asked for."""
    try:
        form = controller.as_form(settings["form"], **form_ranges(settings))
    except CtrlRealizeError as error:
        return {"title": "", "rows": [], "notes": [], "error": str(error)}
    return {"title": form.title, "rows": form._rows(), "notes": [*form.notes, *form.choices],
            "error": ""}  # fmt: skip
