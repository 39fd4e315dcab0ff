"""What is exported as code: a PID algorithm, a plant with dead time, the input of a test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..delayed import DelayedStateSpace
from ..design import PIDAlgorithm, PIDController
from ..errors import UnsuitableSystemError
from ..experiment import ExperimentPlan
from .names import identifier
from .program import Assign, If, Program, Statement, Variable, literal, weighted_sum

MOST_TERMS = 10_000
"""Largest number of products in a step of exported code."""


def program_of(system: Any, name: str | None) -> Program:
    """Return the equations of a controller, a plant or the input of a test.

    Raises
    ------
    UnsuitableSystemError
        Anything but a discrete PID, a discrete plant whose delays are at its ends, or a plan.
    """
    if isinstance(system, ExperimentPlan):
        return test_program(system, identifier(name or "test_input", "test_input"))
    if isinstance(system, PIDController):
        system = system.algorithm()
    if isinstance(system, PIDAlgorithm):
        return pid_program(system, identifier(name or system.name, "pid"))
    if isinstance(system, DelayedStateSpace):
        return plant_program(system, identifier(name or str(system.name), "plant"))
    raise UnsuitableSystemError(
        f"code can be written for a PIDAlgorithm, a discrete PIDController, a DelayedStateSpace "
        f"and an ExperimentPlan; got a {type(system).__name__}. A continuous plant: "
        "design.to_discrete(core, dead_time, dt)"
    )


def pid_program(algorithm: PIDAlgorithm, name: str) -> Program:
    """Write the steps of `PIDAlgorithm`, in the order in which it computes them."""
    c = algorithm.coefficients
    constants = [
        Variable("p_setpoint", "kp b, on the set-point", value=c.p_setpoint),
        Variable("p_measured", "kp, on the measured value", value=c.p_measured),
        Variable("bias", "output at zero error", value=c.bias),
    ]
    states: list[Variable] = []
    scratch: list[Variable] = []
    before: list[Statement] = []
    first: list[Statement] = []
    body: list[Statement] = []
    base, wanted = "bias + (p_setpoint * setpoint - p_measured * measured)", "base"
    if c.slope:
        base += " + d_part"
        constants += [
            Variable("d_pole", "tf / (tf + dt)", value=c.pole),
            Variable("d_gain", "kp td / (tf + dt)", value=c.slope),
            Variable("d_setpoint", "c, on the set-point", value=c.weight),
        ]
        states += [
            Variable("d_part", "derivative part"),
            Variable("rate_before", "input of the derivative at the last call"),
        ]
        scratch.append(Variable("rate"))
        first.append(Assign("rate_before", "rate"))
        before.append(Assign("rate", "d_setpoint * setpoint - measured"))
        body += [
            Assign("d_part", "d_pole * d_part + d_gain * (rate - rate_before)"),
            Assign("rate_before", "rate"),
        ]
    if c.integral:
        wanted = "base + (i_part + i_newest * deviation)"
        constants += [
            Variable("i_gain", "kp dt / ti", value=c.integral),
            Variable("i_newest", "its part that acts at once", value=c.newest),
            Variable("tracking", "dt / tracking time of the anti-windup", value=c.tracking),
        ]
        states.append(Variable("i_part", "integral part"))
        scratch.append(Variable("deviation"))
        first.append(Assign("i_part", "(p_measured - p_setpoint) * setpoint"))
        body.append(Assign("deviation", "setpoint - measured"))
    if first:
        states.append(Variable("started", "after the first call", "boolean"))
        before.append(If("started", (*first, Assign("started", "true")), negated=True))
    body = [
        *before,
        *body,
        Assign("base", base),
        Assign("wanted", wanted),
        If("manual", (Assign("u", "manual_output"),), (Assign("u", "wanted"),)),
    ]
    for limit, sign, value in (("u_low", "<", c.low), ("u_high", ">", c.high)):
        if math.isfinite(value):
            constants.append(Variable(limit, "limit of the output", value=value))
            body.append(If(f"u {sign} {limit}", (Assign("u", limit),)))
    if c.integral:
        smooth = Assign("i_part", "u - base - i_newest * deviation")
        add = Assign("i_part", "i_part + i_gain * deviation + tracking * (u - wanted)")
        body.append(If("manual", (smooth,), (add,)))
    return Program(
        name,
        (
            f"PID algorithm {algorithm.name}, call every {algorithm.dt:g} s",
            f"kp = {algorithm.kp:.6g}, ti = {algorithm.ti:.6g} s, td = {algorithm.td:.6g} s, "
            f"tf = {algorithm.tf:.6g} s{_rules(algorithm)}",
        ),
        (
            Variable("setpoint", "set-point"),
            Variable("measured", "measured value"),
            Variable("manual", "manual operation", "boolean"),
            Variable("manual_output", "output in manual operation"),
        ),
        (Variable("u", "output of the controller"),),
        tuple(states),
        tuple(body),
        tuple(constants),
        (*scratch, Variable("base"), Variable("wanted")),
    )


def _rules(algorithm: PIDAlgorithm) -> str:
    """How integral and derivative are discretized, for those that there are."""
    c = algorithm.coefficients
    integral = f", integral by the {algorithm.method} rule" if c.integral else ""
    return integral + (", derivative by the backward rule" if c.slope else "")


def plant_program(plant: DelayedStateSpace, name: str) -> Program:
    """Write one sample of a plant: from the input since the last call to the output at this one."""
    core = plant.delay_free
    n, nu, ny = core.nstates, core.ninputs, core.noutputs
    if n * (n + nu + ny) > MOST_TERMS:
        raise UnsuitableSystemError(
            f"{plant.name!r} has {n} states besides its delays, too many for code without "
            f"loops; expected at most {MOST_TERMS} products in a step. Use design.reduce"
        )
    for i, delay in enumerate(plant.input_delays):
        if delay == 0 and core.D[:, i].any():
            raise UnsuitableSystemError(
                f"{plant.name!r} responds within the same sample to input {i}; expected a delay "
                "of at least one sample, or no feedthrough, as every sampled plant with a hold has"
            )
    inputs, outputs = _numbered("u", nu), _numbered("y", ny)
    x, new = [f"x{i + 1}" for i in range(n)], [f"x{i + 1}_next" for i in range(n)]
    late, newest = [f"{u}_late" for u in inputs], [f"{u}_newest" for u in inputs]
    states = [Variable(each, "state") for each in x]
    scratch = [Variable(each) for each in new]
    body: list[Statement] = []
    for i, (u, delay) in enumerate(zip(inputs, plant.input_delays, strict=True)):
        if delay:
            states += _line(u, delay)
            if core.B[:, i].any():
                scratch.append(Variable(late[i]))
                body.append(Assign(late[i], f"{u}_line[{u}_at]"))
            body += _push(u, u, delay)
            if core.D[:, i].any():
                scratch.append(Variable(newest[i]))
                body.append(Assign(newest[i], f"{u}_line[{u}_at]"))
        else:
            late[i] = u
    names = x + late
    for i in range(n):
        body.append(Assign(new[i], weighted_sum([*core.A[i], *core.B[i]], names)))
    body += [Assign(old, after) for old, after in zip(x, new, strict=True)]
    names = x + newest
    for j, (y, delay) in enumerate(zip(outputs, plant.output_delays, strict=True)):
        value = weighted_sum([*core.C[j], *core.D[j]], names)
        if delay:
            states += _line(y, delay)
            scratch.append(Variable(f"{y}_now"))
            body += [
                Assign(f"{y}_now", value),
                Assign(y, f"{y}_line[{y}_at]"),
                *_push(y, f"{y}_now", delay),
            ]
        else:
            body.append(Assign(y, value))
    return Program(
        name,
        (
            f"Plant {plant.name}, call every {plant.dt:g} s",
            f"{n} states, delays of {', '.join(map(str, plant.input_delays))} samples at the "
            f"inputs, {', '.join(map(str, plant.output_delays))} at the outputs",
            "inputs: as applied since the last call; outputs: at this call",
        ),
        tuple(map(Variable, inputs, map(str, plant.input_labels))),
        tuple(map(Variable, outputs, map(str, plant.output_labels))),
        tuple(states),
        tuple(body),
        scratch=tuple(scratch),
    )


def test_program(plan: ExperimentPlan, name: str) -> Program:
    """Write the input of a test, one sample a call; before and after it the input rests."""
    changes = np.flatnonzero(np.diff(plan.command)) + 1
    if changes.size > MOST_TERMS:
        raise UnsuitableSystemError(
            f"the input changes {changes.size} times, too often for code without tables; expected "
            f"at most {MOST_TERMS}. Use a binary signal: plan.using('random binary')"
        )
    rest = Assign("u", literal(plan.level))
    levels = [If(f"at >= {k}", (Assign("u", literal(plan.command[k])),)) for k in changes]
    count = plan.time.size
    return Program(
        name,
        (
            f"Input of a test ({plan.kind}), call every {plan.dt:g} s, {count} times",
            f"level at rest {plan.level:.6g}; starts when run is true",
        ),
        (Variable("run", "the test is running", "boolean"),),
        (Variable("u", "input of the plant"),),
        (Variable("at", "sample of the test", "integer"),),
        (
            rest,
            If(
                "run",
                (*levels, If(f"at >= {count}", (rest,)), Assign("at", "at + 1")),
                (Assign("at", "0"),),
            ),
        ),
    )


def _numbered(letter: str, count: int) -> list[str]:
    return [letter] if count == 1 else [f"{letter}{i + 1}" for i in range(count)]


def _line(signal: str, delay: int) -> list[Variable]:
    """A ring of the last `delay` values, and the place of the oldest."""
    return [
        Variable(f"{signal}_line", f"last {delay} values of {signal}", length=delay),
        Variable(f"{signal}_at", "place of the oldest", "integer"),
    ]


def _push(signal: str, value: str, delay: int) -> list[Statement]:
    at = f"{signal}_at"
    return [
        Assign(f"{signal}_line[{at}]", value),
        Assign(at, f"{at} + 1"),
        If(f"{at} >= {delay}", (Assign(at, "0"),)),
    ]
