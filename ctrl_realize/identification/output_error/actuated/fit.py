"""Fit an actuator to the records of an output-error fit, and choose between the two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...._flags import Flag, flagged, marked
from ...._parameters import Parameter
from ....errors import DataError
from ....numerics.actuated.choice import ActuatedFit, fit_actuated
from ....numerics.actuated.motions import at_parts
from ....numerics.actuated.records import FEW_MOVES, ActuatedRecord, actuated_record
from ....numerics.actuated.search import family_of
from ....numerics.arrays import FloatArray
from ....numerics.constants import CHI2_95, VERY_STRONG, Z_95
from ....numerics.engine.local_terms import Segments, local_columns
from ....numerics.engine.problem import Structure
from ....numerics.engine.static_gain import static_gain
from ....numerics.engine.structures import Scales
from ....numerics.families.physical import fitted_parameters
from ....numerics.output_error.any_input.window import WHITE
from ....numerics.output_error.result import (
    Followed,
    OutputErrorEstimate,
    ProcessEstimate,
    Residual,
    StructureFit,
    followed_percent,
)
from ....numerics.output_error.step_data import bare_data, own_regressors
from ....numerics.output_error.step_fit import ADEQUATE
from ....numerics.signals.noise import mad_sigma
from ...step.steps import found_edges
from ..flags import missed, model_flags
from ..result import OutputErrorFit
from .alternatives import (
    ALTERNATIVES,
    cannot_tell,
    missing_tests,
    model_of,
    not_needed,
    unresolved,
    wanted,
)
from .result import ActuatorFit

_MOST_EDGES = 24  # of a command with noise, whose levels are then found
_WELL = 0.25  # relative half width of an interval up to which a parameter is resolved


def with_actuator(
    result: OutputErrorFit,
    linear: Callable[[], OutputErrorFit],
    asked: str,
    structures: tuple[Structure, ...] | None,
) -> OutputErrorFit:
    """Fit an actuator beside a linear model, or a linear model if there is no strong evidence.

    Where an actuator is not ruled out either, the interval of the dead time covers both.
    `structures` are those that were asked for; `result` is a linear fit as start, `linear` makes
    the one that is reported where no actuator is needed.

    Raises
    ------
    DataError
        The commands cannot identify the actuator that was requested.
    """
    free = result
    if len(result.records) > 1 or (result.data.load is not None and result.data.load.early):
        # What a valve does makes a linear model see a load soon after the step.
        free = replace(result, data=replace(result.data, load=None))
    parts = _parts(free)
    names = tuple(ALTERNATIVES) if asked == "auto" else (asked,)
    tried = {name: wanted(name, parts) for name in names}
    identifiable = [name for name in names if tried[name]]
    if asked != "auto" and not identifiable:
        raise DataError(cannot_tell(asked))
    not_identifiable = [name for name in names if name not in identifiable]
    skipped = (missing_tests(not_identifiable),) if not_identifiable else ()
    # A kind may belong to two of those that were asked for.
    kinds = list(dict.fromkeys(one for name in identifiable for one in tried[name]))
    scales = _scales(result)
    found = fit_actuated(parts, scales, kinds, structures)
    if found is None:
        result = linear()
        return replace(result, choices=result.choices + skipped)
    if found.evidence <= VERY_STRONG:
        result, said = linear(), (*skipped, not_needed(identifiable, found.evidence))
        if found.evidence >= -VERY_STRONG:
            # The interval covers a model with an actuator that is not ruled out.
            (low, high), old = found.ends[0], result.estimate
            estimate = replace(old, low=min(low, old.low), high=max(high, old.high))
            result = replace(result, estimate=estimate)
        return replace(result, choices=result.choices + said)
    return _replaced(free, scales, found, skipped)


def _parts(result: OutputErrorFit) -> list[ActuatedRecord]:
    """Records for the fit of an actuator."""
    if len(result.records) == 1:
        return [_only_part(result)]
    found = []
    for record in result.records:
        output, command = np.ravel(record.output), np.ravel(record.input)
        edges = [(edge.index, edge.samples) for edge in found_edges(record, _MOST_EDGES)]
        terms = None if edges else _free_motion(result, output.size)
        found.append(actuated_record(output, command, record.dt, edges=edges, regressors=terms))
    return found


def _only_part(result: OutputErrorFit) -> ActuatedRecord:
    record, data = result.records[0], result.data
    output, command = np.ravel(record.output).copy(), np.ravel(record.input)
    if np.isfinite(result.onset):
        every = replace(data, rows=np.arange(command.size), output=np.zeros(command.size))
        terms = own_regressors(every, result.estimate.poles)
        return actuated_record(output, command, record.dt, edges=data.edges, regressors=terms)
    rows = np.round((result.time - record.time[0]) / record.dt).astype(np.int64)
    output[: rows[0]] = np.nan
    part = slice(0, int(rows[-1]) + 1)
    if rows[-1] - rows[0] + 1 < output.size // 2:
        # Of a long record the same part as that of the linear fit.
        part = slice(int(rows[0]), int(rows[-1]) + 1)
    few = np.count_nonzero(np.diff(command[part])) <= FEW_MOVES  # a test, which begins at rest
    free = None if few else _free_motion(result, output[part].size)
    return actuated_record(output[part], command[part], record.dt, regressors=free)


def _free_motion(result: OutputErrorFit, size: int) -> FloatArray:
    """Level, drift, and free response of the lags of the linear model, (N, q)."""
    clock = result.data.dt * np.arange(size, dtype=np.float64)
    fixed = np.stack([np.ones(size), np.linspace(0, 1, size)], axis=1)
    segment = Segments.single(clock, fixed)
    return np.asarray(local_columns(segment, result.estimate.poles[None])[0])


def _scales(result: OutputErrorFit) -> Scales:
    dt = result.data.dt
    onset = result.onset if np.isfinite(result.onset) else result.dead_time
    longest = max(record.time[-1] - record.time[0] for record in result.records)
    lags = result.total_delay - result.dead_time
    return Scales(
        onset=max(onset, 0.5 * dt),
        rise=float(np.clip(lags, 2 * dt, longest / 4)),
        length=float(longest),
        dt=dt,
        latest=max(result.estimate.latest, result.dead_time),
    )


def _replaced(
    result: OutputErrorFit, scales: Scales, found: ActuatedFit, skipped: tuple[str, ...]
) -> OutputErrorFit:
    parts, measured = found.records.parts, found.records.output
    data, time = result.data, result.time
    if len(parts) > 1 or measured.size != result.measured.size:
        command = np.concatenate([part.command[part.rows] for part in parts])
        sigma, span = float(np.std(found.residual)), measured.size * result.data.dt
        data = bare_data(measured, command, result.data.dt, sigma, span)
        time = result.data.dt * np.arange(measured.size, dtype=np.float64)
    estimate = _estimate(result, scales, found)
    actuator = _actuator_fit(result, found)
    staying = marked("stays_with_actuator")
    if result.data.load is not None:
        staying |= {"load_disturbance"}
    flags: list[Flag] = []
    if not estimate.adequate:
        part = missed(data, estimate, float(time[0]))
        flags.append(flagged("structured_misfit.actuator", missed=part))
    flags += [flag for flag in result.flags if flag.code in staying]
    flags += model_flags(estimate, result.data.dt, scales.length, None)
    if actuator.unresolved:
        flags.append(flagged("actuator_not_resolved", parameters="; ".join(actuator.unresolved)))
    return replace(
        result,
        estimate=estimate,
        data=data,
        time=time,
        repeatability=None,
        choices=skipped,
        flags=tuple(flags),
        actuator=actuator,
    )


def _estimate(result: OutputErrorFit, scales: Scales, found: ActuatedFit) -> OutputErrorEstimate:
    best, family = found.best, family_of(found.best)
    structure, setting = family.plain, (found.variance, scales.length)
    numerator = family.evaluate(found.problem, best.parameters[None]).numerator[0]
    static = static_gain(found.problem, best, *setting)
    parameters = fitted_parameters(found.problem, best, numerator, *setting)
    measured = found.records.output
    fitted = measured - found.residual
    low, high = found.ends[0]
    dead_time = best.dead_time
    low, high = min(low, dead_time), max(high, dead_time)
    edges = np.cumsum([part.rows.size for part in found.records.parts])[:-1]
    complete = followed_percent(edges, measured, fitted)
    if np.isfinite(result.onset) and len(result.records) == 1:
        free = max(measured.size - family.free - 2, 1)
        normalized_rms = float(np.linalg.norm(found.residual) / np.sqrt(free)) / result.data.sigma
        adequate = normalized_rms <= ADEQUATE * max(result.data.colour, 1.0)
    else:
        normalized_rms, adequate = float(np.sqrt(found.correlation)), found.correlation <= WHITE
    row = StructureFit(
        structure, dead_time, static.total, 0.0, (low, high), best.poles, static.gain
    )  # fmt: skip
    profile = (np.array([low, dead_time, high]), np.array([CHI2_95, 0.0, CHI2_95]))
    return OutputErrorEstimate(
        dead_time=dead_time,
        low=low,
        high=high,
        std=(high - low) / (2 * Z_95),
        structure=structure,
        poles=best.poles,
        numerator=numerator,
        adequate=bool(adequate),
        residual=Residual(mad_sigma(measured - fitted), normalized_rms, found.correlation),
        structures=(row,),
        delay_estimates=(),
        fitted=fitted,
        followed=Followed(complete, complete, structure, complete),
        profile=profile,
        latest=result.estimate.latest,
        process=ProcessEstimate(lambda: parameters),
        static=static,
        load=result.data.load,
    )


def _actuator_fit(result: OutputErrorFit, found: ActuatedFit) -> ActuatorFit:
    family, x = family_of(found.best), found.best.parameters
    # Places within play or friction at the beginning of each record, if there are any.
    motion, starts = family.motion(x), x[family.values.stop :]
    travel, timed = family.kind == "saturation", family.kind.startswith("slew")
    unit = "" if family.kind == "characteristic" else result.input_unit
    unit += "/s" if unit and timed else ""
    parameters, vague = [], []
    for name, value, ends in zip(family.names, motion.values, found.ends[1:], strict=True):
        if travel and (ends.low <= 0 or ends.high >= 1):
            continue  # an end that the commands do not reach
        number, low, high = value, *ends
        if travel:
            number, low, high = at_parts(motion.levels, (value, *ends)).tolist()
        std, times = (high - low) / (2 * Z_95), -1 if timed else 0
        parameters.append(Parameter(name, number, std, low, high, False, unit, times))
        # Parts of the range are measured by it, anything else by itself.
        size = (ends.low + ends.high) / 2 if family.properties.logged else 1 / 2
        if not ends.high - ends.low <= 2 * _WELL * size:
            vague.append(unresolved(parameters[-1], family.kind))
    return ActuatorFit(
        model=model_of(motion, float(starts[0]) if starts.size else 0.0),
        actuator_at=family.place,
        parameters=tuple(parameters),
        starts=tuple(starts.tolist()),
        evidence=found.evidence,
        unresolved=tuple(vague),
    )
