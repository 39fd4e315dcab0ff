"""Models of a session: fits as tasks, the model that follows a drag, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .._parameters import Parameter
from .._wording import in_time, interval_in_time, time_unit, time_within
from ..data import Record
from ..delayed import DelayedStateSpace, delayed_ss
from ..delayed.simulation import simulate_record
from ..errors import OptionError
from ..identification import OutputErrorFit, ProcessStructure, identify
from ..identification.plausible import continuous_core
from ..numerics.arrays import FloatArray
from ..numerics.constants import CHI2_95, VERY_STRONG
from ..numerics.output_error.result import StructureFit
from .drawing import JSON, axis, band, handle, level, line, number, panel, span, time_axis

MOST_LAGS = 3
_SHOWN_LEVEL = 6.0
"""Multiples of the threshold up to which the criterion is drawn."""
_REACH = 3.0  # total delays after the step, in the panel of the start of the response
_MOST_ROWS, _MOST_BARS = 8, 4
_BESIDE = 0.1  # of the range of dead times, shown on both sides of it
_FIRST_BAR, _NEXT_BAR = 0.72, 0.06  # heights of the intervals of structures, parts of the axis


def identified(
    records: Sequence[Record], structure: Sequence[int] | None, known: Mapping[str, Any]
) -> DelayedStateSpace:
    """Fit a model to records together: of all structures, of one, or with known parameters."""
    chosen: Any = None
    if known:
        chosen = ProcessStructure(known["name"], fixed=known["fixed"])
    elif structure is not None:
        chosen = [tuple(structure)]
    given = records[0] if len(records) == 1 else records
    return identify(given, structures=chosen)


def fit_of_lags(system: DelayedStateSpace) -> OutputErrorFit | None:
    """The output-error fit of a model, also where a state-space model takes its place."""
    fit: Any = system.fit
    fit = fit if isinstance(fit, OutputErrorFit) else getattr(fit, "lags", None)
    return fit if isinstance(fit, OutputErrorFit) else None


def process_name(fit: OutputErrorFit) -> str:
    """Name of the process model that has the parameters of a fit.

    Raises
    ------
    OptionError
        Process models have at most three lags, one zero and one integrator.
    """
    names = [one.name for one in fit.parameters]
    lags = sum(name.startswith("lag_") for name in names)
    pairs, leads = names.count("pair_time_1"), names.count("lead_1")
    plain = lags + 2 * pairs <= MOST_LAGS and fit.integrators <= 1
    if not plain or len(names) != 2 + lags + 2 * pairs + leads:
        raise OptionError(
            "a parameter can be known in a model with at most three lags and one zero; got "
            f"{', '.join(names)}: choose a simpler structure"
        )
    return f"P{lags + 2 * pairs}D" + "I" * fit.integrators + "Z" * leads + "U" * pairs


@dataclass(frozen=True, eq=False)
class Drawn:
    """Model whose parameters are moved by hand, its structure fixed.

    Its output is that of the fit, plus the difference of the two models' responses to the input:
    drift, hum and free response stay as they were fitted.
    """

    fit: OutputErrorFit

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters of the fit by their names."""
        return {one.name: one for one in self.fit.parameters}

    @cached_property
    def own(self) -> FloatArray:
        """Response of the fit itself."""
        return self.response({})

    def response(self, moved: Mapping[str, float]) -> FloatArray:
        """Response (N,) to the input from rest, with some parameters changed; times in s."""
        values = {name: one.value for name, one in self.parameters.items()} | dict(moved)
        numerator, denominator = np.array([values["gain"]]), np.array([1.0])
        for name, value in values.items():
            if name.startswith("lag_"):
                denominator = np.polymul(denominator, [value, 1.0])
            elif name.startswith("lead_"):
                numerator = np.polymul(numerator, [value, 1.0])
            elif name.startswith(("pair_time_", "zero_time_")):
                damping = values[name.replace("time", "damping")]
                factor = [value**2, 2 * damping * value, 1.0]
                if name.startswith("pair"):
                    denominator = np.polymul(denominator, factor)
                else:
                    numerator = np.polymul(numerator, factor)
        poles = np.r_[np.roots(denominator), np.zeros(self.fit.integrators)]
        core = continuous_core((numerator / denominator[0])[::-1], poles.astype(np.complex128))
        data = self.fit.data
        model = delayed_ss(core, dead_time=max(values["dead_time"], 0.0), dt=data.dt)
        moves = np.ravel(model.simulate(data.input - data.input[0]))
        return np.asarray(moves[np.minimum(data.rows * data.every, moves.size - 1)])

    def output(self, moved: Mapping[str, float]) -> FloatArray:
        """Output (N,) with some parameters changed."""
        return self.fit.fitted + self.response(moved) - self.own

    def residual(self, output: FloatArray) -> float:
        """Root mean square of what an output leaves."""
        return float(np.sqrt(np.nanmean((self.fit.measured - output) ** 2)))

    def misfit(self, output: FloatArray, free: OutputErrorFit) -> JSON:
        """Residual of a model beside that of the best one, with nothing known."""
        here, best = self.residual(output), self.residual(free.fitted)
        more = f"{100 * (here / best - 1):+.0f} %" if best else ""
        return {
            "residual": here, "best": best,
            "text": f"residual {number(here)}, of the best model {number(best)}"
                    + (f" ({more})" if here > 1.005 * best else ""),
        }  # fmt: skip


