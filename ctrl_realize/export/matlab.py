"""Scripts for MATLAB and Simulink: plants with InputDelay, PID controllers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

from .._checks import one_of
from ..delayed import DelayedStateSpace, DelaySystem
from ..design import ContinuousModel, PIDAlgorithm, PIDController, ProcessModel, to_continuous
from ..errors import UnsuitableSystemError
from ..io.atomic import write_text
from .names import ending, identifier, one_line

CALLED = ("ss", "tf", "pid", "pid2", "zeros", "setDelayModel", "Inf")
"""Functions that the scripts call: a variable of that name hides them when a script runs again."""
FORMULAS = {"tustin": "Trapezoidal", "forward": "ForwardEuler", "backward": "BackwardEuler"}


def to_matlab(
    system: Any, path: str | os.PathLike[str], *, name: str | None = None, continuous: bool = False
) -> Path:
    """Write a model or controller as a script of MATLAB's Control System Toolbox.

    Parameters
    ----------
    system : DelayedStateSpace, DelaySystem, ContinuousModel, ProcessModel, PIDController or \
            PIDAlgorithm
        A discrete model becomes ``ss(A, B, C, D, dt, 'InputDelay', d)``, with whole samples of
        delay; a continuous one ``ss`` or ``tf`` with the dead time in s; delays inside of loops
        ``setDelayModel(H, tau)``; a controller ``pid``, and an algorithm with set-point weights
        ``pid2``.
    path : path-like
        File to write, ending in ``.m``.
    name : str, optional
        Of the variable. Default: that of the system.
    continuous : bool
        Convert a discrete model to continuous time, see `design.to_continuous`.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    UnsuitableSystemError
        Another kind of system; a model that has no continuous form.
    OptionError
        A path that does not end in ``.m``.

    Notes
    -----
    Simulink reads the variable in its LTI System and PID Controller blocks. Limits and tracking
    time of an algorithm are parameters of the block (output saturation, anti-windup method
    back-calculation, ``Kb = 1 / tracking_time`` in the parallel form); the script states them.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> model = cr.design.ProcessModel(gain=2.0, lag=40.0, dead_time=6.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print(cr.export.to_matlab(model, Path(folder) / "oven.m", name="oven").read_text())
    % 2 exp(-6 s) / (40 s + 1); time in s
    oven = tf(2, [40 1], 'InputDelay', 6);
    <BLANKLINE>
    """
    target = ending(path, ".m")
    if continuous and isinstance(system, DelayedStateSpace):
        system = to_continuous(system)
    elif continuous:
        one_of(type(system).__name__, "continuous=True for", ("DelayedStateSpace",))
    if isinstance(system, PIDController | PIDAlgorithm):
        text = _pid(system, identifier(name or str(system.name), "C", CALLED))
    elif isinstance(system, ProcessModel):
        text = _process(system, identifier(name or "plant", "plant", CALLED))
    elif isinstance(system, ContinuousModel | DelayedStateSpace):
        if isinstance(system, ContinuousModel):
            core, named, dt = system.core, system.core, "0"
        else:
            core, named, dt = system.delay_free, system, _number(float(system.dt))
        variable = identifier(name or str(named.name), "plant", CALLED)
        delays = list(system.input_delays), list(system.output_delays)
        text = _state_space(core, str(named.name), variable, dt, *delays)
    elif isinstance(system, DelaySystem):
        text = _internal_delays(system, identifier(name or str(system.name), "plant", CALLED))
    else:
        raise UnsuitableSystemError(
            f"to_matlab got a {type(system).__name__}; expected a DelayedStateSpace, a "
            "DelaySystem, a ContinuousModel, a ProcessModel, a PIDController or its algorithm"
        )
    write_text(target, text)
    return target


def _process(model: ProcessModel, variable: str) -> str:
    system = model.transfer_function()
    num, den = (_matrix(np.atleast_2d(part[0][0])) for part in (system.num, system.den))
    words = repr(model).removeprefix("<ProcessModel ").removesuffix(">")
    delay = f", 'InputDelay', {_number(model.dead_time)}" if model.dead_time else ""
    return f"% {words}; time in s\n{variable} = tf({num}, {den}{delay});\n"


def _state_space(
    core: ct.StateSpace, name: str, variable: str, dt: str, before: list[float], behind: list[float]
) -> str:
    unit = "s" if dt == "0" else "samples"
    lines = [
        f"% {one_line(name)}: {core.nstates} states, sample time {dt} s (0: continuous), "
        f"delays in {unit}"
    ]
    for letter in "ABCD":
        matrix = getattr(core, letter)
        shape = f"zeros({matrix.shape[0]}, {matrix.shape[1]})"
        lines.append(f"{variable}_{letter} = {_matrix(matrix) if matrix.size else shape};")
    matrices = ", ".join(f"{variable}_{letter}" for letter in "ABCD")
    given = f"{variable} = ss({matrices}, {dt}"
    if any(before):
        given += f", 'InputDelay', {_matrix(np.array([before]).T)}"
    if any(behind):
        given += f", 'OutputDelay', {_matrix(np.array([behind]).T)}"
    return "\n".join([*lines, given + ");", *_names(variable, core), ""])


def _names(variable: str, system: ct.StateSpace) -> list[str]:
    lines = []
    for what, labels in (("InputName", system.input_labels), ("OutputName", system.output_labels)):
        names = ", ".join("'" + one_line(str(each)).replace("'", "''") + "'" for each in labels)
        lines.append(f"{variable}.{what} = {{{names}}};")
    return lines


def _internal_delays(system: DelaySystem, variable: str) -> str:
    """Both have the same form: the last outputs of the core come back through the delays."""
    core = f"{variable}_core"
    text = _state_space(system.core, str(system.name), core, _number(float(system.dt)), [], [])
    delays = _matrix(np.array([system.internal_delays]).T)
    lines = [f"{variable} = setDelayModel({core}, {delays});", *_names(variable, system), ""]
    return text + "\n".join(lines)


def _pid(system: PIDController | PIDAlgorithm, variable: str) -> str:
    ki = system.kp / system.ti
    gains = ", ".join(map(_number, (system.kp, ki, system.kp * system.td, system.tf)))
    sampled = ""
    if system.dt:
        sampled = (
            f", {_number(float(system.dt))}, 'IFormula', '{FORMULAS[system.method]}', "
            "'DFormula', 'BackwardEuler'"
        )
    lines = [f"% {one_line(str(system.name))}: Kp, Ki, Kd, Tf in s"]
    if isinstance(system, PIDController):
        return "\n".join([*lines, f"{variable} = pid({gains}{sampled});", ""])
    weights = f"{_number(system.setpoint_weight)}, {_number(system.derivative_weight)}"
    lines.append(f"{variable} = pid2({gains}, {weights}{sampled});")
    low, high = map(_number, system.output_limits)
    lines.append(f"{variable}_limits = [{low} {high}];")
    if tracking := system.coefficients.tracking:
        lines.append(f"{variable}_tracking_time = {_number(float(system.dt) / tracking)};")
    return "\n".join([*lines, ""])


def _matrix(values: Any) -> str:
    rows = [" ".join(map(_number, row)) for row in np.atleast_2d(values)]
    return rows[0] if np.size(values) == 1 else f"[{'; '.join(rows)}]"


def _number(value: Any) -> str:
    number = float(value)
    if np.isinf(number):
        return "Inf" if number > 0 else "-Inf"
    return str(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)
