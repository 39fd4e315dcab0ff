"""Loops of a session: the controller, its loop with the model and with all plausible plants."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._wording import in_time
from ..delayed import DelayedStateSpace, delayed_ss
from ..design import LoopSimulation, PIDController, margins, simulate_loop
from ..design.tuning.pid import TuningOptions, pid, tuned
from ..design.tuning.plant import TuningPlant
from ..errors import CtrlRealizeError, CtrlRealizeWarning
from ..identification import OutputErrorFit
from ..identification.plausible import continuous_core
from ..numerics.arrays import BoolArray, FloatArray
from ..report.controller import unsafe_if
from .drawing import JSON, axis, layer, line, panel, time_axis

SPEEDS = {"simc": 1.0, "imc": 1.7, "lambda": 3.0, "optimal": 0.0}
"""Rules that can be made quicker or more cautious, and their usual closed-loop times in dead times
of the reduced model; for the optimal one it is Ms that changes."""
_MIDDLE, _RATIO = 0.5, 4.0  # where a rule is as it is, and times at the ends over that
_MS = (1.2, 2.0)
_SAMPLES, _FEW_SAMPLES = 500, 250  # of a simulated loop, at rest and while the slider moves
_SETTLED = 4.0  # integral times and dead times, which a loop is shown for
_THIN = 4  # samples of a simulated loop for each point of a curve that is one of many
_ROOM = 0.08  # of an axis


@dataclass(frozen=True, eq=False)
class TunedLoop:
    """A controller with what was said about it.

    `sensitivities` (1 + 39,) are Ms with the model and with each plausible plant, if these were
    checked; infinite where the loop is unstable.
    """

    controller: PIDController
    sensitivities: FloatArray
    warnings: tuple[str, ...]


def rule_options(settings: Mapping[str, Any], system: DelayedStateSpace) -> JSON:
    """Keyword arguments of `pid` for the settings of a page."""
    rule, kind, speed = (settings[key] for key in ("rule", "kind", "speed"))
    options: JSON = {"rule": rule, "kind": kind}
    if rule == "optimal":
        options["max_sensitivity"] = float(f"{_MS[0] + speed * (_MS[1] - _MS[0]):.3g}")
    elif rule in SPEEDS and speed != _MIDDLE:
        model = tuned(TuningPlant(system, None), TuningOptions(rule, kind)).model
        usual = SPEEDS[rule] * max(model.dead_time if model else 0.0, float(system.dt))
        options["closed_loop_time"] = float(f"{usual * _RATIO ** (1 - speed / _MIDDLE):.3g}")
    return options


def tuned_loop(
    system: DelayedStateSpace, settings: Mapping[str, Any], *, checked: bool = True
) -> TunedLoop:
    """Tune a controller; a check of its loop with margins and advice takes a moment."""
    options, told = rule_options(settings, system), []
    if checked:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", CtrlRealizeWarning)
            controller = pid(system, **options)
    else:
        controller = tuned(TuningPlant(system, None), TuningOptions(**options))
    said = tuple(str(one.message) for one in told)
    found = (margins(one, controller) for one in (_plants(system) if checked else [system]))
    sizes = np.array([one.ms if one.stable else np.inf for one in found])
    return TunedLoop(controller, sizes, said)


def _plants(system: DelayedStateSpace) -> list[DelayedStateSpace]:
    """The model, and those that the data do not rule out."""
    models = None if system.fit is None else system.fit.plausible_models
    return [system, *(() if models is None else models.systems)]


def _simulated(
    system: DelayedStateSpace, controller: PIDController, settings: Mapping[str, Any], whole: bool
) -> dict[str, list[LoopSimulation]]:
    """Set-point and load steps: of the model, then of each plausible plant.

    Where a sample is short beside the loop, controller and plants are sampled more coarsely.
    """
    count, step = _SAMPLES if whole else _FEW_SAMPLES, float(system.dt)
    wait = max(float(system.dead_time) + 0.5 * step, step)  # with half a sample for the hold
    slow = controller.ti if np.isfinite(controller.ti) else wait
    every = max(1, int(np.ceil(_SETTLED * (slow + 3 * wait) / count / step)))
    plants, fit = _plants(system) if whole else [system], system.fit
    if every > 1 and isinstance(fit, OutputErrorFit):
        dt, found = every * step, fit.plausible_models if whole else None
        controller = controller.discretised(dt)
        parts = [(fit.estimate.numerator, fit.poles, fit.dead_time)]
        parts += [(m.numerator, m.poles, m.dead_time) for m in (found.models if found else ())]
        plants = [delayed_ss(continuous_core(b, p), dead_time=L, dt=dt) for b, p, L in parts]
    more: JSON = {} if settings["limits"] is None else {"output_limits": settings["limits"]}
    steps = {"set point": (settings["setpoint"], 0.0), "load": (0.0, settings["load"])}
    return {
        name: [simulate_loop(one, controller, count, setpoint_step=up, load_step=load, **more)
               for one in plants]
        for name, (up, load) in steps.items()
    }  # fmt: skip


def _noise(system: DelayedStateSpace, controller: PIDController) -> float:
    """Standard deviation of the controller output from the noise of the record.

    The noise passes ``C / (1 + P C)``; its spectrum is that of the noise model of the fit.
    """
    noise = getattr(system.fit, "noise_model", None)
    if noise is None:
        return float("nan")
    z = np.exp(1j * np.linspace(0.0, np.pi, 4000)[1:])
    response = np.ravel(controller(z))
    through = response / (1 + response * np.ravel(system(z)))
    spectrum = noise.std**2 * np.abs(np.ravel(noise.system(z))) ** 2
    return float(np.sqrt(np.mean(np.abs(through) ** 2 * spectrum)))


def drawn(
    system: DelayedStateSpace, loop: TunedLoop, settings: Mapping[str, Any], *,
    all_plants: bool = True,
) -> JSON:  # fmt: skip
    """Panels, margins and noise of a loop; while a slider moves, of the model alone."""
    runs = _simulated(system, loop.controller, settings, all_plants)
    noise, unstable = _noise(system, loop.controller), ~np.isfinite(loop.sensitivities[1:])
    said = f"the noise of the record moves the controller output by {noise:.4g} (std)"
    return {
        "panels": [_panel(name, part, each, unstable, settings, noise)
                   for name, each in runs.items() for part in ("measured", "output")],
        "margins": _margins(loop, unstable), "noise": "" if np.isnan(noise) else said,
        "warnings": [*loop.warnings], "unsafe": [*unsafe_if(system, loop.controller)],
    }  # fmt: skip


def _panel(
    name: str, part: str, runs: Sequence[LoopSimulation], unstable: BoolArray,
    settings: Mapping[str, Any], noise: float,
) -> JSON:  # fmt: skip
    factor, across = time_axis(runs[0].time)
    time, (own, *others) = factor * runs[0].time, (getattr(one, part) for one in runs)
    stable = np.stack([own, *(y for y, bad in zip(others, unstable, strict=False) if not bad)])
    low, high = stable.min(axis=0), stable.max(axis=0)
    room = _ROOM * float(high.max() - low.min() or 1.0)
    ends = float(low.min()) - room, float(high.max()) + room
    layers = []
    if others:
        said = "plants that the record allows"
        layers.append(layer("band", "band", said, x=time, low=low, high=high))
    if others and unstable.any():
        far = 2 * ends[0] - ends[1], 2 * ends[1] - ends[0]
        many = np.clip(np.stack(others)[unstable], *far)[:, ::_THIN]
        said = "plants with which it is unstable"
        layers.append(layer("lines", "bad", said, x=time[::_THIN], many=many))
    if part == "output" and np.isfinite(noise):
        around = {"low": own - 2 * noise, "high": own + 2 * noise}
        layers.append(layer("band", "noise", "with its noise", x=time, **around))
    limits = settings["limits"] or () if part == "output" else ()
    layers += [layer("level", "input", "limit", y=end) for end in limits]
    layers.append(line(time, own, "model", "model"))
    title = {"measured": "measured value", "output": "controller output"}[part]
    y, key = axis(title, "", ends), f"{part}-{name.replace(' ', '-')}"
    return panel(key, f"{name.capitalize()}: {title}", across, y, layers)


def _margins(loop: TunedLoop, unstable: BoolArray) -> list[tuple[str, str]]:
    own, *others = loop.sensitivities
    found = {"Ms": f"{own:.3g}" if np.isfinite(own) else "unstable"}
    if (check := loop.controller.check) is not None:
        sizes = check.margins
        found["gain margin"] = f"{sizes.gain_margin:.3g}"
        found["phase margin"] = f"{sizes.phase_margin:.3g}°"
        found["delay margin"] = in_time(sizes.delay_margin, 3)
    if unstable.size:
        worst = float(np.sort(others)[-2])  # of forty, one is worse
        found["Ms on plausible plants"] = f"at most {worst:.3g}" if worst < np.inf else "unstable"
        found["unstable plants"] = f"{unstable.sum()} of {unstable.size}"
    return [*found.items()]


def form_ranges(settings: Mapping[str, Any]) -> JSON:
    """Keyword arguments of `as_form`."""
    given = {key: settings[key] for key in ("measured_range", "output_range", "time_unit")}
    return {key: tuple(value) if isinstance(value, list) else value
            for key, value in given.items() if value is not None}  # fmt: skip


def numbers_to_enter(controller: PIDController, settings: Mapping[str, Any]) -> JSON:
    """PID numbers in the form and units that were asked for."""
    try:
        form = controller.as_form(settings["form"], **form_ranges(settings))
    except CtrlRealizeError as error:
        return {"rows": [], "notes": [], "error": str(error)}
    return {"rows": form._rows(), "notes": [*form.notes, *form.choices], "error": ""}
