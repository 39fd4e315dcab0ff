"""Models as functional mock-up units (FMI 2.0, co-simulation), by the package pythonfmu."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from dataclasses import replace
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import MissingPackageError
from ..io.atomic import replaced_when_complete
from .equations import program_of
from .languages import python_class
from .names import ending, one_line
from .program import Program

TEMPLATE = """

import pythonfmu


class {unit}(pythonfmu.Fmi2Slave):
    def __init__(self, **settings):
        super().__init__(**settings)
        self.description = {words!r}
        self.program = {name}()
        self.samples = 0
{variables}

    def do_step(self, current_time, step_size):
        last = round((current_time + step_size) / {dt!r})
        if abs(current_time + step_size - last * {dt!r}) > 1e-6 * {dt!r}:
            return False
        while self.samples < last:
            {results} = self.program.step({arguments})
            self.samples += 1
        return True
"""


def to_fmu(system: Any, path: str | os.PathLike[str], *, name: str | None = None) -> Path:
    """Write a plant or controller as an FMU for co-simulation (FMI 2.0).

    Parameters
    ----------
    system : DelayedStateSpace, PIDAlgorithm or PIDController
        Discrete, as for `to_c`.
    path : path-like
        File to write, ending in ``.fmu``.
    name : str, optional
        Of the unit. Default: that of the system.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    MissingPackageError
        Without the package pythonfmu: ``pip install ctrl-realize[fmu]``.
    OptionError
        A path that does not end in ``.fmu``.
    UnsuitableSystemError
        As for `to_c`.

    Notes
    -----
    The unit contains the code of `to_python` and needs a Python on the computer that simulates it,
    but no further packages. A communication step must be a whole number of samples; other steps
    are refused. Inputs are held for the step. Initially all signals are zero.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=2.0, lag=40.0, dead_time=6.0).system(1.0)
    >>> cr.export.to_fmu(plant, "oven.fmu")  # doctest: +SKIP
    PosixPath('oven.fmu')
    """
    target = ending(path, ".fmu")
    program = program_of(system, name)
    try:
        builder = import_module("pythonfmu.builder")
    except ImportError as error:
        raise MissingPackageError(
            "an FMU is made by the package pythonfmu, which is not installed; "
            "pip install ctrl-realize[fmu]"
        ) from error
    places, module = list(sys.path), ""
    try:
        with tempfile.TemporaryDirectory() as folder:
            text = _script(program, float(system.dt))
            # Units in one process share their modules: each needs a name of its own.
            module = f"{program.name}_{sha256(text.encode()).hexdigest()[:16]}"
            script = Path(folder) / f"{module}.py"
            script.write_text(text, encoding="utf-8")
            made = builder.FmuBuilder.build_FMU(script, Path(folder) / f"{program.name}.fmu")
            with replaced_when_complete(target) as temporary:
                shutil.copyfile(made, temporary)
    finally:
        sys.path[:] = places  # the builder adds the folder of its script
        sys.modules.pop(module, None)
    return target


def _script(program: Program, dt: float) -> str:
    lines = []
    for causality, variables in (("input", program.inputs), ("output", program.outputs)):
        for each in variables:
            boolean = each.kind == "boolean"
            kind, start = ("Boolean", "False") if boolean else ("Real", "0.0")
            # An output of known initial value has no unknown for the importer to ask for.
            initial = ", initial=pythonfmu.Fmi2Initial.exact" if causality == "output" else ""
            initial += ", variability=pythonfmu.Fmi2Variability.discrete" if boolean else ""
            lines += [
                f"self.{each.name} = {start}",
                f"self.register_variable(pythonfmu.{kind}({each.name!r}, "
                f"causality=pythonfmu.Fmi2Causality.{causality}, "
                f"description={one_line(each.words)!r}{initial}))",
            ]
    # A name that hides no function of Python, as a class called `round` would.
    own = f"{program.name}_program"
    return python_class(replace(program, name=own)) + TEMPLATE.format(
        unit=f"{program.name}_unit",
        name=own,
        words=one_line(program.words[0]),
        dt=dt,
        variables="\n".join(f"        {line}" for line in lines),
        results=", ".join(f"self.{each.name}" for each in program.outputs),
        arguments=", ".join(f"self.{each.name}" for each in program.inputs),
    )