def step_time(fit: OutputErrorFit) -> float:
    """Time in s, on the axis of the fit, at which the input first moves."""
    data = fit.data
    moves = np.flatnonzero(np.abs(np.diff(data.input)) > 0)
    first = data.edges[0][0] if data.motion is not None else int(moves[0]) + 1 if moves.size else 0
    return float(fit.time[0] + (first - data.rows[0] * data.every) * data.dt)


def criterion(fit: OutputErrorFit) -> tuple[FloatArray, FloatArray]:
    """Dead times in s, and the misfit of the best model with each: the profile of the fit."""
    return fit.estimate.profile


def excess_at(fit: OutputErrorFit, dead_time: float) -> float:
    """Criterion at a dead time, between its points linear in the root."""
    at, excess = criterion(fit)
    return float(np.interp(dead_time, at, np.sqrt(np.maximum(excess, 0.0)))) ** 2


def drag(fit: OutputErrorFit, free: OutputErrorFit, moved: Mapping[str, float]) -> JSON:
    """What is redrawn while parameters are dragged."""
    drawn = Drawn(fit)
    output = drawn.output(moved)
    factor, _ = time_unit(float(np.abs(fit.time[[0, -1]]).max()))
    lines = {}
    for key, part in (("start", _start(fit)), ("response", slice(None))):
        lines[key] = line(factor * fit.time[part], output[part], "model")
    told = drawn.misfit(output, free)
    at = moved.get("dead_time")
    if at is not None:
        told["excess"] = excess_at(free, at)
        low, high = free.interval
        told["allowed"] = bool(low <= at <= high)
        told["text"] += "" if told["allowed"] else "; outside of what the record allows"
    return {"lines": lines, "misfit": told}


def _start(fit: OutputErrorFit) -> slice:
    """Samples about the start of the response."""
    since = fit.time - step_time(fit)
    reach = _REACH * max(fit.total_delay, 4 * fit.dt) if np.isfinite(fit.total_delay) else np.inf
    inside = np.flatnonzero((since >= -0.3 * reach) & (since <= reach))
    return slice(int(inside[0]), int(inside[-1]) + 1) if inside.size > 8 else slice(None)


def view(
    system: DelayedStateSpace, free: DelayedStateSpace, table: DelayedStateSpace | None,
    known: Mapping[str, float],
) -> JSON:  # fmt: skip
    """Everything about a model: panels, structures, parameters, verdicts.

    `free` is the model of the same structure without known parameters, `table` that of all
    structures.
    """
    fit = fit_of_lags(system)
    if fit is None:
        return {"panels": [_simulated(system)], "structures": [], "parameters": [],
                "verdicts": _verdicts(system), "notes": [], "report": _report(system)}  # fmt: skip
    without = fit_of_lags(free) or fit
    every = without if table is None else fit_of_lags(table) or without
    drawn = Drawn(fit)
    return {
        "panels": [*_responses(drawn, without), _criterion(without, fit), _residual(fit)],
        "structures": _structures(every, fit),
        "parameters": _parameters(fit, known),
        "verdicts": _verdicts(system),
        "notes": [str(flag) for flag in fit.flags],
        "formula": fit.formula,
        "fit": fit.fit_percent,
        "misfit": drawn.misfit(fit.fitted, without),
        "report": _report(system),
    }


