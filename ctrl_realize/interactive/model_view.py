"""How a model is drawn: its response with handles, its criterion, residual, and tables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .._parameters import Parameter
from .._wording import in_time, interval_in_time, time_within
from ..delayed import DelayedStateSpace
from ..identification import OutputErrorFit
from ..identification.output_error.words import order_words
from ..numerics.constants import CHI2_95, VERY_STRONG
from .drawing import JSON, axis, handle, layer, line, panel, time_axis
from .models import Drawn, fit_of_lags, start_of, step_time

_SHOWN_LEVEL = 6.0  # multiples of the limit of the criterion, up to which it is drawn
_BESIDE = 0.1  # of the range of dead times, shown on both sides of it
_FIRST_BAR, _NEXT_BAR = 0.72, 0.06  # heights of the intervals of structures, parts of the axis
_MOST_ROWS, _MOST_BARS = 8, 4
_OTHER = "a state-space model fits better: the loop is its own; the best one of lags is drawn here"


def model_view(
    system: DelayedStateSpace, free: DelayedStateSpace, table: DelayedStateSpace,
    known: Mapping[str, float],
) -> JSON:  # fmt: skip
    """Everything about a model: panels, structures, parameters, verdicts.

    `free` is the model of the same structure without known parameters, `table` that of all
    structures.
    """
    fit, seen = fit_of_lags(system), _in_words(system)
    if fit is None:
        return seen | {"panels": [], "structures": [], "parameters": []}
    without = fit_of_lags(free) or fit
    drawn = Drawn(fit)
    return seen | {
        "panels": [*_responses(drawn, without), _criterion(without, fit), _residual(fit)],
        "structures": _structures(fit_of_lags(table) or without, fit),
        "parameters": [_parameter(one, fit.time_unit, one.name in known) for one in fit.parameters],
        "misfit": drawn.misfit(fit.fitted, without),
    }


def _in_words(system: DelayedStateSpace) -> JSON:
    fit = system.fit
    assert fit is not None
    verdicts = [{key: getattr(one, key) for key in ("question", "level", "sentence")}
                for one in fit.verdicts]  # fmt: skip
    notes = [str(flag) for flag in fit.flags]
    if not isinstance(fit, OutputErrorFit):
        notes.insert(0, _OTHER)
    return {"verdicts": verdicts, "notes": notes, "formula": fit.formula, "report": fit.report()}


def _range(one: Parameter) -> tuple[float, float]:
    """Values to which a parameter may be dragged."""
    if "damping" in one.name:
        return 0.0, 1.0
    low, high = sorted((one.value / 4, 2.5 * one.value))
    return (0.0 if one.name == "dead_time" else low), high


def _parameter(one: Parameter, unit: str, known: bool) -> JSON:
    shown = one.in_time_unit(unit) if one.times else one
    low, high = _range(one)
    return {
        "name": one.name, "label": shown.label, "value": one.value, "text": shown.text(),
        "interval": shown.interval_text(), "known": known, "low": low, "high": high,
    }  # fmt: skip


def _structures(every: OutputErrorFit, fit: OutputErrorFit) -> list[JSON]:
    rows = []
    for one in every.structures[:_MOST_ROWS]:
        ends, wait = one.interval, one.dead_time
        rows.append({
            "structure": [one.order, one.relative_degree], "name": order_words(one),
            "delta_bic": f"{one.delta_bic:.1f}",
            "dead_time": time_within(wait, *ends) if ends else in_time(wait),
            "interval": interval_in_time(*ends) if ends else "", "gain": f"{one.gain:.4g}",
            "chosen": (one.order, one.relative_degree) == fit.structure,
            "ruled_out": one.delta_bic > VERY_STRONG,
        })  # fmt: skip
    return rows


def _responses(drawn: Drawn, free: OutputErrorFit) -> list[JSON]:
    """The start of the response with handles for times, and all of it with one for the gain."""
    fit, begin = drawn.fit, step_time(drawn.fit)
    y = axis(fit.records[0].output_labels[0] if fit.records else "output", fit.output_unit)
    panels = []
    for key, title, part in (
        ("start", "Start of the response", start_of(fit)),
        ("response", "Whole response", slice(None)),
    ):
        factor, across = time_axis(fit.time[part])
        time, (low, high) = factor * fit.time[part], free.interval
        allowed = {"low": factor * (begin + low), "high": factor * (begin + high)}
        layers = [
            layer("span", "band", "dead times that the record allows", **allowed),
            line(time, fit.measured[part], "measured", "measured"),
            line(time, fit.fitted[part], "model", "model"),
        ]
        handles = _time_handles(fit, factor, begin) if key == "start" else _gain_handle(drawn)
        panels.append(panel(key, title, across, y, layers, handles))
    return panels


def _time_handles(fit: OutputErrorFit, factor: float, at: float) -> list[JSON]:
    """Dead time from the step, and each lag from the end of what comes before it."""
    found = []
    for one in fit.parameters:
        if one.name == "dead_time" or one.name.startswith("lag_"):
            low, high = _range(one)
            high = max(high, fit.estimate.latest) if one.name == "dead_time" else high
            place: JSON = {"per_unit": factor, "offset": factor * at}
            said, step = in_time(one.value, 4), min(fit.dt, high / 100)
            found.append(handle(one.name, one.label, one.value, said, (low, high), step, **place))
            at += one.value
    return found


def _gain_handle(drawn: Drawn) -> list[JSON]:
    moved, gain = float(drawn.own[-1]), drawn.parameters["gain"]
    if not gain.value or not np.isfinite(moved) or not moved:
        return []
    said, step = f"{gain.value:.4g}", abs(gain.value) / 100
    place = {"per_unit": moved / gain.value, "offset": float(drawn.fit.fitted[-1]) - moved}
    return [handle("gain", "gain", gain.value, said, _range(gain), step, along="y", **place)]


def _criterion(free: OutputErrorFit, fit: OutputErrorFit) -> JSON:
    """Profile of the dead time, its interval, and the intervals of other structures."""
    at, excess = free.estimate.profile
    most = _SHOWN_LEVEL * CHI2_95
    shown = at[excess <= 2 * most]
    low, high = min(*free.interval, shown.min()), max(*free.interval, shown.max(), fit.dead_time)
    room = _BESIDE * (high - low or fit.dt)
    ends = float(max(low - room, 0.0)), float(high + room)
    factor, across = time_axis(np.array(ends), "dead time")
    first, last = free.interval
    layers = [layer("span", "band", "95 % interval", low=factor * first, high=factor * last)]
    alike = [one for one in free.structures if one.delta_bic <= VERY_STRONG and one.interval]
    for row, one in enumerate(alike[:_MOST_BARS] if len(alike) > 1 else []):
        height, name = np.full(2, most * (_FIRST_BAR + _NEXT_BAR * row)), order_words(one)
        layers.append(line(factor * np.array(one.interval), height, "bar", name))
    # Not rounded: what is drawn is the profile itself.
    whole = {"x": (factor * at).tolist(), "y": excess.tolist()}
    layers += [layer("line", "model", f"order {free.order}") | whole,
               layer("level", "ink", "95 %", y=CHI2_95)]  # fmt: skip
    said, step = in_time(fit.dead_time, 4), min(fit.dt, (ends[1] - ends[0]) / 100)
    here = handle("dead_time", "dead time", fit.dead_time, said, ends, step, per_unit=factor)
    y = axis("misfit", "noise variances", (0.0, most))
    return panel("criterion", "Which dead times the record allows", across, y, layers, [here])


def _residual(fit: OutputErrorFit) -> JSON:
    factor, across = time_axis(fit.time)
    time, noise = factor * fit.time, np.full(2, 2 * fit.noise)
    layers = [
        layer("band", "noise", "noise (2 std)", x=time[[0, -1]], low=-noise, high=noise),
        line(time, fit.measured - fit.fitted, "measured", "residual"),
    ]
    y = axis("residual", fit.output_unit)
    return panel("residual", "What the model leaves", across, y, layers)
