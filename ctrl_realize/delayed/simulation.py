"""Simulate a model on a record, with estimated initial state and offset."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Literal

import control as ct
import numpy as np

from .._checks import check_type, one_of
from ..data import Record
from ..data.given import check_complete, check_input
from ..errors import DataError, UnsuitableSystemError
from ..numerics.arrays import FloatArray, later, unit_columns
from ..numerics.state_space.responses import markov, step_response
from . import DelayedStateSpace
from .inside.conversions import continuous
from .operands import in_state_space
from .parts import matrices_of

Start = Literal["estimate", "rest"]

PIECES = 16
"""Largest number of levels that represent the unknown input within a dead time."""


def simulate_record(
    system: ct.StateSpace, record: Record, start: str, *, gaps: bool = False
) -> FloatArray:
    """Simulate the outputs of a record, shape (p, N), with the best initial state.

    Errors are weighted by the range of each output. An offset of every output is always estimated,
    with ``start="estimate"`` also the state of the core, the input within the dead times before
    the record, and its level at rest, of which an integrator makes a slope. With `gaps`, outputs
    may be missing.
    """
    start = one_of(start, "start", ("estimate", "rest"))
    (check_input if gaps else check_complete)(record, "a simulation")
    model = as_delayed(system, record)
    u, y = np.atleast_2d(record.input), np.atleast_2d(record.output)
    p, N = y.shape
    # In steady state, the input had its first value before the record.
    forced = _forced(model, u, record.dt)
    columns = [np.kron(np.eye(p), np.ones((N, 1)))]
    if start == "estimate":
        columns += _unknown_starts(model, N)
    regressors = np.hstack(columns)
    # Every output is scaled to its unit, so that outputs with large numbers do not dominate.
    unit = np.repeat(_units(y), N)
    alike, scale = unit_columns(regressors / unit[:, None])
    target = (y - forced).ravel() / unit
    if gaps:
        seen = ~np.isnan(target)
        alike, target = alike[seen], target[seen]
    weights = np.linalg.lstsq(alike, target, rcond=1e-10)[0]
    return np.asarray(forced + (regressors @ (weights / scale)).reshape(p, N))


def _forced(model: DelayedStateSpace, u: FloatArray, dt: float) -> FloatArray:
    """Response (p, N) from steady state, through the actuator that was fitted with the model."""
    actuator = None if model.fit is None else model.fit.actuator
    if actuator is None:
        return np.atleast_2d(model.simulate(u - u[:, :1]))
    gain = float(np.real(np.ravel(model.delay_free.dcgain())[0]))
    driven = actuator.driven(lambda signal: np.ravel(model.simulate(signal)), u[0], gain, dt)
    return np.atleast_2d(driven)


def _units(outputs: FloatArray) -> FloatArray:
    """Range of every output relative to the largest one; 1 for a constant output."""
    ranges = np.nanmax(outputs, axis=1) - np.nanmin(outputs, axis=1)
    largest = ranges.max() or 1.0
    return np.asarray(np.where(ranges > 0, ranges, largest) / largest)


def _unknown_starts(model: DelayedStateSpace, N: int) -> list[FloatArray]:
    """Responses (p N, columns) to the initial state, to past input, and to its level at rest."""
    core = model.delay_free
    n, p, m = core.nstates, core.noutputs, core.ninputs
    free = markov(core.A, np.eye(n), core.C, np.zeros((p, n)), N + 1)[:, :, 1:]
    parts = [_through_outputs(free, model)] if n else []
    held = [(j, *e) for j in range(m) for e in [*_pieces(min(model.input_delays[j], N)), (0, N)]]
    steps = step_response(*matrices_of(core), N)
    pulses = [later(steps[:, [j]], a) - later(steps[:, [j]], b) for j, a, b in held]
    parts.append(_through_outputs(np.concatenate(pulses, axis=1), model))
    for i in range(p):
        for first, last in _pieces(min(model.output_delays[i], N)):
            level = np.zeros((p, N))
            level[i, first:last] = 1.0
            parts.append(level.reshape(-1, 1))
    return parts


def _pieces(samples: int) -> list[tuple[int, int]]:
    edges = np.unique(np.linspace(0, samples, min(samples, PIECES) + 1).round())
    return [(int(a), int(b)) for a, b in pairwise(edges)]


def _through_outputs(responses: FloatArray, model: DelayedStateSpace) -> FloatArray:
    """Delay responses (p, columns, N) at the outputs, and reshape them to (p N, columns)."""
    late = np.stack([later(r, q) for r, q in zip(responses, model.output_delays, strict=True)])
    return late.transpose(0, 2, 1).reshape(-1, responses.shape[1])


def as_delayed(system: Any, record: Record, *, stable: bool = True) -> DelayedStateSpace:
    """Check that a system fits a record; add zero delays if it has none."""
    kinds, expected = (ct.StateSpace, ct.TransferFunction), "a discrete control.StateSpace"
    check_type(system, kinds, "system", expected, UnsuitableSystemError)
    model = system if isinstance(system, ct.StateSpace) else in_state_space(system)
    if not model.isdtime(strict=True) or model.dt is True:
        raise UnsuitableSystemError(
            "the system is not discrete with a sample time; sample it with "
            "delayed_ss(system, dt=...)"
        )
    if not np.isclose(model.dt, record.sample_time, rtol=1e-3, atol=0):
        raise DataError(
            f"the record has the sample time {record.sample_time:g} s, the system {model.dt:g} s"
        )
    if (model.ninputs, model.noutputs) != (record.ninputs, record.noutputs):
        raise DataError(
            f"the record has {record.ninputs} inputs and {record.noutputs} outputs, the system "
            f"{model.ninputs} and {model.noutputs}"
        )
    delayed = model if isinstance(model, DelayedStateSpace) else DelayedStateSpace(model)
    worst = np.abs(delayed.delay_free.poles()).max(initial=0.0)
    if stable and worst > 1 + 1e-6:
        raise UnsuitableSystemError(
            f"the system is unstable (a pole at |z| = {worst:.6g}): its simulation diverges"
        )
    return _on_axis(delayed, record.dt) if record.irregular else delayed


def _on_axis(model: DelayedStateSpace, step: float) -> DelayedStateSpace:
    """Sample the continuous model again, at the steps of the time axis of irregular stamps."""
    return continuous(model).to_discrete(step).replace(fit=model.fit)  # type: ignore[no-any-return]