def _report(system: DelayedStateSpace) -> str:
    return "" if system.fit is None else system.fit.report()


def _verdicts(system: DelayedStateSpace) -> list[JSON]:
    answers = () if system.fit is None else system.fit.verdicts
    return [
        {"question": one.question, "level": one.level, "sentence": one.sentence} for one in answers
    ]


def _parameters(fit: OutputErrorFit, known: Mapping[str, float]) -> list[JSON]:
    rows = []
    for one in fit.parameters:
        shown = one.in_time_unit(fit.time_unit) if one.times else one
        low, high = _range(one)
        rows.append({
            "name": one.name, "label": shown.label, "value": one.value, "text": shown.text(),
            "interval": shown.interval_text(), "known": one.name in known,
            "low": low, "high": high,
        })  # fmt: skip
    return rows


def _range(one: Parameter) -> tuple[float, float]:
    """Values to which a parameter may be dragged."""
    if one.name.endswith(("damping_1", "damping_2")):
        return 0.0, 1.0
    ends = sorted((one.value / 4, 2.5 * one.value))
    return (0.0, ends[1]) if one.name == "dead_time" else (ends[0], ends[1])


def _structures(every: OutputErrorFit, fit: OutputErrorFit) -> list[JSON]:
    rows = []
    for one in every.structures[:_MOST_ROWS]:
        ends = one.interval
        rows.append({
            "structure": [one.order, one.relative_degree],
            "name": _name(one),
            "delta_bic": f"{one.delta_bic:.1f}",
            "dead_time": in_time(one.dead_time) if ends is None
                         else time_within(one.dead_time, *ends),
            "interval": "" if ends is None else interval_in_time(*ends),
            "gain": number(one.gain),
            "chosen": (one.order, one.relative_degree) == fit.structure,
            "ruled_out": one.delta_bic > VERY_STRONG,
        })  # fmt: skip
    return rows


def _name(one: StructureFit) -> str:
    zeros = one.structure.zeros
    behind = f", {zeros} zero{'s' * (zeros > 1)}" if zeros else ""
    return f"{one.order} pole{'s' * (one.order > 1)}{behind}"


def _not_ruled_out(fit: OutputErrorFit) -> list[StructureFit]:
    rows = [one for one in fit.structures if one.delta_bic <= VERY_STRONG and one.interval]
    return rows[:_MOST_BARS] if len(rows) > 1 else []


def _responses(drawn: Drawn, free: OutputErrorFit) -> list[JSON]:
    """The start of the response with handles for times, and all of it with one for the gain."""
    fit = drawn.fit
    factor, across = time_axis(float(np.abs(fit.time[[0, -1]]).max()))
    begin, part = step_time(fit), _start(fit)
    time = factor * fit.time
    low, high = (factor * (begin + end) for end in free.interval)
    unit = fit.output_unit
    label = fit.records[0].output_labels[0] if fit.records else "output"
    shared = {"unit": unit, "label": "output" if label == "y" else label}
    panels = []
    for key, title, shown in (
        ("start", "Start of the response: drag the dead time", part),
        ("response", "Whole response: drag the gain", slice(None)),
    ):
        x = {**across, "ends": [float(time[shown][0]), float(time[shown][-1])]}
        layers = [
            span(low, high, "band", "dead times that the record allows"),
            line(time[shown], fit.measured[shown], "measured", "measured"),
            line(time[shown], fit.fitted[shown], "model", "model", key="model"),
        ]
        handles = _time_handles(drawn, factor, begin) if key == "start" else _gain_handle(drawn)
        panels.append(panel(key, title, x, axis(shared["label"], unit), layers, handles))
    return panels


