"""Models of a session: fits as tasks, and the model that follows a drag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .._parameters import Parameter
from .._wording import time_unit
from ..data import Record
from ..delayed import DelayedStateSpace, delayed_ss
from ..errors import OptionError
from ..identification import OutputErrorFit, ProcessStructure, identify
from ..identification.plausible import continuous_core
from ..numerics.arrays import FloatArray
from .drawing import JSON, line

MOST_LAGS = 3
_REACH = 3.0  # total delays after the step, in the panel of the start of the response
_BEFORE = 0.3  # of that, before the step
_SAME = 1.005
"""Residual over that of the best model up to which both are the same."""


def identified(
    records: Sequence[Record], structure: Sequence[int] | None, known: Mapping[str, Any]
) -> DelayedStateSpace:
    """Fit a model to records together: of all structures, of one, or with known parameters."""
    chosen: Any = None if structure is None else [tuple(structure)]
    if known:
        chosen = ProcessStructure(known["name"], fixed=known["fixed"])
    return identify(records[0] if len(records) == 1 else records, structures=chosen)


def fit_of_lags(system: DelayedStateSpace) -> OutputErrorFit | None:
    """The output-error fit of a model, also where a state-space model takes its place."""
    fit = getattr(system.fit, "lags", system.fit)
    return fit if isinstance(fit, OutputErrorFit) else None


def with_known(system: DelayedStateSpace, known: Mapping[str, float]) -> JSON:
    """Process model with the parameters of a fit, some of which are known, for `identified`.

    Raises
    ------
    OptionError
        Process models have at most three lags, one zero and one integrator.
    """
    fit = fit_of_lags(system)
    names = [] if fit is None else [one.name for one in fit.parameters]
    lags = sum(name.startswith("lag_") for name in names)
    pairs, leads = names.count("pair_time_1"), names.count("lead_1")
    plain = 2 + lags + 2 * pairs + leads == len(names) and lags + 2 * pairs <= MOST_LAGS
    if fit is None or not plain or fit.integrators > 1:
        raise OptionError(
            "a parameter can be known in a model of lags with dead time, with at most three lags "
            f"and one zero; got {', '.join(names) or 'another one'}: choose a simpler structure"
        )
    name = f"P{lags + 2 * pairs}D" + "I" * fit.integrators + "Z" * leads + "U" * pairs
    ProcessStructure(name, fixed=known)  # refuses what is no parameter of it
    return {"name": name, "fixed": dict(known)}


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
        sides = {"above": np.array([values["gain"]]), "below": np.array([1.0])}
        for name, value in values.items():
            kind, _, rest = name.partition("_")
            side = {"lag": "below", "pair": "below", "lead": "above", "zero": "above"}.get(kind)
            if side is None or rest.startswith("damping"):
                continue
            damping = values.get(f"{kind}_{rest.replace('time', 'damping')}", 1.0)
            double = [value**2, 2 * damping * value, 1.0]
            factor = double if rest.startswith("time") else [value, 1.0]
            sides[side] = np.polymul(sides[side], factor)
        below = sides["below"]
        poles = np.r_[np.roots(below), np.zeros(self.fit.integrators)].astype(np.complex128)
        core, data = continuous_core((sides["above"] / below[0])[::-1], poles), self.fit.data
        model = delayed_ss(core, dead_time=max(values["dead_time"], 0.0), dt=data.dt)
        if data.motion is None:
            return self._on_records(model)
        return np.asarray(np.ravel(model.simulate(data.input - data.input[0]))[data.rows])

    def _on_records(self, model: DelayedStateSpace) -> FloatArray:
        """Response (N,) of a fit of other inputs than steps, which has one record after another."""
        time, first = self.fit.time, self.fit.records[0]
        found, late, done = np.zeros(time.size), time[0] - first.time[0], 0
        for one in self.fit.records:
            at = time[done:] - time[min(done, time.size - 1)] + one.time[0] + late
            at = at[at <= one.time[-1] + 0.5 * one.dt]
            moves = np.ravel(model.simulate(one.input - one.input[0]))
            found[done : done + at.size] = np.interp(at, one.time, moves)
            done += at.size
        return found

    def output(self, moved: Mapping[str, float]) -> FloatArray:
        """Output (N,) with some parameters changed."""
        return self.fit.fitted + self.response(moved) - self.own

    def misfit(self, output: FloatArray, free: OutputErrorFit) -> JSON:
        """Residual of a model beside that of the best one, with nothing known."""
        left = (self.fit.measured - one for one in (output, free.fitted))
        here, best = (float(np.sqrt(np.nanmean(one**2))) for one in left)
        more = f" ({100 * (here / best - 1):+.0f} %)" if best and here > _SAME * best else ""
        text = f"residual {here:.4g}, of the best model {best:.4g}{more}"
        return {"residual": here, "best": best, "text": text}


def step_time(fit: OutputErrorFit) -> float:
    """Time in s, on the axis of the fit, at which the input first moves."""
    data, record = fit.data, fit.records[0]
    if data.motion is not None:
        return float(fit.time[0] + (data.edges[0][0] - data.rows[0]) * data.dt)
    return float(record.time[int(np.argmax(record.input != record.input[0]))])


def start_of(fit: OutputErrorFit) -> slice:
    """Samples about the start of the response."""
    reach = _REACH * max(fit.total_delay, 4 * fit.dt) if np.isfinite(fit.total_delay) else np.inf
    since = fit.time - step_time(fit)
    inside = np.flatnonzero((since >= -_BEFORE * reach) & (since <= reach))
    return slice(int(inside[0]), int(inside[-1]) + 1) if inside.size > 8 else slice(None)


def drag(system: DelayedStateSpace, free: DelayedStateSpace, moved: Mapping[str, float]) -> JSON:
    """What is redrawn while parameters are dragged.

    Raises
    ------
    OptionError
        The model is not one of lags with dead time, or has no such parameter.
    """
    fit, best = fit_of_lags(system), fit_of_lags(free)
    if fit is None or best is None or moved.keys() - {one.name for one in fit.parameters}:
        raise OptionError(f"{', '.join(moved)}: not a parameter of this model")
    drawn = Drawn(fit)
    output, time = drawn.output(moved), time_unit(float(np.abs(fit.time).max()))[0] * fit.time
    parts = {"start": start_of(fit), "response": slice(None)}
    lines = {key: line(time[part], output[part], "model") for key, part in parts.items()}
    misfit = drawn.misfit(output, best)
    if "dead_time" in moved:
        low, high = best.interval
        misfit["allowed"] = low <= moved["dead_time"] <= high
        misfit["text"] += "" if misfit["allowed"] else "; outside of what the record allows"
    return {"lines": lines, "misfit": misfit}