def _time_handles(drawn: Drawn, factor: float, begin: float) -> list[JSON]:
    fit, found = drawn.fit, []
    at = begin
    for one in fit.parameters:
        if one.name != "dead_time" and not one.name.startswith("lag_"):
            continue
        at += one.value
        first = begin if one.name == "dead_time" else at - one.value
        low, high = _range(one)
        most = max(high, fit.estimate.latest) if one.name == "dead_time" else high
        found.append(
            handle(
                one.name, one.label, factor * at, in_time(one.value, 4),
                ends=(factor * (first + low), factor * (first + most)), per_unit=factor,
                offset=factor * first, step=factor * min(fit.dt, most / 100),
            )
        )  # fmt: skip
    return found


def _gain_handle(drawn: Drawn) -> list[JSON]:
    fit = drawn.fit
    last, own = float(fit.fitted[-1]), float(drawn.own[-1])
    gain = drawn.parameters["gain"].value
    if not own or not np.isfinite(own / gain):
        return []
    low, high = _range(drawn.parameters["gain"])
    base, each = last - own, own / gain
    ends = sorted((base + each * low, base + each * high))
    return [
        handle(
            "gain", "gain", last, number(gain), ends=(ends[0], ends[1]), along="y",
            per_unit=each, offset=base,
        )
    ]  # fmt: skip


def _criterion(free: OutputErrorFit, fit: OutputErrorFit) -> JSON:
    """Misfit of the best model over the dead time, of the chosen and of other structures."""
    at, excess = criterion(free)
    most = _SHOWN_LEVEL * CHI2_95
    shown = at[excess <= 2 * most]
    low, high = free.interval
    ends = min(float(shown.min()), low), max(float(shown.max()), high, fit.dead_time)
    room = _BESIDE * (ends[1] - ends[0] or fit.dt)
    ends = max(ends[0] - room, 0.0), ends[1] + room
    factor, across = time_axis(ends[1], "dead time")
    across["ends"] = [factor * ends[0], factor * ends[1]]
    layers = [span(factor * low, factor * high, "band", "95 % interval")]
    for row, one in enumerate(_not_ruled_out(free)):
        height = np.full(2, most * (_FIRST_BAR + _NEXT_BAR * row))
        layers.append(
            line(factor * np.array(one.interval), height, "bar", f"interval with {_name(one)}")
        )
    curve = line(factor * at, excess, "model", f"order {free.order}")
    # Not rounded: what is drawn is the profile itself.
    curve["x"], curve["y"] = (factor * at).tolist(), excess.tolist()
    layers += [curve, level(CHI2_95, "ink", "95 %")]
    here = handle(
        "dead_time", "dead time", factor * fit.dead_time, in_time(fit.dead_time, 4),
        ends=(across["ends"][0], across["ends"][1]), per_unit=factor,
        step=factor * min(fit.dt, (ends[1] - ends[0]) / 100 or fit.dt),
    )  # fmt: skip
    y = axis("misfit above the best", "noise variances", (0.0, most))
    return panel("criterion", "Which dead times the record allows", across, y, layers, [here])


def _residual(fit: OutputErrorFit) -> JSON:
    factor, across = time_axis(float(np.abs(fit.time[[0, -1]]).max()))
    left = fit.measured - fit.fitted
    two = np.full(2, 2 * fit.noise)
    ends = factor * fit.time[[0, -1]]
    across["ends"] = ends.tolist()
    layers = [
        band(ends, -two, two, "noise", "noise (2 std)"),
        line(factor * fit.time, left, "measured", "residual"),
    ]
    y = axis("residual", fit.output_unit)
    return panel("residual", "What the model leaves", across, y, layers)


def _simulated(system: DelayedStateSpace) -> JSON:
    """Record beside a model that has no fit of lags."""
    record = system.fit.records[0] if system.fit is not None else None
    assert record is not None
    factor, across = time_axis(float(np.abs(record.time[[0, -1]]).max()))
    model = simulate_record(system, record, "estimate", gaps=True)[0]
    layers = [
        line(factor * record.time, record.output, "measured", "measured"),
        line(factor * record.time, model, "model", "model"),
    ]
    return panel("response", "Response", across, axis("output", record.output_units[0]), layers)


def with_known(fit: OutputErrorFit, known: Mapping[str, float]) -> JSON:
    """What `identified` asks for where parameters of a structure are known."""
    if not known:
        return {}
    name = process_name(fit)
    ProcessStructure(name, fixed=known)  # refuses what is no parameter of it
    return {"name": name, "fixed": dict(known)}
